"""What mending gains where it was not fitted: cross-validation over batches, and a bootstrap over batches.

Sizes are fitted without the batches that they are judged on; where such a fit gets nowhere from that to all batches,
they stay as they are, have seen all batches, and are told of. Which causes, and what is searched on a grid
(the width of a dead band, the time of a change, where the wind blows), were chosen with all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit.gauss_newton import Fit, fit
from expdesign.diagnosis.model import Extended, simulate_from_first, sums
from expdesign.values import Array

FOLDS = 3
DRAWS = 1000
STEPS = 6
"""Gauss-Newton steps from the fit to all batches to that of a fold."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldOut:
    """Errors of one model on batches that it was not fitted to.

    Attributes:
        lost, spread: (b, n) squared error and squared deviation from the mean, per batch and output; nan for batches
            whose fold could not be fitted.
        stuck: folds whose numbers have seen all batches, as their own fit got nowhere.
    """

    lost: Array
    spread: Array
    stuck: int = 0

    @property
    def fit(self) -> Array:
        """(n,) [%] over all batches that count."""
        return _fit(np.nansum(self.lost, axis=0), np.nansum(self.spread, axis=0))


def _fit(lost: Array, spread: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(spread > 0, 100 * (1 - np.sqrt(lost / spread)), np.nan))


def units(windows: Windows) -> Array:
    """(w,) what is held out together: batches, or windows where there are fewer than three batches."""
    return windows.batch if len(np.unique(windows.batch)) >= 3 else np.arange(len(windows.batch), dtype=float)


def held_out(found: Fit | None, ship: Extended, windows: Windows, tell: Callable[[float], None]) -> HeldOut:
    """Errors of a model, its free numbers fitted to the other batches.

    Args:
        found: its fit to all batches; None for a model that is not fitted.
        ship: the model.
        windows: all data.
        tell: share done.
    """
    unit = units(windows)
    names = np.unique(unit)
    folds = [names[index::FOLDS] for index in range(min(FOLDS, len(names)))]
    columns = [OUTPUTS.index(name) for name in ship.model.outputs]
    lost = np.zeros((len(names), len(columns)))
    spread, stuck = np.zeros_like(lost), 0
    for number, fold in enumerate(folds):
        tell(number / len(folds))
        test = np.isin(unit, fold)
        model = ship if found is None or test.all() else _fitted(found, windows, ~test)
        if model is None:
            lost[np.isin(names, fold)], spread[np.isin(names, fold)] = np.nan, np.nan
            continue
        stuck += found is not None and model is found.ship
        part = windows.picked(test)
        motion = simulate_from_first(model, part, None if found is None else found.linear.picked(test))
        some = sums(motion.error[..., columns], part.measured[..., columns])
        for which, rows in zip((lost, spread), some, strict=True):
            np.add.at(which, np.searchsorted(names, unit[test]), rows)
    return HeldOut(lost=lost, spread=spread, stuck=stuck)


def _fitted(found: Fit, windows: Windows, train: NDArray[np.bool_]) -> Extended | None:
    """The model with its numbers fitted to some windows, or None where they cannot be.

    Where no step from the fit to all windows costs less on these, its numbers stay, converged or not.
    """
    free = tuple(key for key in found.keys[: found.free])
    try:
        return fit(
            found.ship, windows.picked(train), free, starts=found.starts[train], noise=found.noise, steps=STEPS,
            colour_order=found.noise.order, near=found.linear.picked(train), given_weights=True,
        ).ship  # fmt: skip
    except (FloatingPointError, np.linalg.LinAlgError):
        return None


def on_same(before: HeldOut, after: HeldOut) -> tuple[HeldOut, HeldOut]:
    """Two models on the batches that count for both."""
    both = np.isfinite(before.lost).all(axis=1) & np.isfinite(after.lost).all(axis=1)
    first, second = (HeldOut(lost=item.lost[both], spread=item.spread[both]) for item in (before, after))
    return first, second


def gained(before: HeldOut, after: HeldOut, seed: int) -> tuple[float, tuple[float, float]]:
    """Mean gain of fit over outputs [points], and its 95 % interval from drawing batches with replacement.

    The same seed gives the same interval, to decide by and to report. Nan where no batch counts for both.
    """
    before, after = on_same(before, after)
    count = len(before.lost)
    if not count:
        return np.nan, (np.nan, np.nan)
    drawn = np.random.default_rng(seed).integers(0, count, (DRAWS, count))
    fits = [_fit(item.lost[drawn].sum(axis=1), item.spread[drawn].sum(axis=1)) for item in (before, after)]
    gains = np.nanmean(fits[1] - fits[0], axis=1)
    low, high = np.nanquantile(gains, [0.025, 0.975])
    return float(np.nanmean(after.fit - before.fit)), (float(low), float(high))
