"""Errors of models on data that they were not fitted to, one sample ahead and over whole runs, and their comparison.

Whole runs are few and count by their squared errors; intervals are by the bootstrap. Short stretches are many and
differ by orders of magnitude, so that the largest would decide alone. They count by logarithms: a fit is one minus the
geometric mean of relative errors, over all outputs together, and models are compared by the geometric mean of the
ratios of their errors, with an interval by Student's distribution.

Sources: B. Efron and R. J. Tibshirani, An Introduction to the Bootstrap (1993); J. S. Armstrong and F. Collopy,
International Journal of Forecasting 8 (1992), 69-80, for geometric means of relative errors.

Simulations of whole runs add up slow errors, of the model's structure or of weather, and hide small effects that act at
once, such as a dead time. The whitened error, less what initial velocities and the random current explain, does not:
its squares are those of predictions one sample ahead. They are nearly independent, so that blocks of them give the
standard error of a gain even where there are few runs. Blocks count alike, however rough the water was: each by the
logarithm of its error.

Source: L. Ljung, System Identification, 2nd ed. (1999), sections 3.2 and 16.6, for predictions and cross-validation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.data import Noise, Windows
from expdesign.diagnosis.fit.between_runs import sum_by_run
from expdesign.diagnosis.fit.linear_model import (
    GramMatrices,
    Sensitivities,
    build_sensitivities,
    current_precision,
    gram_matrices,
    start_columns,
    whitened_error,
)
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import linearise, simulate_from_measured
from expdesign.estimation.solve import NORMAL_95
from expdesign.values import Array

BLOCK_S = 60.0  # length of the blocks that predictions are compared in [s]

LEAST_FIT = 0.0  # of simulations of whole held-out units [%]; where one is worse, the stretches count
BOOTSTRAP_DRAWS = 1000  # of units, for intervals
LEAST_ERROR = 1e-3  # of a stretch, over the deviation of an average one
FEWEST_RUNS = 3  # that count as units; fewer are judged by their parts


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldOut:
    """Errors of one model on units that it was not fitted to."""

    squared_error: Array  # (b, n) sum per unit and output; nan for units whose fold could not be fitted
    squared_deviation: Array  # (b, n) of the measurements from their mean, likewise
    unconverged: int = 0  # folds that kept the effects fitted to all units
    # of the same units in stretches of `AHEAD_S`, fitted and simulated when it is called
    ahead: Callable[[], HeldOut] | None = None
    # in the same stretches, by the models that simulate whole runs held out: none has seen any of the run it predicts;
    # as `ahead` where there are fewer than `FEWEST_RUNS`
    on_other_runs: Callable[[], HeldOut] | None = None
    in_stretches: bool = False  # whether these are such errors
    # (b,) of each unit, where these are stretches of runs in the order of time: those of one run share its errors
    run: Array | None = None
    # (mask of windows, model fitted without them) of every fold; None where it could not be fitted
    models: tuple[tuple[NDArray[np.bool_], ExtendedModel | None], ...] = ()

    @property
    def fit(self) -> Array:
        """(n,) [%] over all units that could be fitted; of stretches by the geometric mean of relative errors."""
        if self.run is not None:
            return 100.0 * (1.0 - np.exp(_known_mean(self.log_errors, axis=0)))
        return _fit_percent(np.nansum(self.squared_error, axis=0), np.nansum(self.squared_deviation, axis=0))

    @cached_property
    def log_errors(self) -> Array:
        """(b, n) logarithm of every unit's error over the deviation of an average one; nan where nothing is known.

        No error counts as less than `LEAST_ERROR`: what is exact in all it shows decides nothing.
        """
        known = np.isfinite(self.squared_error) & ((self.squared_error > 0) | (self.squared_deviation > 0))
        total = np.where(known, self.squared_deviation, 0.0).sum(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = self.squared_error / (total / known.sum(axis=0))
            return np.asarray(np.where(known & (total > 0), np.log(np.maximum(relative, LEAST_ERROR**2)) / 2, np.nan))

    def like(self, other: HeldOut) -> HeldOut:
        """Errors of the same model measured as those of another are: of whole units or of short stretches."""
        return self.ahead() if other.in_stretches and self.ahead is not None else self

    def apart(self) -> HeldOut:
        """Errors in stretches of runs that the model was not fitted to, where there are enough; else in whole units."""
        return self if self.on_other_runs is None else self.on_other_runs()

    @property
    def mean_fit(self) -> float:
        """Over outputs [%]; minus infinity where one has none. Of stretches by the geometric mean over outputs too."""
        if self.run is not None:
            typical = _known_mean(_known_mean(self.log_errors, axis=1), axis=0)
            return float(100.0 * (1.0 - np.nan_to_num(np.exp(typical), nan=np.inf)))
        return float(np.nan_to_num(self.fit, nan=-np.inf).mean())

    @property
    def left(self) -> float:
        """What the model leaves unexplained on average [%], of which gains are shares."""
        return 100.0 - self.mean_fit


def judged(held: Sequence[HeldOut], *, first: int = 1) -> list[HeldOut]:
    """Errors by which models are compared: of whole units, or of short stretches.

    Stretches count where a model simulates some output of whole units worse than a constant.

    Args:
        first: the first whose simulation decides so; the model before any cause may be as bad as it is.
    """
    stretches = [item.ahead for item in held if item.ahead is not None]
    astray = any(leads_away(item) for item in held[first:])
    return [ahead() for ahead in stretches] if astray and len(stretches) == len(held) else [*held]


def leads_away(held: HeldOut) -> bool:
    """Whether a model simulates some output of whole units worse than a constant."""
    return not (held.fit >= LEAST_FIT).all()


def on_common_units(before: HeldOut, after: HeldOut) -> tuple[HeldOut, HeldOut]:
    """Two models on the units that could be fitted for both."""
    both = np.isfinite(before.squared_error).all(axis=1) & np.isfinite(after.squared_error).all(axis=1)
    first, second = (
        HeldOut(
            squared_error=item.squared_error[both],
            squared_deviation=item.squared_deviation[both],
            run=None if item.run is None else item.run[both],
        )
        for item in (before, after)
    )
    return first, second


def held_out_gain(before: HeldOut, after: HeldOut, seed: int) -> tuple[float, tuple[float, float]]:
    """Mean gain of fit over outputs [points] and its 95 % interval, up to a perfect fit.

    All are nan where no unit could be fitted for both.
    """
    before, after = on_common_units(before, after)
    if not len(before.squared_error):
        return np.nan, (np.nan, np.nan)
    if before.run is not None:
        ratio, least, most = (float(one[0]) for one in _ratios(before, after, together=True))
        left = 100.0 - before.mean_fit
        return left * (1.0 - ratio), (left * (1.0 - most), left * (1.0 - least))
    fits = [_fit_percent(*sums) for sums in _bootstrap_sums(before, after, seed)]
    gain = np.nanmean(after.fit - before.fit)
    low, high = _interval_of(gain, np.nanmean(fits[1] - fits[0], axis=1), len(before.squared_error))
    return float(gain), (float(low), min(float(high), 100.0 - before.mean_fit))


def gains_for_certain(held: Sequence[HeldOut], seed: int) -> bool:
    """Whether the second of two models gains, by an interval that excludes zero."""
    _, (low, _) = held_out_gain(held[0], held[1], seed)
    return low > 0.0


def certain_reductions(before: HeldOut, after: HeldOut, seed: int) -> tuple[Array, Array, Array]:
    """(n,) share by which the error of every output falls, and the ends of its interval of 95 %.

    All are nan where no unit could be fitted for both.
    """
    before, after = on_common_units(before, after)
    if not len(before.squared_error):
        share, low, high = np.full((3, before.squared_error.shape[1]), np.nan)
        return share, low, high
    if before.run is not None:
        ratio, least, most = _ratios(before, after)
        return 1.0 - ratio, 1.0 - most, 1.0 - least
    drawn = [error for error, _ in _bootstrap_sums(before, after, seed)]
    with np.errstate(divide="ignore", invalid="ignore"):
        log_ratio = np.log(after.squared_error.sum(axis=0) / before.squared_error.sum(axis=0)) / 2
        ends = _interval_of(log_ratio, np.log(drawn[1] / drawn[0]) / 2, len(before.squared_error))
    share, high, low = 1.0 - np.exp([log_ratio, *ends])
    return share, low, high


# Whole runs.


def _bootstrap_sums(before: HeldOut, after: HeldOut, seed: int) -> list[tuple[Array, Array]]:
    """Sums of squared errors and deviations over units drawn with replacement, (draws, n), the same for both models.

    The same seed draws the same units, for decisions and for reports.
    """
    times = _times_drawn(len(before.squared_error), seed)
    return [(times @ item.squared_error, times @ item.squared_deviation) for item in (before, after)]


@lru_cache(maxsize=16)
def _times_drawn(count: int, seed: int) -> Array:
    """(draws, count) how often each unit is drawn."""
    rng = np.random.default_rng(seed)
    return rng.multinomial(count, np.full(count, 1.0 / count), size=BOOTSTRAP_DRAWS).astype(float)


def _interval_of(found: Array | np.floating, drawn: Array, count: int) -> Array:
    """(2, ...) 95 % interval of what was found, given the same of draws (draws, ...) of so many units.

    Quantiles of draws of n units are too near: draws vary by sqrt((n - 1) / n) of what they should, and of few units
    nobody knows how they vary, which Student's distribution counts.

    Source: T. Hesterberg, The American Statistician 69 (2015), 371-386, 3.2.
    """
    count = max(2, count)
    wider = np.sqrt(count / (count - 1)) * scipy.special.stdtrit(count - 1, 0.975) / NORMAL_95
    quantile = np.nanquantile if np.isnan(drawn).any() else np.quantile  # which is quicker
    return np.asarray(found + wider * (quantile(drawn, [0.025, 0.975], axis=0) - found))


# Short stretches.


def _known_mean(values: Array, *, axis: int) -> Array:
    """Mean of what is known; nan where nothing is."""
    known = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(known, values, 0.0).sum(axis=axis) / known.sum(axis=axis))


def _ratios(before: HeldOut, after: HeldOut, *, together: bool = False) -> tuple[Array, Array, Array]:
    """(n,) geometric mean of the ratios of two models' errors in stretches, and the ends of its interval of 95 %.

    One run or two are told by their stretches, as many as are independent: the interval is of these runs sailed on, and
    tells nothing of how others differ. Three runs or more show that, too.

    Args:
        before: errors of one model.
        after: of another, in the same stretches.
        together: (1,) of all outputs, each with the same weight.
    """
    run = np.zeros(len(before.squared_error)) if before.run is None else before.run
    change = after.log_errors - before.log_errors
    if len(np.unique(run)) >= FEWEST_RUNS:
        wider, free = _beyond_stretches(change, run)
    else:
        run, count = np.zeros_like(run), _independent_stretches(change, run)
        wider, free = len(run) / count, count - 1.0
    change = _known_mean(change, axis=1)[:, None] if together else change
    middle = _known_mean(change, axis=0)
    error = scipy.special.stdtrit(free, 0.975) * np.sqrt(wider * _by_stretches(change, run)[1])
    ratio, least, most = np.exp([middle, middle - error, middle + error])
    return ratio, least, most


def _by_stretches(change: Array, run: Array) -> tuple[Array, Array]:
    """(b, n) changes less the mean of their run, and (n,) the variance of the mean of all that stretches alone tell."""
    known, (names, place) = np.isfinite(change), np.unique(run, return_inverse=True)
    sums, counts = sum_by_run(np.where(known, change, 0.0), run), sum_by_run(known.astype(float), run)
    off = np.where(known, change - (sums / np.maximum(counts, 1.0))[place], 0.0)
    count = np.maximum(known.sum(axis=0), 1.0)
    return off, np.maximum((off**2).sum(axis=0) / np.maximum(count - len(names), 1.0) / count, 1e-30)


def _beyond_stretches(change: Array, run: Array) -> tuple[float, float]:
    """By how much more the mean of runs varies than their stretches alone tell, and the degrees of freedom of that.

    Stretches of one run share its weather and all that its model lacks. All outputs together show how runs differ,
    those that change alike as fewer: of their correlations C, as (tr C)^2 / tr C^2.

    Args:
        change: (b, n) of every stretch and output, nan where nothing is known.
        run: (b,) that each stretch is of.

    Sources: K.-Y. Liang and S. L. Zeger, Biometrika 73 (1986), 13-22, for the variance of a mean of runs; F. E.
    Satterthwaite, Biometrics Bulletin 2 (1946), 110-114, for the degrees of freedom.
    """
    runs, known = len(np.unique(run)), np.isfinite(change)
    off, by_stretches = _by_stretches(change, run)
    of_runs = sum_by_run(np.where(known, change - _known_mean(change, axis=0), 0.0), run)
    by_runs = ((of_runs / np.maximum(known.sum(axis=0), 1.0)) ** 2).sum(axis=0) * runs / (runs - 1.0)
    ratio = float((by_runs / by_stretches)[known.any(axis=0)].mean())
    if not ratio > 1.0:
        return 1.0, max(1.0, float(len(run) - runs))
    off = off / np.maximum(np.sqrt((off**2).sum(axis=0)), 1e-300)
    alike = off.T @ off
    outputs = max(1.0, float(np.trace(alike) ** 2 / max((alike**2).sum(), 1e-300)))
    return ratio, outputs * (runs - 1.0)


def _independent_stretches(change: Array, run: Array) -> float:
    """How many independent stretches tell as much of a mean as those of a run, each of which is like the one before.

    Of n stretches with a correlation c from one to the next, n (1 - c) / (1 + c), and never less than two. The
    correlation is that of the change of error, by all outputs, less its bias, and by its standard error more, because
    few stretches hide it.

    Args:
        change: (b, n) of every stretch and output, nan where nothing is known.
        run: (b,) that each stretch is of.

    Source: G. V. Bayley and J. M. Hammersley, Supplement to the Journal of the Royal Statistical Society 8 (1946),
    184-197; M. G. Kendall, Biometrika 41 (1954), 403-404, for the bias.
    """
    count = len(change)
    change = np.where(np.isfinite(change), change - _known_mean(change, axis=0), 0.0)
    change = change / np.maximum(change.std(axis=0), 1e-300)
    pairs = run[1:] == run[:-1]
    found = float((change[1:] * change[:-1])[pairs].mean()) if pairs.any() else 0.0
    correlation = min(max(0.0, found + (1.0 + 3.0 * found) / count + 1.0 / np.sqrt(count)), 1.0)
    return max(2.0, float(count * (1.0 - correlation) / (1.0 + correlation)))


def _fit_percent(squared_error: Array, squared_deviation: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        fit_percent = 100 * (1 - np.sqrt(squared_error / squared_deviation))
        return np.asarray(np.where(squared_deviation > 0, fit_percent, np.nan))


# How well models predict held-out data from one sample to the next, given all before: held-out likelihoods.


def prediction_gain(
    before: HeldOut, after: HeldOut, windows: Windows, noise: Noise
) -> tuple[float, tuple[float, float]]:
    """Share of the squared error of held-out predictions that a model takes away, and its 95 % interval over blocks.

    Args:
        before: the model without it, fitted without each of the units that it is held out of; after: with it.
        noise: that both are whitened by.
    """
    middle, std, freedom = _mean_change(before, after, windows, noise)
    error = scipy.special.stdtrit(freedom, 0.975) * std
    share, most, least = (1.0 - np.exp([middle, middle - error, middle + error])).tolist()
    return share, (least, most)


def prediction_p_value(before: HeldOut, after: HeldOut, windows: Windows, noise: Noise) -> float:
    """That held-out predictions are no better with a model; arguments as of `prediction_gain`."""
    middle, std, freedom = _mean_change(before, after, windows, noise)
    return float(scipy.special.stdtr(freedom, middle / max(std, 1e-300))) if np.isfinite(middle) else 1.0


def _mean_change(before: HeldOut, after: HeldOut, windows: Windows, noise: Noise) -> tuple[float, float, int]:
    """Mean logarithm of the ratio of squared errors over blocks, its standard error and degrees of freedom."""
    if not before.models or not after.models:
        return np.nan, np.nan, 1
    lost, left = (_all_squares(held, windows, noise) for held in (before, after))
    if lost.shape != left.shape or len(lost) < 2:
        return np.nan, np.nan, 1
    with np.errstate(invalid="ignore"):
        ratios = np.log(left / lost)  # nan where both models run away
    return float(ratios.mean()), float(ratios.std(ddof=1) / np.sqrt(len(ratios))), len(ratios) - 1


@lru_cache(maxsize=16)
def _all_squares(held: HeldOut, windows: Windows, noise: Noise) -> Array:
    """(blocks,) of all folds; passes of the elimination ask for the same again."""
    return np.concatenate([_squares(*one, windows, noise) for one in held.models])


def _current(grams: GramMatrices, found: Sensitivities, noise: Noise) -> Array:
    """(w, z) likeliest random current at its knots."""
    prior = current_precision(found, noise)[0]
    return np.asarray(np.linalg.solve(grams.XX + prior, grams.Xe[..., None])[..., 0])


def _squares(held_out: NDArray[np.bool_], ship: ExtendedModel | None, windows: Windows, noise: Noise) -> Array:
    """(blocks,) squared whitened error of u, v, r in some windows, summed over blocks of time; infinite if lost."""
    if ship is None:
        return np.zeros(0)
    motion = simulate_from_measured(ship, windows.selected(held_out))
    size = max(1, round(BLOCK_S / windows.sample_s))
    if motion.diverged:
        return np.full(1, np.inf)
    moving = noise.current_std_mps > 0 and windows.has_heading
    found = build_sensitivities(linearise(motion), [], random_current=moving)
    grams = gram_matrices(found, noise)
    current = _current(grams, found, noise) if moving else grams.Xe
    by_current = np.einsum("wc,cwsn->wsn", current, found.values)
    by_start = np.einsum("wn,nwsk->wsk", grams.start_steps(current), start_columns(found, noise))
    whole = whitened_error(found.error - by_current - by_start, noise)
    errors, seen = (part[..., : len(OUTPUTS)] for part in whole)
    count = -(-errors.shape[1] // size)
    sums = [(part**2).sum(axis=(1, 2)) for part in np.array_split(errors, count, axis=1)]
    measured = [part.any(axis=(1, 2)) for part in np.array_split(seen, count, axis=1)]
    return np.concatenate(sums)[np.concatenate(measured)]
