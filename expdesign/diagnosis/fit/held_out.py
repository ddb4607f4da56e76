"""Errors of models on data that they were not fitted to, one sample ahead and over whole runs, and their comparison.

Errors of models on data that they were not fitted to, and their comparison, with intervals by the bootstrap.

Source: B. Efron and R. J. Tibshirani, An Introduction to the Bootstrap (1993).

How well models predict held-out data from one sample to the next, given all before: held-out likelihoods.

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
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.data import Noise, Windows
from expdesign.diagnosis.fit.between_runs import NORMAL_95, sum_by_run
from expdesign.diagnosis.fit.linear_model import (
    GramMatrices,
    Sensitivities,
    build_sensitivities,
    current_precision,
    gram_matrices,
    start_columns,
    whitened_error,
)
from expdesign.diagnosis.fit.tuning import TUNING
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import linearise, simulate_from_measured
from expdesign.values import Array

LEAST_FIT = 0.0  # of simulations of whole held-out units [%]; where one is worse, the stretches count
BOOTSTRAP_DRAWS = 1000  # of units, for intervals
FEWEST_RUNS = 3  # that count as units; fewer are judged by their parts


# Errors of models on data that they were not fitted to, and their comparison, with intervals by the bootstrap.


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldOut:
    """Errors of one model on units that it was not fitted to."""

    squared_error: Array  # (b, n) sum per unit and output; nan for units whose fold could not be fitted
    squared_deviation: Array  # (b, n) of the measurements from their mean, likewise
    unconverged: int = 0  # folds that kept the effects fitted to all units
    # of the same units in stretches of `Tuning.ahead_s`, fitted and simulated when it is called
    ahead: Callable[[], HeldOut] | None = None
    in_stretches: bool = False  # whether these are such errors
    # (b,) of each unit, where these are stretches of runs in the order of time: those of one run share its errors
    run: Array | None = None
    # (mask of windows, model fitted without them) of every fold; None where it could not be fitted
    models: tuple[tuple[NDArray[np.bool_], ExtendedModel | None], ...] = ()

    @property
    def fit(self) -> Array:
        """(n,) [%] over all units that could be fitted."""
        return _fit_percent(np.nansum(self.squared_error, axis=0), np.nansum(self.squared_deviation, axis=0))

    def like(self, other: HeldOut) -> HeldOut:
        """Errors of the same model measured as those of another are: of whole units or of short stretches."""
        return self.ahead() if other.in_stretches and self.ahead is not None else self

    @property
    def mean_fit(self) -> float:
        """Over outputs [%]; minus infinity where one has none."""
        return float(np.nan_to_num(self.fit, nan=-np.inf).mean())


def judged(held: Sequence[HeldOut], *, first: int = 1) -> list[HeldOut]:
    """Errors by which models are compared: of whole units, or of short stretches.

    Stretches count where a model simulates some output of whole units worse than a constant.

    Args:
        held: errors of the models.
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


def bootstrap_sums(before: HeldOut, after: HeldOut, seed: int) -> tuple[HeldOut, HeldOut]:
    """Sums over units drawn with replacement, (draws, n), the same units for both models.

    Of stretches of three runs or more, runs are drawn whole. The same seed draws the same units, for decisions and for
    reports.
    """
    first, second = _independent(before), _independent(after)
    times = _times_drawn(len(first.squared_error), seed)
    drawn = (
        HeldOut(squared_error=times @ item.squared_error, squared_deviation=times @ item.squared_deviation)
        for item in (first, second)
    )
    return next(drawn), next(drawn)


@lru_cache(maxsize=16)
def _times_drawn(count: int, seed: int) -> Array:
    """(draws, count) how often each unit is drawn."""
    rng = np.random.default_rng(seed)
    return rng.multinomial(count, np.full(count, 1.0 / count), size=BOOTSTRAP_DRAWS).astype(float)


def _independent(held: HeldOut) -> HeldOut:
    """Errors of runs, where there are three or more; else of units as they are."""
    if held.run is None or len(np.unique(held.run)) < FEWEST_RUNS:
        return held
    error, deviation = (sum_by_run(item, held.run) for item in (held.squared_error, held.squared_deviation))
    return HeldOut(squared_error=error, squared_deviation=deviation)


