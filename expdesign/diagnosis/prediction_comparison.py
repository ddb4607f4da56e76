"""The cause that predicts best a short time ahead, where a search by likelihood leaves much unexplained.

Where the simulation explains little, the likelihood takes much of the error for slow noise, and tests beside such noise
say little. Here models are fitted by output error in short stretches. Every cause is compared with the same model
without it, fitted to the same other stretches: parameters of a file that were fitted to these data have seen what is
held out, and would hide its gain.

Sources: F. Wilcoxon, Biometrics Bulletin 1 (1945), 80-83, for the signed-rank test; L. Ljung, System Identification,
2nd ed. (1999), section 16.6, for the choice of models by cross-validation.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import (
    Fit,
    FitOptions,
    HeldOut,
    counting_stretches,
    cross_validate_ahead,
    fit,
    fit_output_error,
    held_out_gain,
    log_likelihood_gain,
    no_smaller,
    on_common_units,
)
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import initial_states
from expdesign.diagnosis.select import (
    SELECTION_TUNING,
    FittedCandidate,
    ScoreTest,
    StartingPoint,
    joint_keys,
    open_candidates,
    score_tests,
    starting_point,
)
from expdesign.estimation.solve import Dispersion, spread_between_runs
from expdesign.processes import in_order
from expdesign.progress import Progress
from expdesign.values import Array

RE_ESTIMATED = "parameters"  # no cause here: all models have their uncertain parameters fitted
CURRENT = "current"  # certain here only where it gains much: one that wanders gains as a steady one does
CLEAR, MUCH = 0.02, 0.1
"""Shares of what the model without it leaves unexplained: a gain worth a finding, and the least gain of a current that
is steady for certain. Of one that wanders the least gain was above 0.06 in none of 57 simulated trials."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedCause:
    """A cause compared with the same model without it."""

    point: StartingPoint  # where its fit began
    fit: Fit  # to all short stretches
    held: HeldOut  # errors on held-out stretches
    # gain, gain_interval: on the model without it [points]
    gain: float
    gain_interval: tuple[float, float]
    left: float  # by that model: mean fit less than perfect [points], of which gains are shares
    p_value: float  # of the signed-rank test over stretches, times the number of causes and of times that were tried

    @property
    def cause(self) -> str:
        """Its name in the catalogue."""
        return self.point.test.candidate.cause

    @property
    def is_slow_weather(self) -> bool:
        """Whether it may be slow weather that nobody measured, which fits in stretches do not allow for."""
        candidate = self.point.test.candidate
        return candidate.cause == CURRENT or candidate.imitates

    @property
    def is_certain(self) -> bool:
        """Whether it is possible, gains clearly, and by more than chance in the sum and in the count of stretches."""
        candidate = self.point.test.candidate
        possible = candidate.is_possible(self.fit.value) and self.fit.ship.is_possible(candidate.free)
        possible = possible and not candidate.imitates
        least = MUCH if self.cause == CURRENT else 0.0
        clear = self.gain > CLEAR * self.left and self.gain_interval[0] > least * self.left
        return possible and clear and self.p_value <= SELECTION_TUNING.accepted_p_value

    @property
    def may_be_weather(self) -> bool:
        """Whether it may be slow weather, and gains by more than chance in the count of stretches."""
        return self.is_slow_weather and self.p_value <= SELECTION_TUNING.level


@dataclass(frozen=True, kw_only=True, eq=False)
class Compared:
    """Causes compared by predictions."""

    base: ExtendedModel  # without any of them, its uncertain parameters fitted
    without: HeldOut  # its errors on held-out stretches
    causes: tuple[ComparedCause, ...]  # with the largest gain first
    tests: tuple[ScoreTest, ...]  # that chose them
    short: Windows  # data in short stretches

    def without_in(self, windows: Windows) -> Fit:
        """The model without any of them, in longer windows."""
        starts = initial_states(windows, self.base.states)
        return fit(self.base, windows, (), starts=starts, options=FitOptions(steps=0))

    def of(self, found: Fit) -> HeldOut | None:
        """Errors on held-out stretches of another model, fitted in the same way; None where it cannot be fitted."""
        try:
            return cross_validate_ahead(fit_output_error(found.ship, self.short, found.free_keys))
        except (FloatingPointError, np.linalg.LinAlgError):
            return None


def compare_predictions(
    ship: ExtendedModel, short: Windows, seed: int, progress: Progress, asked: Collection[str] = ()
) -> Compared | None:
    """The likeliest causes in short stretches, compared; None where the model cannot be fitted there.

    Where only some causes may be found, none where none of these gains for certain: the others are not fitted then.

    Args:
        ship: the model that the search for causes begins with.
        short: data in short stretches.
        asked: causes that may be found; empty where all may.
    """
    activity = "comparing causes by predictions"
    progress(activity, 0.0)
    try:
        base = fit_output_error(ship, short, ())
    except (FloatingPointError, np.linalg.LinAlgError):
        return None
    candidates = [item for item in open_candidates(base, short) if item.cause != RE_ESTIMATED]
    tests = score_tests(base, candidates)
    without = cross_validate_ahead(base)
    shortlist = _best_of_each_cause(tests)
    first = [test for test in shortlist if not asked or test.candidate.cause in asked]
    known = dict[int, tuple[StartingPoint, Fit, HeldOut] | None]()
    for part in (first, [test for test in shortlist if test not in first]):
        for test, one in zip(part, in_order(_fitted, (base,), [(test,) for test in part]), strict=True):
            known[id(test)] = one
            progress(activity, (1.0 + len(known)) / (1.0 + len(shortlist)))
        if not any(one and held_out_gain(without, one[-1], seed)[1][0] > 0.0 for one in known.values()) and asked:
            return None
    tried = [one for test in shortlist if (one := known[id(test)])]
    p_values = signed_rank_p_values(without, [held for *_, held in tried])
    found = [
        _compared(*fitted, without, min(1.0, len(shortlist) * _values_tried(fitted[0], candidates) * p_value), seed)
        for fitted, p_value in zip(tried, p_values, strict=True)
    ]
    causes = tuple(sorted(found, key=lambda item: -item.gain))
    return Compared(base=base.ship, without=without, causes=causes, tests=tests, short=short)


