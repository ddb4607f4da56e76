"""Backward elimination: causes stay if they improve the simulation of held-out data and their sizes are significant."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import (
    FEWEST_RUNS,
    HeldOut,
    certain_reductions,
    held_out_gain,
    of_several,
    on_common_units,
    prediction_gain,
    prediction_p_value,
    within_stated_std,
)
from expdesign.diagnosis.select.selection import (
    Selection,
    Step,
    insignificant_steps,
    with_alternatives_beside_all,
    with_runs_counted,
    without_step,
)
from expdesign.diagnosis.select.selection_round import open_candidates
from expdesign.diagnosis.select.tuning import TUNING


def eliminate_backward(
    found: Selection,
    windows: Windows,
    cross_validated: Callable[[Selection], tuple[Selection, list[HeldOut]]],
    seed: int,
    re_estimated: HeldOut | None = None,
) -> tuple[Selection, list[HeldOut]]:
    """Drop causes without held-out gain, and causes whose size is indistinguishable from zero.

    What gains nothing beside a cause of which nothing is left is asked again without it. In two runs a cause stays
    whatever its p-value where simulations of held-out data need it beside the others.

    Args:
        cross_validated: the selection, its causes fitted as they are judged, and errors on held-out units of the model
            before any cause, then after every step.
        re_estimated: errors of the model before any cause with its uncertain parameters fitted; None where it has none.

    Returns:
        The selection whose last fit has the standard errors that are reported, and the errors that belong to it.
    """
    reordered: list[Candidate] = []
    while True:
        found, held = cross_validated(found)
        improves = improves_held_out(found, held, seed, windows, re_estimated)
        later = _moved_last(found, improves, windows, reordered)
        if later is not None:
            found = later
            continue
        whole, found = found, before_first_without_gain(found, improves)
        without = partial(_held_without, found, held, windows, cross_validated)
        counted = as_told(found, held, without, windows, seed)
        for index in insignificant_steps(counted.steps):
            others = without_step(list(whole.steps), index, windows)
            if others is None:
                return with_alternatives_beside_all(counted, windows), held
            found = whole.with_steps(tuple(others))
            if not (
                _may_be_needed(index, counted, windows) and _is_needed(counted, held, cross_validated(found)[1], seed)
            ):
                break
        else:
            return with_alternatives_beside_all(counted, windows), held


def _may_be_needed(index: int, found: Selection, windows: Windows) -> bool:
    """Whether simulations may tell against a p-value: of a cause of two runs, which have one degree of freedom."""
    return len(found.steps) > 1 and _are_two_runs(windows) and _may_show_in_predictions(found.steps[index])


def _is_needed(found: Selection, held: Sequence[HeldOut], without: Sequence[HeldOut], seed: int) -> bool:
    """Whether simulations of held-out data need a cause beside the others, for certain.

    Args:
        held: errors on held-out units of the model before any cause, then after every step.
        without: the same without the cause, the others fitted again.
    """
    before, after = without[len(found.steps) - 1], held[len(found.steps)]
    return shows_for_certain(before.like(after), after.like(before), seed)


def _are_two_runs(windows: Windows) -> bool:
    return len(np.unique(windows.batch)) == FEWEST_RUNS - 1


def as_told(
    found: Selection,
    held: Sequence[HeldOut],
    without: Callable[[int], HeldOut | None],
    windows: Windows,
    seed: int,
) -> Selection:
    """The selection with standard errors and p-values that count how runs differ.

    Args:
        held: errors on held-out units of the model before any cause, then after every step.
        without: those of the model of all causes but one, by its place.
    """
    counted = with_runs_counted(found, open_candidates(found.last, windows), np.random.default_rng(seed))
    return two_runs_by_predictions(counted, held, without, windows)


def _held_without(
    found: Selection,
    held: Sequence[HeldOut],
    windows: Windows,
    cross_validated: Callable[[Selection], tuple[Selection, list[HeldOut]]],
    index: int,
) -> HeldOut | None:
    """Errors on held-out units of the model without one cause, the others fitted again; None where they cannot be."""
    if index == len(found.steps) - 1:
        return held[index]
    others = without_step(list(found.steps), index, windows)
    return None if others is None else cross_validated(found.with_steps(tuple(others)))[1][len(others)]


def two_runs_by_predictions(
    found: Selection, held: Sequence[HeldOut], without: Callable[[int], HeldOut | None], windows: Windows
) -> Selection:
    """Causes in two runs with p-values of predictions from one sample to the next, where these show them better.

    Of how runs differ two tell with one degree of freedom, which makes nothing significant. Held-out parts of them do:
    what is said is of these runs sailed on, as intervals of gains are. Arguments as of `as_told`.
    """
    if not found.steps or not _are_two_runs(windows):
        return found
    whole = held[len(found.steps)]

    def told(index: int, step: Step) -> Step:
        before = without(index) if _may_show_in_predictions(step) else None
        if before is None:
            return step
        pair = before.like(whole), whole.like(before), windows, step.chosen.fit.noise
        p_value = of_several(prediction_p_value(*pair), step.chosen.multiplicity)
        shown = p_value < step.p_value and prediction_gain(*pair)[0] >= TUNING.least_predicted
        return replace(step, p_value=p_value) if shown else step

    return replace(found, steps=tuple(told(*one) for one in enumerate(found.steps)))


def only_nuisance(step: Step, found: Selection) -> bool:
    """Whether the step only says that uncertain parameters are beyond their stated standard deviations."""
    return set(step.chosen.keys) <= set(found.first.keys)


def _moved_last(
    found: Selection, improves: Sequence[bool], windows: Windows, reordered: list[Candidate]
) -> Selection | None:
    """The steps with a cause without gain moved last, once for each such cause; None where there is none.

    The fault of a sensor may show no gain as long as another fault of the same sensor is not in the model.
    """
    steps = list(found.steps)
    for index, step in enumerate(steps):
        candidate = step.chosen.candidate
        if improves[index] or not any(improves[index + 1 :]) or any(candidate is other for other in reordered):
            continue
        reordered.append(candidate)
        others = without_step(steps, index, windows)
        if others is not None:
            last = replace(step, chosen=replace(step.chosen, fit=found.last), before=others[-1].chosen.fit)
            return found.with_steps((*others, last))
    return None


def before_first_without_gain(found: Selection, improves: Sequence[bool]) -> Selection:
    """The selection up to the first cause without gain."""
    return found.with_steps(found.steps[: int(np.argmin([*improves, False]))])


def improves_held_out(
    found: Selection,
    held: Sequence[HeldOut],
    seed: int,
    windows: Windows | None = None,
    re_estimated: HeldOut | None = None,
) -> list[bool]:
    """Which causes improve the simulation of held-out data.

    The test of the first cause is more sensitive than a simulated fit. So the first cause stays, unless it makes the
    simulation worse, or some output is worse on average and the interval allows a larger loss. (Varying currents make
    the intervals of few runs wide.) Later causes need a gain, because no model of a real ship is exact: once a large
    error is explained, small differences between model and ship become significant. A small gain counts if its interval
    excludes zero. Uncertain parameters are estimated in any case, so as a cause they need no gain. A cause that
    imitates others needs a gain even as the first, and may make no output worse by more than that. Where whole
    simulations lead away, the interval of a later cause must exclude zero, and so must that of any cause beside the
    parameters of the file, as tests are beside the likeliest ones. What takes less than `Tuning.least_reduction` off
    every error is a remark, whatever its p-value, and so is what is impossible (`Candidate.bounds`).

    What is stated of a finding has to be certain: errors fall on average, and that of some output by enough to be worth
    a word, both by intervals that exclude zero. Of a first cause, that may be compared with the model that is fitted as
    it is but for the cause: parameters of a file that were fitted to the same data have seen what is held out, those
    fitted with a cause have not. Or it shows in predictions from one sample to the next, where simulations say too
    little. A cause that imitates none may show in these beside simulations that lose nothing on average; one that
    imitates others, or a later one, if these gain by enough, too. It has to do so beside the model with its uncertain
    parameters fitted as well, which may be all that is gained, unless stretches of other runs show both together.
    Several parameters at once, which imitate any cause, never do, nor does a change of the ship, whose time is chosen
    where predictions are worst.

    Args:
        held: errors on held-out units of the model before any cause, then after every step.
        windows: all data; None where there are no predictions of them.
        re_estimated: errors of the model before any cause with its uncertain parameters fitted; None where it has none.
    """
    gains = [held_out_gain(one, other, seed) for one, other in pairwise(held)]
    better = [
        step.chosen.candidate.is_possible(found.last.value)
        and found.last.ship.is_possible(step.chosen.candidate.free)
        and simulates_better(
            held[index],
            held[index + 1],
            gain,
            certain=not found.beside_stated and (index == 0 or only_nuisance(step, found)),
            imitates=step.chosen.candidate.imitates,
        )
        for index, (step, gain) in enumerate(zip(found.steps, gains, strict=True))
    ]
    improves = [
        is_better
        and ((index == 0 and not found.beside_stated) or _is_certain_ahead(held, index, seed, low))
        and shows_for_certain(held[index], held[index + 1], seed)
        for index, (is_better, (_, (low, _))) in enumerate(zip(better, gains, strict=True))
    ]
    if windows is None or not gains:
        return improves
    if not shows_for_certain(held[0], held[1], seed):
        improves[0] = _shows_otherwise(found, held, (better[0], gains[0]), (windows, re_estimated), seed)
    for index in range(1, len(held) - 1):
        if better[index] and not improves[index]:
            share = certain_in_predictions(found.steps[index], held[index : index + 2], windows, seed)
            improves[index] = share >= TUNING.least_predicted
    return improves


def certain_in_predictions(step: Step, held: Sequence[HeldOut], windows: Windows, seed: int) -> float:
    """Share that a cause takes off the squared error of predictions one sample ahead, for certain; else 0.

    What makes held-out simulations of any output worse for certain shows a record that is not like the model, and not
    what a simulation lacks.

    Args:
        held: errors on held-out units without and with it.
    """
    if not _may_show_in_predictions(step):
        return 0.0
    share, (least, _) = prediction_gain(held[0], held[1], windows, step.chosen.fit.noise)
    if not least > 0.0 or any(_some_worse_for_certain(pair, seed) for pair in _as_simulated(held)):
        return 0.0
    return share


def _as_simulated(held: Sequence[HeldOut]) -> Iterator[list[HeldOut]]:
    """Errors as they are given, in stretches, and in stretches of runs that models were not fitted to."""
    yield [*held]
    for of in ("ahead", "on_other_runs"):
        measured = [getattr(item, of) for item in held]
        if all(measured):
            yield [one() for one in measured]


def _some_worse_for_certain(held: Sequence[HeldOut], seed: int) -> bool:
    """Whether the error of some output is larger in the second of two models, by an interval that excludes zero."""
    _, _, high = certain_reductions(held[0], held[1], seed)
    return bool((high < 0.0).any())


def _may_show_in_predictions(step: Step) -> bool:
    return not step.chosen.is_block and step.chosen.candidate.cause != "change_point"


def _shows_otherwise(
    found: Selection,
    held: Sequence[HeldOut],
    simulated: tuple[bool, tuple[float, tuple[float, float]]],
    data: tuple[Windows, HeldOut | None],
    seed: int,
) -> bool:
    """Whether the first cause, whose simulations are not better for certain, shows in predictions or the same fit.

    Args:
        found, held, seed: as of `improves_held_out`.
        simulated: whether it simulates better, and its gain with the interval.
        data: all of it, and errors of the model before any cause with its uncertain parameters fitted.
    """
    (better, (gain, (low, high))), (windows, re_estimated) = simulated, data
    first = found.steps[0].chosen
    share = certain_in_predictions(found.steps[0], held[:2], windows, seed)
    alike = _fitted_alike(found, held, re_estimated)
    if alike and not _shows_in_other_runs(held, seed):  # all of it may be what parameters gain
        share = min(share, certain_in_predictions(found.steps[0], (*alike, held[1]), windows, seed))
    worth_a_word = share >= 1.0 - (1.0 - TUNING.least_reduction) ** 2  # of the squared error
    alone = share >= TUNING.least_predicted and not first.candidate.imitates and gain >= 0.0
    if alone or (better and worth_a_word):
        return True
    beside = held_beside_the_same_fit(found, held, re_estimated) if better and low <= 0.0 <= high else None
    return beside is not None and shows_for_certain(beside, held[1], seed)


def _shows_in_other_runs(held: Sequence[HeldOut], seed: int) -> bool:
    """Whether a first cause shows for certain in stretches of runs that models were not fitted to."""
    measured = [item.on_other_runs() for item in held[:2] if item.on_other_runs is not None]
    return len(measured) == 2 and shows_for_certain(measured[0], measured[1], seed)


def _fitted_alike(found: Selection, held: Sequence[HeldOut], re_estimated: HeldOut | None) -> list[HeldOut]:
    """Errors of the model without the first cause, its uncertain parameters fitted as they are with it, if there are.

    None where the cause is that its parameters are wrong. Arguments as of `improves_held_out`.
    """
    if re_estimated is None or found.beside_stated or found.steps[0].chosen.candidate.cause == "parameters":
        return []
    return [re_estimated.like(held[1])]


def held_beside_the_same_fit(found: Selection, held: Sequence[HeldOut], re_estimated: HeldOut | None) -> HeldOut | None:
    """Errors of the model without the first cause that is fitted in the same way.

    None where there is no such model that the vessel file allows, or the cause is that its parameters are wrong.
    Arguments as of `improves_held_out`.
    """
    alike = _fitted_alike(found, held, re_estimated)
    return alike[0] if alike and within_stated_std(found.first) else None


def compared_with(
    found: Selection, held: Sequence[HeldOut], re_estimated: HeldOut | None, seed: int
) -> tuple[HeldOut, bool]:
    """Errors that the first cause is compared with, and whether they are those of the same fit without it."""
    beside = None if shows_for_certain(held[0], held[1], seed) else held_beside_the_same_fit(found, held, re_estimated)
    if beside is None or not shows_for_certain(beside, held[1], seed):
        return held[0], False
    return beside, True


def shows_for_certain(before: HeldOut, after: HeldOut, seed: int) -> bool:
    """Whether errors fall on average, and that of some output by enough to be worth a word, for certain.

    Certain is what an interval that excludes zero says.
    """
    share, low, _ = certain_reductions(before, after, seed)
    _, (least, _) = held_out_gain(before, after, seed)
    return least > 0.0 and bool(((share >= TUNING.least_reduction) & (low > 0.0)).any())


def _is_certain_ahead(held: Sequence[HeldOut], index: int, seed: int, low: float) -> bool:
    """Whether the gain of a step, with this lower end of its interval, is certain, or else that in short stretches."""
    before, after = (held[place].ahead for place in (index, index + 1))
    if low > 0.0 or held[0].in_stretches or before is None or after is None:
        return low > 0.0 or not held[0].in_stretches
    return held_out_gain(before(), after(), seed)[1][0] > 0.0


def simulates_better(
    before: HeldOut,
    after: HeldOut,
    gained: tuple[float, tuple[float, float]],
    *,
    certain: bool = True,
    imitates: bool = False,
) -> bool:
    """Whether a cause improves simulations of held-out data by enough: by `improves_held_out`'s rules for one cause.

    Args:
        before: errors without it; after: with it.
        gained: mean gain of fit [points] and its interval.
        certain: a more sensitive test has found it, as of a first cause.
        imitates: it may imitate many others.
    """
    (gain, interval), least = gained, _least_change(before, after)
    possible = _matters(before, after) and (not imitates or least >= -gain)
    return possible and _improves(certain and not imitates, least >= 0.0, before.left, (gain, interval))


def _matters(before: HeldOut, after: HeldOut) -> bool:
    """Whether the error of some output falls by enough to be worth a word."""
    before, after = on_common_units(before, after)
    return bool((100.0 - after.fit <= (1.0 - TUNING.least_reduction) * (100.0 - before.fit)).any())


def _least_change(before: HeldOut, after: HeldOut) -> float:
    """Change of fit of the output that gains least [points]."""
    before, after = on_common_units(before, after)
    return float(np.nan_to_num(after.fit - before.fit).min()) if len(before.squared_error) else -np.inf


def _improves(certain: bool, no_output_worse: bool, left: float, gained: tuple[float, tuple[float, float]]) -> bool:
    gain, (low, high) = gained
    if certain and high >= 0.0 and (low > -TUNING.most_loss_share * left or no_output_worse):
        return True
    return gain > TUNING.least_gain_points and (gain > TUNING.clear_gain_points or low > 0.0)
