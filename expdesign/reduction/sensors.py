"""Sensors undone: pose, velocity and wind at the ship's reference point and at the time of their sample.

Source: F. Ljungberg, doctoral thesis, Linköping University, (5.39)-(5.50), for wind sensors and the shrinkage of a
vane's components; T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2011), (2.28), for places.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS, rotated
from expdesign.records import central_difference, smoothed_velocity
from expdesign.signals import Batch
from expdesign.values import Array
from expdesign.vessel import Sensors

ON_TIME = 1e-6  # difference of two times, in samples, below which they count as equal
HELD_SHARE = 0.9  # share of changes of a signal that a stated interval must explain
PHASES = 50  # changes from which the time of the readings within an interval is searched for


# Readings of a sensor at the times at which they were taken, and the signal between them.
#
# A sample shows the last reading that has arrived. Reading n is taken at (phase + n) intervals and arrives `delay_s`
# later; the phase follows from the samples at which the signal changes. Without an interval every sample shows a
# reading of its own.
#
# Between readings the signal is the cubic through the four nearest ones. For a smooth signal x the error is at most
# 3/128 h**4 max|d4x/dt4|, h being the time between readings, and at a reading it is zero; in the first and last
# interval it is at most 1/24 of the same. A delay of whole samples is therefore undone exactly.
#
# Source: M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions (1964), 25.2.13 to 25.2.15 (Lagrange's
# four-point formula and its remainder).

NODES = np.arange(4.0)


@dataclass(frozen=True, eq=False)
class Readings:
    """What one sensor read."""

    first: float  # time of the first reading [samples of the batch]
    interval: float  # time between readings [samples]
    values: Array  # (m, c)

    @property
    def times(self) -> Array:
        """(m,) [samples]."""
        return np.asarray(self.first + self.interval * np.arange(len(self.values)))

    def at(self, times: Array) -> Array:
        """(k, c) the signal at other times (k,) [samples]; nan before the first and after the last reading."""
        place, count = (times - self.first) / self.interval, len(self.values)
        nearest = np.clip(np.round(place), 0, max(count - 1, 0)).astype(int)
        exact = np.abs(place - nearest) * self.interval < ON_TIME
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


def readings(values: Array, timing: tuple[float, float], *, sample_time_s: float) -> tuple[Readings, bool]:
    """The readings behind a measured signal, and whether it repeats them as stated.

    Args:
        values: (k, c) as measured, every reading repeated until the next arrives.
        timing: delay and interval of the sensor [s].
        sample_time_s: time between samples [s].

    Returns:
        Readings whose times are not before the batch begins. A signal that changes at other samples than its interval
        says counts as read at every sample, then the second is False.
    """
    delay, interval = (time_s / sample_time_s for time_s in timing)
    arrivals = _arrivals(values, delay, interval) if interval > 1.0 else None
    as_stated = interval <= 1.0 or arrivals is not None
    if arrivals is None:
        arrivals, interval = np.arange(len(values), dtype=float), 1.0
    arrivals = arrivals[arrivals - delay >= -ON_TIME]
    first = float(arrivals[0] - delay) if len(arrivals) else 0.0
    return Readings(first, interval, values[np.ceil(arrivals - ON_TIME).astype(int)]), as_stated


def _arrivals(values: Array, delay: float, interval: float) -> Array | None:
    """Times [samples] at which readings arrive, or None where the signal changes at other times."""
    count = len(values)
    step = np.diff(values, axis=0)
    changes = np.flatnonzero(np.any(np.isfinite(step) & (step != 0), axis=1)) + 1
    phases = (delay % interval, *np.unique(np.mod(changes[:PHASES], interval)).tolist())
    best = max(phases, key=lambda phase: int(_explained(changes, phase, interval).sum()))
    if _explained(changes, best, interval).sum() < HELD_SHARE * len(changes):
        return None
    arrivals = best + interval * np.arange(-1, int(count / interval) + 2)
    places = np.ceil(arrivals - ON_TIME)
    return np.asarray(arrivals[(places >= 0) & (places < count)])


def _explained(changes: NDArray[np.int64], phase: float, interval: float) -> NDArray[np.bool_]:
    """Which changes fall on the first sample at or after an arrival."""
    since = np.mod(changes - phase + ON_TIME, interval)
    return np.asarray(since < 1.0)


Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Stated:
    """A batch with what is stated of the sensors that measured it."""

    batch: Batch  # as measured
    sensors: Sensors  # as stated
    smoothed: bool  # whether velocities from the pose are smoothed, rather than central differences

    @property
    def grid(self) -> Array:
        """(k,) times of the samples [samples]."""
        return np.arange(len(self.batch), dtype=float)

    def readings(self, name: str, values: Array) -> tuple[Readings, bool]:
        """Those of one sensor; see `readings`."""
        return readings(values, self.sensors.timing(name), sample_time_s=self.batch.sample_time_s)

    def in_time(self, name: str, values: Array) -> tuple[Array, Mask]:
        """(k, c) readings at the samples' own times, and (k,) whether a sample is the nearest to a reading."""
        if not (any(self.sensors.timing(name)) and measured(values)):
            return values, np.ones(len(values), dtype=bool)
        found, _ = self.readings(name, values)
        return found.at(self.grid), found.shown(len(self.grid))


