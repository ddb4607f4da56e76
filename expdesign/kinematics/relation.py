"""One measured change against another, over windows of a record: their ratio, its standard error, what is left.

    y = a x + b z + rest,    a, b complex where x and y are vectors in the plane, north + i east

Both x and y are measured, so that regression of y on x gives a ratio that noise on x makes smaller, and that of x on y
one that noise on y makes larger; the truth lies between. What is said of a ratio must hold of both.

Standard errors come from leaving out one stretch of the record at a time, so that slow disturbances count.

Source: B. Efron, The Jackknife, the Bootstrap and Other Resampling Plans (1982), chapter 3; W. A. Fuller, Measurement
Error Models (1987), 1.1 for the bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.signals import Batch
from expdesign.values import Array

LENGTHS = 1.0  # ship lengths sailed in a window
WINDOW_SAMPLES = 5  # fewest samples of a window
LONGEST_WINDOW_S = 60.0  # of a window [s]
WINDOWS = 1.5  # least length of a stretch, in windows
BLOCKS = 20  # stretches that the record is cut into, each left out in turn for the standard errors
FEWEST_BLOCKS = 8  # with which a comparison is made
CERTAIN = 6.0  # standard errors from what would be right at which a finding is told
# standard error of a scale, at least: readings of several samples, rounding and filters in instruments change scales by
# about as much
SCALE_STD = 0.001
# least share of a regressor that the others do not explain; that of a way, which is measured better than most
TOLD = 0.02
# share of the squares of y that z must leave; of a sensor that never moves it leaves rounding
LEFT = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Relation:
    """How y follows x."""

    ratio: complex  # a, of y on x
    inverse: float  # size of the ratio of x on y, not smaller than |a|
    std: tuple[float, float]  # standard error of the real part of a, and of its imaginary part
    others: Array  # (n,) b
    others_std: Array  # (n, 2) standard errors of their real and imaginary parts
    share: float  # of the squares of y, less what z explains, that x explains
    rest: float  # root mean square of what is left, in the unit of y
    own: float  # share of the squares of x that z does not explain

    @property
    def size(self) -> float:
        """Size of the ratio, between those of both regressions."""
        return float(np.sqrt(abs(self.ratio) * self.inverse))

    @property
    def size_std(self) -> float:
        """Standard error of the size, with half the distance of both regressions, and what no instrument is free of."""
        return float(np.hypot(np.hypot(self.std[0], (self.inverse - abs(self.ratio)) / 2.0), SCALE_STD))

    def differs(self, value: float, *, by: float) -> bool:
        """Whether the size is certainly another than this, and by as much, whichever of x and y is noisy."""
        bounds = (abs(self.ratio), self.inverse)
        apart = [bound - value for bound in bounds]
        certain = all(abs(gap) > CERTAIN * self.std[0] for gap in apart)
        return certain and apart[0] * apart[1] > 0 and min(map(abs, apart)) > by


def relation(stretches: Sequence[Array], *, told: float = TOLD) -> Relation | None:
    """The relation over all stretches; None where they tell too little.

    Args:
        stretches: arrays (k, 2 + n) of y, x and z in windows.
        told: least share of the squares of x that z must leave.
    """
    moments = np.array([rows.conj().T @ rows for rows in stretches if len(rows)])
    if len(moments) < FEWEST_BLOCKS:
        return None
    whole, count = moments.sum(axis=0), sum(map(len, stretches))
    found = _solved(whole, told)
    if found is None:
        return None
    left_out = [_solved(whole - part, told) for part in moments]
    if any(other is None for other in left_out):
        return None
    drawn = np.array([other[0] for other in left_out if other is not None])
    spread = np.sqrt((len(moments) - 1) * np.stack([np.var(drawn.real, axis=0), np.var(drawn.imag, axis=0)], axis=-1))
    values, partial, own = found
    rest = float(np.real(partial[0, 0] - abs(partial[0, 1]) ** 2 / partial[1, 1]))
    return Relation(
        ratio=complex(values[0]),
        inverse=float(np.real(partial[0, 0]) / max(abs(partial[0, 1]), 1e-300)),
        std=(float(spread[0, 0]), float(spread[0, 1])),
        others=values[1:],
        others_std=spread[1:],
        share=float(abs(partial[0, 1]) ** 2 / max(np.real(partial[0, 0] * partial[1, 1]), 1e-300)),
        rest=float(np.sqrt(max(rest, 0.0) / count)),
        own=own,
    )


def _solved(moments: Array, told: float) -> tuple[Array, Array, float] | None:
    """(1 + n,) a and b, the moments (2, 2) of y and x less what z explains, and the share of x that is left."""
    scale = np.sqrt(np.maximum(np.real(np.diag(moments)), 0.0))
    if not scale[:2].all():
        return None
    used = scale > 0
    used[:2] = True
    m = moments[np.ix_(used, used)] / np.outer(scale[used], scale[used])
    nuisance = np.linalg.pinv(m[2:, 2:], rcond=1e-9, hermitian=True)
    partial = m[:2, :2] - m[:2, 2:] @ nuisance @ m[2:, :2]
    own = float(np.real(partial[1, 1]))
    if not (own > told and np.real(partial[0, 0]) > LEFT):
        return None
    a = partial[1, 0] / partial[1, 1]
    values = np.zeros(len(scale) - 1, dtype=complex)
    values[used[1:]] = np.concatenate([[a], nuisance @ (m[2:, 0] - a * m[2:, 1])]) * scale[0] / scale[used][1:]
    return values, partial * np.outer(scale[:2], scale[:2]), own


def stretches(batches: Sequence[Batch], running: Sequence[Array], *, length_m: float) -> list[Array]:
    """Changes (k, n) of running values over windows, in stretches of which one after the other is left out."""
    windows = [samples_in_window(batch, length_m) for batch in batches]
    changes = [_changes(values, window) for values, window in zip(running, windows, strict=True)]
    alone = sum(len(part) / window for part, window in zip(changes, windows, strict=True)) / WINDOWS
    count = min(BLOCKS, int(alone))
    size = max(1.0, sum(map(len, changes)) / max(count, 1))
    return (
        [piece for part in changes if len(part) for piece in np.array_split(part, max(1, round(len(part) / size)))]
        if count
        else []
    )


def _changes(values: Array, window: int) -> Array:
    """Changes over every window of so many samples, where both ends are measured."""
    steps = values[window:] - values[:-window]
    return np.asarray(steps[np.isfinite(steps).all(axis=1)], dtype=complex)


def samples_in_window(batch: Batch, length_m: float) -> int:
    """Samples in which the ship sails about her length."""
    speeds = np.hypot(*batch.velocity[:, :2].T)
    speed = float(np.nanmedian(speeds)) if np.isfinite(speeds).any() else 0.0
    seconds = min(LONGEST_WINDOW_S, LENGTHS * length_m / max(speed, 1e-9))
    return max(WINDOW_SAMPLES, round(seconds / batch.sample_time_s))


def integral(values: Array, batch: Batch) -> Array:
    """(k,) running integral over time, by the trapezoidal rule."""
    means = (values[1:] + values[:-1]) / 2.0
    return np.cumsum(np.append(0.0, means)) * batch.sample_time_s
