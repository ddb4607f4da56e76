"""What mending gains where it was not fitted: cross-validation over batches, and a bootstrap over batches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.accuracy import simulate_from_first, sums
from expdesign.diagnosis.extended import Extended
from expdesign.diagnosis.joint import Fit, fit
from expdesign.diagnosis.windows import Windows
from expdesign.values import Array

FOLDS = 3
DRAWS = 1000


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldOut:
    """Errors of one model on batches that it was not fitted to.

    Attributes:
        lost, spread: (b, n) squared error and squared deviation from the mean, per batch and output.
    """

    lost: Array
    spread: Array

    @property
    def fit(self) -> Array:
        """(n,) [%] over all batches."""
        return _fit(self.lost.sum(axis=0), self.spread.sum(axis=0))


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
    spread = np.zeros_like(lost)
    for number, fold in enumerate(folds):
        tell(number / len(folds))
        test = np.isin(unit, fold)
        model = ship if found is None or test.all() else _fitted(found, windows, ~test)
        part = windows.picked(test)
        motion = simulate_from_first(model, part, None if found is None else found.linear.picked(test))
        some = sums(motion.error[..., columns], part.measured[..., columns])
        for which, rows in zip((lost, spread), some, strict=True):
            np.add.at(which, np.searchsorted(names, unit[test]), rows)
    return HeldOut(lost=lost, spread=spread)


def _fitted(found: Fit, windows: Windows, train: NDArray[np.bool_]) -> Extended:
    free = tuple(key for key in found.keys[: found.free])
    try:
        return fit(
            found.ship, windows.picked(train), free, starts=found.starts[train], noise=found.noise, steps=1,
            colour_order=found.noise.order, near=found.linear.picked(train),
        ).ship  # fmt: skip
    except (FloatingPointError, np.linalg.LinAlgError):
        return found.ship


def gained(before: HeldOut, after: HeldOut, rng: np.random.Generator) -> tuple[float, tuple[float, float]]:
    """Mean gain of fit over outputs [points], and its 95 % interval from drawing batches with replacement."""
    count = len(before.lost)
    drawn = rng.integers(0, count, (DRAWS, count))
    fits = [_fit(item.lost[drawn].sum(axis=1), item.spread[drawn].sum(axis=1)) for item in (before, after)]
    gains = np.nanmean(fits[1] - fits[0], axis=1)
    low, high = np.nanquantile(gains, [0.025, 0.975])
    return float(np.nanmean(after.fit - before.fit)), (float(low), float(high))
