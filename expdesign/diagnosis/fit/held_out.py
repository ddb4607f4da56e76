"""Errors of models on data that they were not fitted to, and their comparison, with intervals by the bootstrap.

Source: B. Efron and R. J. Tibshirani, An Introduction to the Bootstrap (1993).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis.fit.tuning import TUNING
from expdesign.diagnosis.model import ExtendedModel
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldOut:
    """Errors of one model on units that it was not fitted to.

    Attributes:
        squared_error: (b, n) sum per unit and output; nan for units whose fold could not be fitted.
        squared_deviation: (b, n) of the measurements from their mean, likewise.
        unconverged: folds that kept the effects fitted to all units.
        ahead: of the same units in stretches of `Tuning.ahead_s`, fitted and simulated when it is called.
        in_stretches: whether these are such errors.
        run: (b,) of each unit, where these are stretches of runs: those of one run share its errors.
        models: (mask of windows, model fitted without them) of every fold; None where it could not be fitted.
    """

    squared_error: Array
    squared_deviation: Array
    unconverged: int = 0
    ahead: Callable[[], HeldOut] | None = None
    in_stretches: bool = False
    run: Array | None = None
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
    return not (held.fit >= TUNING.least_fit).all()


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

    Of stretches of several runs, runs are drawn, then stretches of each. The same seed draws the same units, for
    decisions and for reports.
    """
    runs = (0,) * len(before.squared_error) if before.run is None else tuple(before.run.tolist())
    times = _times_drawn(runs, TUNING.bootstrap_draws, seed)
    first, second = (
        HeldOut(squared_error=times @ item.squared_error, squared_deviation=times @ item.squared_deviation)
        for item in (before, after)
    )
    return first, second


@lru_cache(maxsize=16)
def _times_drawn(runs: tuple[float, ...], draws: int, seed: int) -> Array:
    """(draws, count) how often each unit is drawn, given its run."""
    rng = np.random.default_rng(seed)
    names, run = np.unique(runs, return_inverse=True)
    runs_drawn = _drawn(rng, np.full(draws, len(names)), len(names)) if len(names) > 1 else np.ones((draws, 1))
    times = np.zeros((draws, len(run)))
    for number in range(len(names)):
        units = np.flatnonzero(run == number)
        times[:, units] = _drawn(rng, (len(units) * runs_drawn[:, number]).astype(int), len(units))
    return times


def _drawn(rng: np.random.Generator, many: NDArray[np.int64], count: int) -> Array:
    """(draws, count) how often each of so many is drawn, if (draws,) `many` are drawn with replacement."""
    return np.asarray(rng.multinomial(many, np.full(count, 1.0 / count)), dtype=float)


def held_out_gain(before: HeldOut, after: HeldOut, seed: int) -> tuple[float, tuple[float, float]]:
    """Mean gain of fit over outputs [points] and its 95 % interval; nan where no unit could be fitted for both."""
    before, after = on_common_units(before, after)
    if not len(before.squared_error):
        return np.nan, (np.nan, np.nan)
    fits = [_fit_percent(item.squared_error, item.squared_deviation) for item in bootstrap_sums(before, after, seed)]
    low, high = np.nanquantile(np.nanmean(fits[1] - fits[0], axis=1), [0.025, 0.975])
    return float(np.nanmean(after.fit - before.fit)), (float(low), float(high))


def _fit_percent(squared_error: Array, squared_deviation: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        fit_percent = 100 * (1 - np.sqrt(squared_error / squared_deviation))
        return np.asarray(np.where(squared_deviation > 0, fit_percent, np.nan))
