"""The selected causes, and how one is removed again."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import (
    NOISE_ALONE,
    Fit,
    FitOptions,
    continuing,
    counting_runs,
    fit,
    fit_ahead,
    log_likelihood_gain,
    of_several,
    runs_of,
    tail,
)
from expdesign.diagnosis.select.fitted_candidate import FittedCandidate, Rival
from expdesign.diagnosis.select.score_tests import ScoreTest, scored_between_runs
from expdesign.diagnosis.select.tuning import TUNING
from expdesign.estimation.solve import Dispersion, few_runs_factor
from expdesign.own_units import solution_of

SHAPE = ("roll:period", "roll:damping")
"""Effects that describe the kind of an oscillation, not its size."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """One step of forward selection."""

    chosen: FittedCandidate  # the added candidate
    p_value: float  # adjusted for multiple tests
    # candidates of other kinds that explain the data as well, best first; before runs are counted, all that explain a
    # good share as much
    alternatives: tuple[Rival, ...]
    before: Fit  # the fit without it
    tests: tuple[ScoreTest, ...]  # all score tests of the round
    # candidates with more numbers that fit better, and simulate held-out data worse
    outranked: tuple[Candidate, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Selection:
    """The selected causes."""

    steps: tuple[Step, ...]  # one per cause
    first: Fit  # the fit before any cause
    last: Fit  # the joint fit of all causes
    last_tests: tuple[ScoreTest, ...]  # score tests of what is left
    untried: tuple[str, ...] = ()  # what the limit of work left out
    # causes are fitted beside the parameters of the vessel file, although these are uncertain
    beside_stated: bool = False
    dispersion: Dispersion = NOISE_ALONE  # what estimates of causes differ by between runs, beside the last fit

    def with_steps(self, steps: tuple[Step, ...]) -> Selection:
        """The selection with other steps; where these are its first ones, the next round's tests become the last."""
        last = steps[-1].chosen.fit if steps else self.first
        cut = len(steps) < len(self.steps) and steps == self.steps[: len(steps)]
        return replace(
            self, steps=steps, last=last, last_tests=self.steps[len(steps)].tests if cut else self.last_tests
        )


def fitted_ahead(found: Selection, windows: Windows, short: Windows, *, beside_stated: bool) -> Selection | None:
    """The same causes fitted as they are judged in short windows; None if that fails.

    Args:
        beside_stated: beside the parameters of the vessel file, instead of those within their standard deviations.
    """
    steps, before = list[Step](), None
    for step in found.steps:
        try:
            known = fit_ahead(step.chosen.fit, windows, short, beside_stated=beside_stated)
        except (FloatingPointError, np.linalg.LinAlgError):
            return None
        steps.append(replace(step, chosen=replace(step.chosen, fit=known), before=before or step.before))
        before = known
    return replace(found, steps=tuple(steps), last=before or found.first, beside_stated=beside_stated)


def redundant_step(steps: list[Step], windows: Windows) -> int | None:
    """The earliest step that the last fit does not need, by a likelihood ratio test."""
    whole = steps[-1].chosen.fit
    for index, step in enumerate(steps[:-1]):
        reduced = _fit_without(whole, step, windows)
        if reduced is None:
            continue
        lost, count = log_likelihood_gain(reduced, whole), len(_own_effects(step))
        p_value = of_several(float(scipy.special.chdtrc(max(1, count), max(lost, 0.0))), step.chosen.multiplicity)
        if p_value > TUNING.level or lost < TUNING.price * count:
            return index
    return None


def without_step(steps: list[Step], index: int, windows: Windows) -> list[Step] | None:
    """The other steps, the later ones fitted again; None where one of them cannot be fitted."""
    others, before = steps[:index], steps[index].before
    for step in steps[index + 1 :]:
        reduced = _fit_without(step.chosen.fit, steps[index], windows)
        if reduced is None:
            return None
        others = [*others, replace(step, chosen=replace(step.chosen, fit=reduced), before=before)]
        before = reduced
    return others


def _own_effects(step: Step) -> set[str]:
    return {*step.chosen.keys, *step.chosen.candidate.free, *step.chosen.candidate.fixed}


def _fit_without(whole: Fit, step: Step, windows: Windows) -> Fit | None:
    """A later fit without the effects of a step, all others estimated again."""
    own = _own_effects(step)
    others = tuple(key for key in whole.free_keys if key not in own)
    return _refitted(whole, others, windows, without=own)


def _refitted(whole: Fit, free: tuple[str, ...], windows: Windows, *, without: Collection[str] = ()) -> Fit | None:
    """A fit with these effects estimated again and without others; None where that cannot be fitted."""
    try:
        ship = whole.ship.without_effects({*without})
        return fit(ship, windows, free, starts=whole.starts, options=continuing(whole))
    except (FloatingPointError, np.linalg.LinAlgError):
        return None


def with_runs_counted(found: Selection, candidates: Sequence[Candidate], rng: np.random.Generator) -> Selection:
    """The selection with standard errors and p-values that count how runs differ, and tests of what is left.

    Args:
        found: the selection, its last fit of all windows.
        candidates: of the catalogue, whose estimates show how runs differ beside the last fit.
        rng: of the null distribution.
    """
    tests, known = scored_between_runs(found.last, candidates, rng)
    last = counting_runs(found.last, runs_of(found.last.linear.motion.windows), known)
    steps = [
        replace(
            step,
            chosen=_with_wider_profile(step.chosen, known),
            alternatives=_equivalent(step.alternatives, known),
        )
        for step in found.steps
    ]
    counted = replace(found, steps=tuple(steps), last=last, last_tests=tests, dispersion=known)
    return with_p_values_beside_all(counted)