def held_out_gain(before: HeldOut, after: HeldOut, seed: int) -> tuple[float, tuple[float, float]]:
    """Mean gain of fit over outputs [points] and its 95 % interval, up to a perfect fit.

    All are nan where no unit could be fitted for both.
    """
    before, after = on_common_units(before, after)
    if not len(before.squared_error):
        return np.nan, (np.nan, np.nan)
    fits = [_fit_percent(item.squared_error, item.squared_deviation) for item in bootstrap_sums(before, after, seed)]
    gain = np.nanmean(after.fit - before.fit)
    low, high = interval_of(gain, np.nanmean(fits[1] - fits[0], axis=1), before, after)
    return float(gain), (float(low), min(float(high), 100.0 - before.mean_fit))


def interval_of(found: Array | np.floating, drawn: Array, before: HeldOut, after: HeldOut) -> Array:
    """(2, ...) 95 % interval of what was found, given the same of draws (draws, ...) of the units of such errors.

    Quantiles of draws of n units are too near: draws vary by sqrt((n - 1) / n) of what they should, and of few units
    nobody knows how they vary, which Student's distribution counts. Three runs or more are such units. One run or two
    are told by their stretches, as many as are independent: the interval is of these runs sailed on, and tells nothing
    of how others differ.

    Source: T. Hesterberg, The American Statistician 69 (2015), 371-386, 3.2.
    """
    first, second = _independent(before), _independent(after)
    count = max(2, len(first.squared_error))
    free = count if first.run is None else max(2.0, _independent_stretches(first, second))
    wider = count / np.sqrt((count - 1) * free) * scipy.special.stdtrit(free - 1, 0.975) / NORMAL_95
    quantile = np.nanquantile if np.isnan(drawn).any() else np.quantile  # which is quicker
    return np.asarray(found + wider * (quantile(drawn, [0.025, 0.975], axis=0) - found))


def _independent_stretches(before: HeldOut, after: HeldOut) -> float:
    """How many independent stretches tell as much of a mean as those of a run, each of which is like the one before.

    Of n stretches with a correlation c from one to the next, n (1 - c) / (1 + c). The correlation is that of what they
    add to the change of error, by all outputs, less its bias, and by its standard error more, because few stretches
    hide it.

    Source: G. V. Bayley and J. M. Hammersley, Supplement to the Journal of the Royal Statistical Society 8 (1946),
    184-197; M. G. Kendall, Biometrika 41 (1954), 403-404, for the bias.
    """
    shares = [item.squared_error / np.maximum(item.squared_error.sum(axis=0), 1e-300) for item in (before, after)]
    change, count = shares[1] - shares[0], len(shares[0])
    change = change / np.maximum(change.std(axis=0), 1e-300)
    pairs = before.run[1:] == before.run[:-1] if before.run is not None else np.zeros(0)
    found = float((change[1:] * change[:-1])[pairs].mean()) if pairs.any() else 0.0
    correlation = min(max(0.0, found + (1.0 + 3.0 * found) / count + 1.0 / np.sqrt(count)), 1.0)
    return float(count * (1.0 - correlation) / (1.0 + correlation))


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
        windows: all data.
        noise: that both are whitened by.
    """
    if not before.models or not after.models:
        return np.nan, (np.nan, np.nan)
    lost, left = (np.concatenate([_squares(*one, windows, noise) for one in held.models]) for held in (before, after))
    if lost.shape != left.shape or len(lost) < 2:
        return np.nan, (np.nan, np.nan)
    with np.errstate(invalid="ignore"):
        ratios = np.log(left / lost)  # nan where both models run away
    middle, error = (
        ratios.mean(),
        scipy.special.stdtrit(len(ratios) - 1, 0.975) * ratios.std(ddof=1) / np.sqrt(len(ratios)),
    )
    share, most, least = (1.0 - np.exp([middle, middle - error, middle + error])).tolist()
    return share, (least, most)


def _current(grams: GramMatrices, found: Sensitivities, noise: Noise) -> Array:
    """(w, z) likeliest random current at its knots."""
    prior = current_precision(found, noise)[0]
    return np.asarray(np.linalg.solve(grams.XX + prior, grams.Xe[..., None])[..., 0])


def _squares(held_out: NDArray[np.bool_], ship: ExtendedModel | None, windows: Windows, noise: Noise) -> Array:
    """(blocks,) squared whitened error of u, v, r in some windows, summed over blocks of time; infinite if lost."""
    if ship is None:
        return np.zeros(0)
    motion = simulate_from_measured(ship, windows.selected(held_out))
    size = max(1, round(TUNING.block_s / windows.sample_s))
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
