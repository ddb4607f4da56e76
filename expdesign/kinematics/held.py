"""Signals that are held or interpolated between readings, found from the samples at which they change.

A sensor that is read less often than the log is written repeats its last reading, or a straight line is drawn from one
reading to the next. Rates and differences of such a signal are wrong by as much as the ship moves between readings.

The samples at which a held signal changes, or an interpolated one bends, are those after a reading. They tell the
interval T and the phase: all but a few of n changes then fall on the first sample after phase + k T, which chance gives
each with probability 1 / T. A signal that is merely rounded changes when it passes from one number to the next, by one
rounding and whenever the ship has turned enough: in such a signal only changes of several sizes, or gaps of several
lengths, count as evidence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.values import Array

FEWEST_HELD = 40  # samples from which a signal is asked whether it is held
MOST_CHANGES = 0.7  # share of samples that change, or bend, above which every sample may be a reading
BEND = 2.5  # multiple of rounding above which a bend shows a reading
UNBENT = 0.6  # share of samples between readings, whose bends are rounding
STRAIGHT = 1e-3  # bend of a line, as a share of its usual step, above which it is none
SINGLE = 1.5  # multiple of the usual gap between changes up to which a gap may be one interval
TRIED = 41  # intervals that are tried around the mean of the gaps
FEWEST_CHANGES = 8  # from which an interval is found
WHOLE = 0.5  # standard errors within which an interval counts as a whole number of samples
SHORTEST_INTERVAL = 1.5  # of readings [samples]
VARIOUS = 0.3  # share of gaps of several intervals that a rounded signal must have
EVEN = 0.95  # share of changes that an interval must explain
UNEVEN = 0.25  # spread of the gaps, as a share of the interval, up to which a signal is held at about that interval
PHASES = 50  # changes whose phases are tried
ONE_SIZE = 1.5  # multiple of the smallest change below which another is of the same size
MOSTLY_ONE = 0.8  # share of changes of one size above which a signal is rounded
Places = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Held:
    """How a signal is read."""

    interval: float  # between readings [samples], more than 1
    interpolated: bool  # a straight line is drawn between readings, where others are repeated
    even: bool  # readings come in even intervals, so that their times are known
    changes: int  # number that tells


def held(values: Array) -> Held | None:
    """How a signal (k, c) is held between readings; None where every sample may be a reading."""
    if len(values) < FEWEST_HELD or not np.isfinite(values).all():
        return None
    steps = np.diff(values, axis=0)
    changes = np.flatnonzero(np.any(steps != 0, axis=1)) + 1
    if len(changes) <= MOST_CHANGES * len(steps):
        return _read_at(changes, _rounded(steps), len(values), interpolated=False)
    knots = _knots(steps)
    if len(knots) <= MOST_CHANGES * len(steps):
        return _read_at(knots, False, len(values), interpolated=True)
    return None


def knots_held(values: Array, how: Held) -> Array:
    """Values (k, c) of an interpolated signal with the last reading repeated in place of each line."""
    knots = _knots(np.diff(values, axis=0))
    first = int(np.bincount(np.mod(knots, round(how.interval))).argmax())
    places = np.arange(len(values))
    return np.asarray(values[np.maximum(places - np.mod(places - first, round(how.interval)), 0)])


def _knots(steps: Array) -> Places:
    """Samples at which a signal of these steps (k, c) bends by more than its rounding.

    Where lines are drawn over three samples or more, most bends are rounding alone.
    """
    bends = np.abs(np.diff(steps, axis=0))
    rounding = BEND * np.quantile(bends, UNBENT, axis=0)
    least = np.maximum(rounding, STRAIGHT * np.median(np.abs(steps), axis=0))
    return np.flatnonzero((bends > least).any(axis=1)) + 1


def _read_at(changes: Places, rounded: bool, count: int, *, interpolated: bool) -> Held | None:
    """The interval of readings that come at these samples, where they tell one."""
    if len(changes) < FEWEST_CHANGES:
        return None
    gaps = np.diff(changes)
    single = gaps[gaps <= SINGLE * np.median(gaps) + 0.5]
    several = np.maximum(np.round(gaps / single.mean()), 1.0)
    about = float(gaps.sum() / several.sum())
    if about + 1.0 / several.sum() < SHORTEST_INTERVAL:  # nearly every sample is a reading
        return None
    near = about + np.linspace(-1.0, 1.0, TRIED) / several.sum()
    interval = float(max(near, key=lambda value: (_explained(changes, value), -abs(value - about))))
    if abs(interval - round(interval)) * several.sum() < WHOLE * np.sqrt(several.sum()):
        interval = float(round(interval))
    if interpolated and interval != round(interval):
        return None
    if interval < SHORTEST_INTERVAL or (rounded and np.mean(several > 1) < VARIOUS):
        return None
    within = np.abs(gaps - several * interval)
    if np.mean(within < 1.0) >= EVEN and _explained(changes, interval) >= EVEN:
        return Held(interval=interval, interpolated=interpolated, even=True, changes=len(changes))
    if np.std(gaps / several) < UNEVEN * interval and not rounded and not interpolated:
        return Held(interval=interval, interpolated=interpolated, even=False, changes=len(changes))
    return None


def _explained(changes: Places, interval: float) -> float:
    """Share of the changes that fall on the first sample at or after a reading, at the best phase."""
    phases = np.unique(np.mod(changes[:PHASES], interval))
    return float((np.mod(changes - phases[:, None] + 1e-6, interval) < 1.0).mean(axis=1).max())


def _rounded(steps: Array) -> bool:
    """Whether most changes are of one size, as those of a rounded signal are."""
    sizes = np.abs(steps[steps != 0])
    return bool(len(sizes)) and float(np.mean(sizes < ONE_SIZE * sizes.min())) > MOSTLY_ONE