def with_p_values_beside_all(found: Selection) -> Selection:
    """The selection, each cause with the p-value and likelihood gain of taking it away beside all others.

    What one gained on those before it, it gained under noise that held all that was found later.

    Source: as of `judgement.losses_without`.
    """
    gains = [step.chosen.likelihood_gain for step in found.steps]
    windows = found.last.linear.motion.windows
    whole = _refitted(found.last, found.last.free_keys, windows) if len(gains) > 1 else None
    for index, step in enumerate(found.steps[:-1]):
        reduced = None if whole is None else _fit_without(whole, step, windows)
        if whole is not None and reduced is not None:
            gains[index] = log_likelihood_gain(reduced, whole)
    chosen = [replace(step.chosen, likelihood_gain=gain) for step, gain in zip(found.steps, gains, strict=True)]
    steps = [
        replace(step, chosen=one, p_value=p_value_between_runs(one, found.last, found.dispersion))
        for step, one in zip(found.steps, chosen, strict=True)
    ]
    return replace(found, steps=tuple(steps))


def _equivalent(rivals: Sequence[Rival], known: Dispersion) -> tuple[Rival, ...]:
    """Those that the data cannot tell from the chosen candidate: where runs differ, likelihoods decide by less."""
    return tuple(rival for rival in rivals if rival.trails_by < TUNING.equivalent_within * known.alone[0])


def with_alternatives_beside_all(found: Selection, windows: Windows) -> Selection:
    """The selection whose alternatives explain the data as well beside all other causes.

    They did beside those that were found before. What was missing then an alternative may have imitated.
    """
    steps = [
        replace(step, alternatives=tuple(_beside_all(step, found, windows))) if step.alternatives else step
        for step in found.steps[:-1]
    ]
    return replace(found, steps=(*steps, *found.steps[-1:]))


def _beside_all(step: Step, found: Selection, windows: Windows) -> Iterator[Rival]:
    """Alternatives as likely as a step, all other causes estimated again, and those that cannot be fitted so."""
    last, own = found.last, _own_effects(step)
    others = [key for key in last.free_keys if key not in own]
    for rival in step.alternatives:
        candidate = rival.candidate
        more = {key: rival.ship.get(key) for key in (*candidate.free, *candidate.fixed) if key not in others}
        estimated = [key for key in candidate.free if key in more and key != (candidate.grid or ("",))[0]]
        ship = last.ship.without_effects(own).with_effects(more)
        try:
            fits = [
                fit(ship, windows, (*others, *estimated), starts=last.starts, options=options)
                for options in (continuing(last), FitOptions(warm_start=last))
            ]
        except (FloatingPointError, np.linalg.LinAlgError):
            yield rival
            continue
        best = min(fits, key=lambda one: one.deviance)
        numbers = sum(key in more for key in candidate.free)
        trails_by = log_likelihood_gain(best, last) - TUNING.price * (step.chosen.numbers - numbers)
        yield from _equivalent([replace(rival, ship=best.ship, trails_by=trails_by)], found.dispersion)


def _with_wider_profile(chosen: FittedCandidate, known: Dispersion) -> FittedCandidate:
    """A candidate whose profiled effect has a standard error that counts how runs differ."""
    if chosen.profiled is None:
        return chosen
    (key, std), (factor, freedom) = chosen.profiled, known.alone
    return replace(chosen, profiled=(key, std * float(np.sqrt(factor) * few_runs_factor(freedom))))


def p_value_between_runs(chosen: FittedCandidate, last: Fit | None, known: Dispersion) -> float:
    """p-value adjusted for multiple tests: of the likelihood ratio, and of the estimates in the last fit if given."""
    ratio = tail(max(chosen.likelihood_gain, 0.0), max(1, len(chosen.keys)), *known.alone)
    return of_several(ratio if last is None else max(ratio, wald_p_value(chosen, last)), chosen.multiplicity)


def insignificant_steps(steps: Sequence[Step]) -> list[int]:
    """The steps whose p-values are not significant, the largest first."""
    worst_first = sorted(range(len(steps)), key=lambda index: -steps[index].p_value)
    return [index for index in worst_first if steps[index].p_value > TUNING.level]


def wald_p_value(chosen: FittedCandidate, last: Fit) -> float:
    """p-value of the joint estimate of a cause's sizes against zero, or against what the vessel file states.

    Source: A. Wald, Transactions of the American Mathematical Society 54 (1943), 426-482.
    """
    stated = last.ship.stated
    sized = [key for key in chosen.keys if key in last.keys and (key not in SHAPE or key in stated)]
    index = [last.keys.index(key) for key in sized]
    values = np.array([last.value(key) - stated.get(key, 0.0) for key in sized])
    statistic = float(values @ solution_of(last.covariance[np.ix_(index, index)], values))
    statistic *= float(few_runs_factor(last.freedom)) ** 2  # in the covariance, for intervals
    freedom = len(sized)
    if chosen.profiled is not None and chosen.profiled[0] in chosen.candidate.free:
        key, error = chosen.profiled
        difference = last.value(key) - stated.get(key, 0.0)
        statistic, freedom = statistic + (difference / error) ** 2, freedom + 1
    if not np.isfinite(statistic):  # without a standard error nothing is significant
        return 1.0
    return tail(statistic, freedom, freedom=last.freedom) if freedom else 0.0