def fitted_to_all(item: ComparedCause, first: Fit, windows: Windows) -> FittedCandidate | None:
    """A cause as it was fitted to short stretches, with the noise of the long windows; None where that diverges there.

    Its standard errors are no smaller than those of the likelihood there, and than the scatter from stretch to stretch
    tells: few stretches beside many parameters tell little of either.
    """
    ahead = counting_stretches(item.fit)
    free, starts = ahead.free_keys, initial_states(windows, ahead.ship.states)
    try:
        found = fit(ahead.ship, windows, free, starts=starts, options=FitOptions(steps=0))
    except (FloatingPointError, np.linalg.LinAlgError):
        return None
    gain = log_likelihood_gain(first, found)
    point = item.point
    return FittedCandidate(
        candidate=point.test.candidate,
        fit=replace(found, covariance=no_smaller(found.covariance, ahead.covariance)),
        likelihood_gain=gain,
        penalised_gain=gain - SELECTION_TUNING.price * (len(point.keys) + (point.profiled is not None)),
        keys=point.keys,
        profiled=point.profiled,
    )


def _best_of_each_cause(tests: Sequence[ScoreTest]) -> list[ScoreTest]:
    """The likeliest candidate of each of the likeliest causes."""
    least = SELECTION_TUNING.least_statistic_share * max((item.statistic for item in tests), default=0.0)
    found: dict[str, ScoreTest] = {}
    for test in sorted(tests, key=lambda item: SELECTION_TUNING.price * item.candidate.size - item.statistic):
        if test.statistic >= least - SELECTION_TUNING.statistic_margin:
            found.setdefault(test.candidate.cause.split(":")[0], test)
    return [*found.values()][: SELECTION_TUNING.shortlist]


def _values_tried(point: StartingPoint, candidates: Sequence[Candidate]) -> int:
    """How many values of an effect were tried that the fit holds, as the time of a change: of what is held out, too."""
    own = point.test.candidate
    return 1 if own.grid is None else sum(one.cause == own.cause and {*one.free} == {*own.free} for one in candidates)


def _fitted(base: Fit, test: ScoreTest) -> tuple[StartingPoint, Fit, HeldOut] | None:
    """A candidate fitted to all stretches, and its errors on those held out; None where it cannot be fitted."""
    point, short = starting_point(base, test), base.linear.motion.windows
    try:
        found = fit_output_error(base.ship.with_effects(point.effects), short, joint_keys(base, point.keys))
    except (FloatingPointError, np.linalg.LinAlgError):
        return None
    return point, found, cross_validate_ahead(found)


def _compared(
    point: StartingPoint, found: Fit, held: HeldOut, without: HeldOut, p_value: float, seed: int
) -> ComparedCause:
    gain, interval = held_out_gain(without, held, seed)
    return ComparedCause(
        point=point, fit=found, held=held, gain=gain, gain_interval=interval, left=100.0 - without.mean_fit,
        p_value=p_value,
    )  # fmt: skip


def signed_rank_p_values(without: HeldOut, others: Sequence[HeldOut]) -> list[float]:
    """That errors of stretches, as logarithms of squares averaged over outputs, are no less with each of some causes.

    Sums of signed ranks from run to run show how runs differ.

    Source: B. Rosner, R. J. Glynn and M.-L. T. Lee, Biometrics 62 (2006), 185-192, for ranks of clustered data.
    """
    ranks, plain = list[tuple[Array, Array]](), list[float]()
    for held in others:
        pair = on_common_units(without, held)
        lost, left = (np.log(np.maximum(item.squared_error, 1e-300)).mean(axis=1) for item in pair)
        fallen = (lost - left)[lost != left]
        run = np.zeros(len(fallen)) if pair[0].run is None else pair[0].run[lost != left]
        ranks.append((np.sign(fallen) * scipy.stats.rankdata(np.abs(fallen)), run))
        plain.append(float(scipy.stats.wilcoxon(fallen, alternative="greater").pvalue) if len(fallen) else 1.0)
    names = np.unique(np.concatenate([run for _, run in ranks])) if ranks else np.zeros(0)
    if len(names) < 2:
        return plain
    masks = [(signed, run == names[:, None]) for signed, run in ranks]
    score, size = (np.stack([same @ signed**power for signed, same in masks], axis=1) for power in (1, 2))
    spread = spread_between_runs(score, size, np.zeros_like(size), estimated=False)
    factors, freedoms = Dispersion.of(spread).beside(spread)
    z = score.sum(axis=0) / np.sqrt(np.maximum(size.sum(axis=0), 1e-300) * factors)
    wider = scipy.special.stdtr(freedoms, -z)
    return [max(pair) if pair[0] < 0.5 else pair[0] for pair in zip(plain, wider.tolist(), strict=True)]