def undone(stated: Stated) -> Batch:
    """The batch of the reference point, of the same samples; nan where no reading shows a sample's own time."""
    batch = stated.batch
    pose = None if batch.pose is None else _pose(stated, batch.pose)
    velocity, read = _velocity(stated, pose)
    wind = None if batch.wind is None else _wind(stated, batch.wind, velocity, pose)
    interpolated = None if read.all() else 1.0 - read
    vane_std = stated.sensors.wind_angle_rad if stated.sensors.wind_sensor == "vane" else 0.0
    return replace(batch, pose=pose, velocity=velocity, wind=wind, interpolated=interpolated, vane_std_rad=vane_std)


def measured(values: Array) -> bool:
    """Whether any number is there."""
    return bool(np.isfinite(values).any())


def shrinkage(sensors: Sensors) -> float:
    """E cos(e) = exp(-variance / 2), by which Gaussian noise e on a vane's angle shrinks the wind's components."""
    return float(np.exp(-(sensors.wind_angle_rad**2) / 2.0)) if sensors.wind_sensor == "vane" else 1.0


def _pose(stated: Stated, pose: Array) -> Array:
    heading, _ = stated.in_time("heading", pose[:, 2:])
    position, _ = stated.in_time("position", pose[:, :2])
    psi, place = heading[:, 0] - stated.sensors.heading_bias_rad, stated.sensors.place("position")
    if any(place):
        position = position - turned(np.broadcast_to(place, position.shape), psi)
    return np.column_stack([position, psi])


def _velocity(stated: Stated, pose: Array | None) -> tuple[Array, Array]:
    """(k, 3) velocities over ground, and (k, 3) one where they are read and zero where they are interpolated."""
    batch, sensors = stated.batch, stated.sensors
    derived = _derived(stated, pose)
    r, r_read = stated.in_time("yaw_rate", batch.velocity[:, 2:])
    gain, offset = sensors.shown("r")
    r = (r - offset) / gain
    if "r" in batch.derived:
        r, r_read = derived[:, 2:], np.ones(len(batch), dtype=bool)
    uv, uv_read = stated.in_time("velocity", batch.velocity[:, :2])
    gains, offsets = np.transpose([sensors.shown("u"), sensors.shown("v")])
    uv = (uv - offsets) / gains
    if measured(uv[:, 0]) and measured(uv[:, 1]):
        uv = turned(uv, np.full(len(uv), sensors.velocity_angle_rad))
    place = sensors.place("velocity")
    uv = _at_centre(uv, place, r[:, 0])
    uv_read = uv_read & r_read if any(place) else uv_read
    velocity, read = np.column_stack([uv, r]), np.column_stack([uv_read, uv_read, r_read]).astype(float)
    for index, name in enumerate(OUTPUTS[:2]):
        if name in batch.derived:
            velocity[:, index], read[:, index] = derived[:, index], 1.0
    return velocity, read


def _derived(stated: Stated, pose: Array | None) -> Array:
    """(k, 3) velocities of the batch, derived from the pose again where that has changed and any came from it."""
    batch = stated.batch
    if not batch.derived or pose is None or np.array_equal(pose, batch.pose, equal_nan=True):  # type: ignore[arg-type]
        return batch.velocity
    seen = np.flatnonzero(np.isfinite(pose if "u" in batch.derived else pose[:, 2:]).all(axis=1))
    result = np.full_like(batch.velocity, np.nan)
    if len(seen) < 4:
        return result
    part, noise = slice(int(seen[0]), int(seen[-1]) + 1), stated.sensors.heading_rad
    if stated.smoothed:
        result[part] = smoothed_velocity(pose[part], batch.sample_time_s, heading_std_rad=noise or None)
    else:
        inside = slice(part.start + 1, part.stop - 1)
        result[inside] = central_difference(pose[part], batch.sample_time_s, heading_std_rad=noise)
    return result


def _wind(stated: Stated, wind: Array, velocity: Array, pose: Array | None) -> Array:
    """Relative wind; between readings the air's velocity over ground is interpolated, which turns less than the ship.

    Where no heading is measured, the relative wind is.
    """
    place, axis, wind = stated.sensors.place("wind"), stated.sensors.wind_axis_rad, wind / shrinkage(stated.sensors)
    wind = turned(wind, np.full(len(wind), axis)) if axis else wind
    if not any(stated.sensors.timing("wind")) or pose is None or not measured(pose[:, 2]):
        return _at_centre(stated.in_time("wind", wind)[0], place, velocity[:, 2])
    found, _ = stated.readings("wind", wind)
    then = Readings(0.0, 1.0, np.column_stack([velocity, pose[:, 2]])).at(found.times)
    relative = _at_centre(found.values, place, then[:, 2])
    air = Readings(found.first, found.interval, turned(then[:, :2] - relative, then[:, 3])).at(stated.grid)
    return np.asarray(velocity[:, :2] - turned(air, -pose[:, 2]))


def _at_centre(uv: Array, place: tuple[float, float], r: Array) -> Array:
    """Velocities (k, 2) of the reference point, from those of a place; the same where no yaw rate is measured."""
    if not (any(place) and measured(r)):
        return uv
    forward, starboard = place
    return np.stack([uv[:, 0] + r * starboard, uv[:, 1] - r * forward], axis=-1)


def turned(vectors: Array, angle: Array) -> Array:
    """(k, 2) turned clockwise by angles (k,): from the b-frame to the n-frame for headings."""
    return np.stack(rotated(vectors.T, angle), axis=-1)
