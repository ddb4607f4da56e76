"""How causes are judged: in whole held-out runs or short stretches of them, beside which parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.accuracy import WHOLE_S, Accuracy, pooled_fit, white_noise_std
from expdesign.diagnosis.data import Windows, cut_windows
from expdesign.diagnosis.fit import (
    AHEAD_S,
    LEAST_ERROR,
    CrossValidation,
    HeldOut,
    counting_runs,
    gains_for_certain,
    judged,
    leads_away,
    runs_of,
    within_stated_std,
)
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import simulate_from_measured
from expdesign.diagnosis.prediction_comparison import Compared, ComparedCause, fitted_to_all
from expdesign.diagnosis.select import (
    SELECTION_TUNING,
    Rival,
    Selection,
    Step,
    as_told,
    fitted_ahead,
    improves_held_out,
    only_nuisance,
    without_step,
)
from expdesign.diagnosis.stated_parameters import or_parameters
from expdesign.progress import Progress, within
from expdesign.signals import Record
from expdesign.values import Array

LITTLE_FIT = 50.0  # fit of an output [%] below which a simulation explains little and data are not free of error
MORE_THAN_NOISE = 2.0  # of the noise, that its error is then


def errors_as_judged(
    found: Selection, as_stated: HeldOut, validation: CrossValidation, windows: Windows, progress: Progress, seed: int
) -> tuple[Selection, list[HeldOut]]:
    """Causes beside uncertain parameters fitted with them, or beside those of the file where these simulate better.

    Errors are those of the model before any cause, then after every step. Parameters re-estimated within their standard
    deviations may simulate held-out units worse than those of the file, which many other data may have gone into. Then
    a cause has to improve on the file's parameters, and is fitted beside them: else it would have to make up for the
    loss. A file with which the simulation leads away is no such file. Nor is one that simulates neither whole units nor
    stretches of them better for certain once the causes are in the model: parameters that were fitted without a cause
    imitate some of it. What is judged in stretches is fitted in stretches of all data, too, as it is written.
    """
    short = validation.short_windows(found.first.ship)
    if found.beside_stated:
        again = fitted_ahead(found, windows, short, beside_stated=True) or found
        return again, _ahead([as_stated, *(validation.of(step.chosen.fit) for step in again.steps)])
    held = _where_more_is_certain(found, _cross_validated(found, as_stated, validation, progress), seed, windows)
    known = None
    uncertain = found.steps and found.first.keys and not leads_away(as_stated)
    if uncertain and as_stated.mean_fit > validation.of(found.first).mean_fit:
        known = fitted_ahead(found, windows, short, beside_stated=True)
    if known is not None:
        whole = [validation.of(one.last) for one in (found, known)]
        if gains_for_certain(whole, seed) or gains_for_certain(_ahead(whole), seed):
            return known, _ahead([as_stated, *(validation.of(step.chosen.fit) for step in known.steps)])
    if found.steps and held[0].in_stretches:
        found = fitted_ahead(found, windows, short, beside_stated=False) or found
    return found, held


def _where_more_is_certain(
    found: Selection, held: list[HeldOut], seed: int, windows: Windows | None = None
) -> list[HeldOut]:
    """Errors in short stretches, if a first cause gains there for certain and more causes improve there; else as given.

    Whole runs are few, and an error early in a run stays in its simulation. Predictions of samples tell of both alike.
    """
    if not found.steps or held[0].in_stretches or any(item.ahead is None for item in held):
        return held
    in_runs = improves_held_out(found, held, seed, windows)
    if all(in_runs) or not gains_for_certain(_ahead(held[:2]), seed):
        return held
    in_stretches = improves_held_out(found, _ahead(held), seed, windows)
    return _ahead(held) if [*in_stretches, False].index(False) > in_runs.index(False) else held


def _ahead(held: Sequence[HeldOut]) -> list[HeldOut]:
    """Errors in short stretches."""
    return [item.ahead() for item in held if item.ahead is not None]


def _cross_validated(
    found: Selection, as_stated: HeldOut, validation: CrossValidation, progress: Progress
) -> list[HeldOut]:
    """Held-out errors of the model before any cause, then after every step.

    The gain of uncertain parameters within their standard deviations is not attributed to a cause. So the model in use
    has them fitted, unless it simulates held-out units better as it is: what a cause repairs of a worse fit is no gain.
    If the first cause is that they exceed their standard deviations, it gets their gain, and the model is not fitted.
    Neither is it where a fit without any cause needs parameters far beyond them: that fit is no model that the vessel
    file allows.
    """
    fitted = bool(found.first.keys) and not any(only_nuisance(step, found) for step in found.steps[:1])
    fitted = fitted and (within_stated_std(found.first) or not found.steps)
    fits = [*[found.first] * fitted, *(step.chosen.fit for step in found.steps)]
    results = [as_stated]
    for number, item in enumerate(fits):
        part = within(progress, number / len(fits), (number + 1) / len(fits))
        results.append(validation.of(item, part))
    results = judged(results)
    if fitted:
        results[:2] = [max(results[:2], key=lambda held: held.mean_fit)]
    return results


def found_by_predictions(
    kept: Selection,
    compared: Compared,
    data: tuple[Windows, Record],
    ship: ExtendedModel,
    seed: int,
    re_estimated: HeldOut | None = None,
) -> tuple[Selection, list[HeldOut]] | None:
    """The cause that gains most for certain in predictions, and errors on held-out data without and with it.

    None where no cause does with which the data are simulated no worse than by the model in use, or where slow weather
    that nobody measured gains, too, and predicts about as well; weather that may gain nothing is an alternative. Where
    a search found causes, one has to predict better than the model with all of them, to take their place. Beside the
    parameters of the file, it has to predict on average no worse than all of these re-estimated without it, which are
    many more numbers, and an alternative unless they do worse for certain.

    Args:
        compared: causes, by their predictions.
        data: as compared, and as measured.
        re_estimated: errors of the model with parameters re-estimated and no cause, where causes are compared beside
            the parameters of the file; None where they are compared beside re-estimated ones.
    """
    windows, record = data
    first = kept.first if re_estimated is None else compared.without_in(windows)
    weather = [other.held for other in compared.causes if other.may_be_weather]
    known = [compared.of(kept.last)] if kept.steps else []
    for item in _certain_besides(kept, compared):
        if re_estimated is not None and item.held.mean_fit < re_estimated.mean_fit:
            continue
        better_than = [*known, *([] if item.is_slow_weather else weather)]
        if not all(held is not None and gains_for_certain([held, item.held], seed) for held in better_than):
            continue
        chosen = None if harms(ship, item.fit.ship, record) else fitted_to_all(item, first, windows)
        if chosen is None:
            continue
        others = [
            other
            for other in compared.causes
            if other is not item and (other.is_certain or (other.is_slow_weather and other.gain > 0.0))
        ]
        step = Step(
            chosen=chosen,
            p_value=item.p_value,
            alternatives=_no_worse(others, item.held, seed),
            before=first,
            tests=compared.tests,
        )
        left = tuple(test for test in kept.last_tests if test.candidate.cause != item.cause)
        found = replace(kept, steps=(step,), last=chosen.fit, last_tests=left, beside_stated=re_estimated is not None)
        if re_estimated is not None and not gains_for_certain([re_estimated, item.held], seed):
            found = or_parameters(found, kept.first, windows)
        return found, [compared.without, item.held]
    return None


def with_alternatives(kept: Selection, compared: Compared, seed: int) -> Selection:
    """A single cause that a search found, with alternatives: those that predict about as well.

    Beside one that may imitate others, they need not gain for certain on the model without it.
    """
    known = compared.of(kept.last) if len(kept.steps) == 1 else None
    if known is None:
        return kept
    (step,) = kept.steps
    likely = {other.candidate.cause for other in step.alternatives}
    if step.chosen.candidate.imitates:
        others = [item for item in compared.causes if item.p_value <= SELECTION_TUNING.accepted_p_value]
    else:
        others = _certain_besides(kept, compared)
    others = [item for item in others if item.cause not in {*likely, step.chosen.candidate.cause}]
    more = _no_worse(others, known, seed)
    return replace(kept, steps=(replace(step, alternatives=(*step.alternatives, *more)),))


def _certain_besides(kept: Selection, compared: Compared) -> list[ComparedCause]:
    """Causes that are certain by their predictions and that the selection does not have."""
    named = {step.chosen.candidate.cause for step in kept.steps}
    return [item for item in compared.causes if item.is_certain and item.cause not in named]


def _no_worse(causes: Sequence[ComparedCause], held: HeldOut, seed: int) -> tuple[Rival, ...]:
    """Causes that do not predict worse for certain than a model with these errors."""
    return tuple(
        Rival(candidate=item.point.test.candidate, ship=item.fit.ship, trails_by=0.0)
        for item in causes
        if not gains_for_certain([item.held, held], seed)
    )


def losses_without(found: Selection, held: Sequence[HeldOut], validation: CrossValidation, windows: Windows) -> Array:
    """(causes,) [points] mean fit to held-out data that the model of all causes loses without each, others fitted anew.

    Infinite where there is no fit without it. What each gains on the model before it depends on the order in which
    they were found; this does not.

    Args:
        held: errors on held-out units of the model before any cause, then after every step, and perhaps of more.

    Source: J. Lei, M. G'Sell, A. Rinaldo, R. J. Tibshirani and L. Wasserman, Journal of the American Statistical
    Association 113 (2018), 1094-1111, section 6: leave one covariate out.
    """
    if not found.steps:
        return np.zeros(0)
    whole = held[len(found.steps)]
    without = (held_without(found, held, validation, windows, index) for index in range(len(found.steps)))
    return np.array([np.inf if one is None else whole.mean_fit - one.mean_fit for one in without])


def held_without(
    found: Selection, held: Sequence[HeldOut], validation: CrossValidation, windows: Windows, index: int
) -> HeldOut | None:
    """Errors on held-out data of the model without one cause, the others fitted anew; None where they cannot be.

    Arguments as of `losses_without`.
    """
    if index == len(found.steps) - 1:
        return held[index]
    others = without_step(list(found.steps), index, windows)
    return None if others is None else validation.of(others[-1].chosen.fit).like(held[len(found.steps)])


def harmless_beside_the_file(
    kept: Selection,
    ship: ExtendedModel,
    as_stated: HeldOut,
    validation: CrossValidation,
    data: tuple[Windows, Record],
    seed: int,
) -> tuple[Selection, list[HeldOut]] | None:
    """Causes fitted beside the parameters of the file, where it is re-estimated ones that make simulations worse.

    None where they do not, or where a cause beside the file's parameters does not improve on them for certain.

    Args:
        kept: the causes, beside re-estimated parameters.
        as_stated: its errors as its file states it.
        data: as compared, and as measured.
    """
    windows, record = data
    if not _re_estimates(kept) or not harms(ship, kept.last.ship, record):
        return None
    known = fitted_ahead(kept, windows, validation.short_windows(ship), beside_stated=True)
    if known is None or harms(ship, known.last.ship, record):
        return None
    held = _ahead([as_stated, *(validation.of(step.chosen.fit) for step in known.steps)])
    if not all(improves_held_out(known, held, seed)):
        return None
    without = partial(held_without, known, held, validation, windows)
    return as_told(known, held, without, windows, seed), held


def worth_writing(
    kept: Selection,
    held: list[HeldOut],
    ship: ExtendedModel,
    as_stated: HeldOut,
    validation: CrossValidation,
    data: tuple[Windows, Record],
    seed: int,
) -> tuple[Selection, list[HeldOut]]:
    """Causes whose model predicts stretches held out better than the file does, where re-estimated parameters do not.

    What is written has to help other runs, not these. Many parameters re-estimated from few runs may spoil what a right
    cause gains, or be what a wrong one needs: they learn the weather and the manoeuvres of these runs, which parts of
    the same runs do not show. So causes are fitted beside the parameters of the file where each improves on it so,
    unless re-estimated parameters predict runs that they were not fitted to better for certain. If causes do not, and
    the model of all takes less than `Tuning.least_reduction` off the error of the file's, nothing is found. Arguments
    as of `harmless_beside_the_file`, and the errors that belong to the causes.
    """
    windows, record = data
    if not _re_estimates(kept) or only_nuisance(kept.steps[0], kept):
        return kept, held
    known = fitted_ahead(kept, windows, validation.short_windows(ship), beside_stated=True)
    if known is not None and not harms(ship, known.last.ship, record):
        beside = _ahead([as_stated, *(validation.of(step.chosen.fit) for step in known.steps)])
        parameters = [validation.of(one.last) for one in (known, kept)]
        if all(improves_held_out(known, beside, seed, windows)) and not gains_on_other_runs(parameters, seed):
            without = partial(held_without, known, beside, validation, windows)
            return as_told(known, beside, without, windows, seed), beside
    stated, alone, written = _ahead([as_stated, *map(validation.of, (kept.first, kept.last))])
    gains = alone.mean_fit > stated.mean_fit or written.left < (1.0 - SELECTION_TUNING.least_reduction) * stated.left
    return (kept, held) if gains else (kept.with_steps(()), held[:1])


def gains_on_other_runs(held: Sequence[HeldOut], seed: int) -> bool:
    """Whether the second of two models predicts runs that it was not fitted to better, for certain."""
    return gains_for_certain([item.on_other_runs() for item in held if item.on_other_runs is not None], seed)


def _re_estimates(kept: Selection) -> bool:
    """Whether causes stand beside parameters that were fitted with them."""
    return bool(kept.steps and kept.first.keys and not kept.beside_stated)


def without_harm(
    kept: Selection, held: list[HeldOut], ship: ExtendedModel, record: Record
) -> tuple[Selection, list[HeldOut]]:
    """The first causes, as many as can be, with which the data are simulated no worse than by the model in use.

    Args:
        held: errors on held-out units of the model before any cause, then after every one.
    """
    while kept.steps and harms(ship, kept.last.ship, record):
        kept, held = kept.with_steps(kept.steps[:-1]), held[:-1]
        if kept.steps:
            last = kept.last
            kept = replace(kept, last=counting_runs(last, runs_of(last.linear.motion.windows), kept.dispersion))
    return kept, held


def harms(ship: ExtendedModel, extended: ExtendedModel, record: Record) -> bool:
    """Whether an extended model simulates the data worse than the model in use, each from the first measured state.

    It does if it runs away where the model in use does not; if its errors in short stretches, as the geometric mean
    over outputs, are larger by more than the share `Tuning.most_loss_share`; and if it simulates some output of whole
    runs worse than a constant, while the model in use simulates none so, or its errors in these are larger by more than
    `Tuning.much_better_share`. A smaller loss in
    whole runs is weak evidence, and so is any loss of a model that explains little of them: it depends on slow errors,
    which in a wrong model may cancel by chance.
    """
    for length_s in (AHEAD_S, WHOLE_S):
        windows = cut_windows(ship.model, record, longest_s=length_s)
        (before, ran_before), (after, runs_away) = (_simulated(one, windows) for one in (ship, extended))
        if length_s == AHEAD_S:
            loses = _larger_error(before, after) > 1.0 + SELECTION_TUNING.most_loss_share
        else:
            right = not (before < 0.0).any() and before.mean() > LITTLE_FIT
            less = _larger_error(before, after) > 1.0 + SELECTION_TUNING.much_better_share
            loses = bool(right and (less or (after < 0.0).any()))
        if loses or (runs_away and not ran_before):
            return True
    return False


def _larger_error(before: Array, after: Array) -> float:
    """Geometric mean over outputs of the ratio of errors, by the fits [%] before and after."""
    left, still = (np.maximum(100.0 - fit, 100.0 * LEAST_ERROR) for fit in (before, after))
    return float(np.exp(np.log(still / left).mean()))


def _simulated(ship: ExtendedModel, windows: Windows) -> tuple[Array, bool]:
    """(n,) fit of all outputs [%], and whether the simulation runs away."""
    columns = [OUTPUTS.index(name) for name in ship.model.outputs]
    motion = simulate_from_measured(ship, windows)
    return pooled_fit(motion.error[..., columns], windows.measured[..., columns]), motion.diverged


def explains_little(after: Accuracy, windows: Windows) -> bool:
    """Whether a simulation explains little of some output whose error is much more than noise."""
    return bool(((after.fit < LITTLE_FIT) & more_than_noise(after, windows)).any())


def more_than_noise(after: Accuracy, windows: Windows) -> NDArray[np.bool_]:
    """(n,) whether the error of an output is much more than its noise."""
    columns = [OUTPUTS.index(name) for name in after.outputs]
    return np.asarray(after.rmse > MORE_THAN_NOISE * white_noise_std(windows.measured[..., columns]))
