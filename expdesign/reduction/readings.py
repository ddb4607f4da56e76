"""Readings of a sensor at the times at which they were taken, and the signal between them.

A sample shows the last reading that has arrived. Reading n is taken at (phase + n) intervals and arrives `delay_s`
later; the phase follows from the samples at which the signal changes. Without an interval every sample shows a reading
of its own.

Between readings the signal is the cubic through the four nearest ones. For a smooth signal x the error is at most
3/128 h**4 max|d4x/dt4|, h being the time between readings, and at a reading it is zero; in the first and last interval
it is at most 1/24 of the same. A delay of whole samples is therefore undone exactly.

Source: M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions (1964), 25.2.13 to 25.2.15 (Lagrange's
four-point formula and its remainder).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.reduction.tuning import TUNING
from expdesign.values import Array
from expdesign.vessel import Mounting

NODES = np.arange(4.0)


@dataclass(frozen=True, eq=False)
class Readings:
    """What one sensor read.

    Attributes:
        first: time of the first reading [samples of the batch].
        interval: time between readings [samples].
        values: (m, c).
    """

    first: float
    interval: float
    values: Array

    @property
    def times(self) -> Array:
        """(m,) [samples]."""
        return np.asarray(self.first + self.interval * np.arange(len(self.values)))

    def at(self, times: Array) -> Array:
        """(k, c) the signal at other times (k,) [samples]; nan before the first and after the last reading."""
        place, count = (times - self.first) / self.interval, len(self.values)
        nearest = np.clip(np.round(place), 0, max(count - 1, 0)).astype(int)
        exact = np.abs(place - nearest) * self.interval < TUNING.on_time
        result = np.full((len(times), self.values.shape[1]), np.nan)
        if not count:
            return result
        inside = (place > 0) & (place < count - 1) & ~exact
        result[exact] = self.values[nearest[exact]]
        if count >= len(NODES):
            result[inside] = self._cubic(place[inside])
        return result

    def _cubic(self, place: Array) -> Array:
        """Lagrange's polynomial through the four readings around each place, counted in readings."""
        low = np.clip(np.floor(place).astype(int) - 1, 0, len(self.values) - len(NODES))
        share = place - low
        total = np.zeros((len(place), self.values.shape[1]))
        for node in NODES:
            others = NODES[node != NODES]
            weight = np.prod((share[:, None] - others) / (node - others), axis=1)
            total += weight[:, None] * self.values[low + int(node)]
        return total

    def shown(self, count: int) -> NDArray[np.bool_]:
        """(count,) the samples of the batch that are nearest to a reading; all where readings are as frequent."""
        samples = np.round(self.times).astype(int)
        mask = np.zeros(count, dtype=bool)
        mask[samples[(samples >= 0) & (samples < count)]] = True
        return mask


def readings(values: Array, mounting: Mounting, *, sample_time_s: float) -> tuple[Readings, bool]:
    """The readings behind a measured signal, and whether it repeats them as stated.

    Args:
        values: (k, c) as measured, every reading repeated until the next arrives.
        mounting: delay and interval of the sensor.
        sample_time_s: time between samples [s].

    Returns:
        Readings whose times are not before the batch begins. A signal that changes at other samples than its interval
        says counts as read at every sample, then the second is False.
    """
    delay, interval = mounting.delay_s / sample_time_s, mounting.interval_s / sample_time_s
    arrivals = _arrivals(values, delay, interval) if interval > 1.0 else None
    as_stated = interval <= 1.0 or arrivals is not None
    if arrivals is None:
        arrivals, interval = np.arange(len(values), dtype=float), 1.0
    arrivals = arrivals[arrivals - delay >= -TUNING.on_time]
    first = float(arrivals[0] - delay) if len(arrivals) else 0.0
    return Readings(first, interval, values[np.ceil(arrivals - TUNING.on_time).astype(int)]), as_stated


def _arrivals(values: Array, delay: float, interval: float) -> Array | None:
    """Times [samples] at which readings arrive, or None where the signal changes at other times."""
    count = len(values)
    step = np.diff(values, axis=0)
    changes = np.flatnonzero(np.any(np.isfinite(step) & (step != 0), axis=1)) + 1
    best, most = delay % interval, -1
    for phase in (delay % interval, *np.unique(np.mod(changes[: TUNING.phases], interval))):
        matched = int(_explained(changes, phase, interval).sum())
        if matched > most:
            best, most = float(phase), matched
    if most < TUNING.held_share * len(changes):
        return None
    arrivals = best + interval * np.arange(-1, int(count / interval) + 2)
    places = np.ceil(arrivals - TUNING.on_time)
    return np.asarray(arrivals[(places >= 0) & (places < count)])


def _explained(changes: NDArray[np.int64], phase: float, interval: float) -> NDArray[np.bool_]:
    """Which changes fall on the first sample at or after an arrival."""
    since = np.mod(changes - phase + TUNING.on_time, interval)
    return np.asarray(since < 1.0)
