"""The least-squares problem of output error: data and inputs, cut into stretches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError
from expdesign.estimation.regression import STEADY_CURRENT, Integers, Layout, drive_of, heading_of, parts_of
from expdesign.estimation.replay import Compiled, Integration, Stretches, compiled
from expdesign.signals import Batch, Record, last_seen
from expdesign.values import Array
from expdesign.vessel import Sensors

MOST_FIRST_WEIGHT = 1e4  # weight of the first sample of a stretch, to that of another, at most


@dataclass(frozen=True, kw_only=True)
class ActuatorTime:
    """What is known beforehand of a dead time or a lag."""

    name: str  # as in `vessel.std_keys`
    change_s: float  # expected value less the one that the data are delivered with [s]
    std_s: float  # standard deviation [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Begun:
    """Where a search goes on."""

    values: Mapping[str, float]  # of parameters; others begin where the regression has them
    horizon_s: float | None  # with which they were found [s]; shorter ones are not searched again. None for whole runs.


@dataclass(frozen=True, kw_only=True)
class Fitting:
    """How simulations are compared with the data."""

    integration: Integration  # how the model is simulated
    horizon_s: float | None = None  # length of a stretch [s], None for whole runs
    constant: bool = False  # whether each run has a constant acceleration of its own
    current: bool = False  # whether a steady current is estimated too, one for all runs
    times: tuple[ActuatorTime, ...] = ()  # dead times and lags that are estimated too
    # whose stated noise the first velocities may differ from the measured ones by
    sensors: Sensors = field(default_factory=Sensors)
    begun: Begun | None = None  # where the search goes on; None to begin with least squares
    quick: bool = False  # whether the covariance may be one that takes no time

    @property
    def unexpected(self) -> int:
        """Number of values beside the parameters of which nothing is known beforehand."""
        return len(STEADY_CURRENT) if self.current else 0

    def __post_init__(self) -> None:
        if self.horizon_s is not None and not 0 < self.horizon_s < np.inf:
            raise InputError(f"horizon is {self.horizon_s:g} s, expected more than 0")


Place = tuple[int, float]
"""Number of the run, and time since its start [s], at which a stretch begins."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Least squares over W stretches of L samples."""

    compiled: Compiled  # the stretches, ready to be simulated
    measured: Array  # (L, W, n), nan where missing or filled up
    weights: Array  # (n,) one over the variance of each output
    sensed: Array  # (n,) variance of the sensors' noise, in units of the cost
    batch: Integers  # (W,) number of the run
    first: Integers  # (W,) sample of the run at which each stretch begins
    constant: bool  # whether constants are estimated
    expected: Array  # (p,) values known beforehand; of parameters and a current, which count as unknown, zero
    precision: Array  # (p,) what the cost adds for squared differences from these; of those zero
    spread: Array  # (p,) standard deviations of these; of those zero

    @property
    def parameters(self) -> int:
        """Number p of estimated parameters, of a current, and times, without constants."""
        return self.compiled.stretches.values

    @property
    def beyond(self) -> int:
        """Number of times among these, the last ones."""
        return len(self.compiled.stretches.times)

    @cached_property
    def weight(self) -> Array:
        """(L, W, n) weight of each measurement, zero where there is none.

        First samples weigh by the sensors' noise: a simulation that may begin anywhere makes up for a wrong model so.
        """
        rows = np.broadcast_to(self.weights, self.measured.shape).copy()
        rows[0] = np.clip(1.0 / np.maximum(self.sensed, 1e-300), self.weights, MOST_FIRST_WEIGHT * self.weights)
        return np.where(np.isfinite(self.measured), rows, 0.0)

    def departure(self, values: Array) -> Array:
        """(p,) values less those known beforehand."""
        return np.asarray(values[: self.parameters] - self.expected)

    @property
    def places(self) -> list[Place]:
        """Where the stretches begin."""
        times = self.first * self.compiled.stretches.sample_time_s
        return list(zip(self.batch.tolist(), np.round(times, 9).tolist(), strict=True))

    def local(self, values: Array) -> Array:
        """(W, p + n) the values that act on each stretch."""
        p, n = self.parameters, self.measured.shape[2]
        own = values[p:].reshape(-1, n)[self.batch]
        return np.concatenate([np.broadcast_to(values[:p], (len(own), p)), own], axis=1)

    def states(self, values: Array, starts: Array) -> Array:
        """(L, W, n) simulated; not finite where a simulation diverges."""
        return self.compiled.states(self.local(values), starts)

    def residuals(self, states: Array) -> Array:
        """(L, W, n) measured minus simulated, zero where data are missing."""
        return np.where(np.isfinite(self.measured), self.measured - states, 0.0)


def sample_time(record: Record) -> float:
    """The sample time of all batches [s].

    Raises:
        InputError: it differs between batches.
    """
    times = {batch.sample_time_s for batch in record.batches}
    if len(times) > 1:
        raise InputError(f"output error needs one sample time, found {', '.join(f'{t:g} s' for t in sorted(times))}")
    return times.pop()


@dataclass(frozen=True, kw_only=True)
class Excerpt:
    """What of the data is compared."""

    samples: int  # of a stretch, as they are compared
    every: int = 1  # compares every so manieth sample, with the mean inputs until the next
    most: float = np.inf  # samples in all, or some more; the stretches between are left out
    # stretches that are left out too, by number of the run and first compared sample
    without: frozenset[tuple[int, int]] = frozenset()

    @property
    def length(self) -> int:
        """Samples of the data from end to end of a stretch."""
        return self.samples * self.every


def build_problem(layout: Layout, record: Record, fitting: Fitting, excerpt: Excerpt, weights: Array) -> Problem:
    """The problem of an excerpt with output weights (n,)."""
    model, time_s, samples = layout.model, excerpt.every * sample_time(record), excerpt.samples
    states = tuple(OUTPUTS.index(name) for name in model.outputs)
    read = [_read(batch)[:: excerpt.every, states] for batch in record.batches]
    drives = [_means(_drive(layout, batch, fitting), excerpt.every) for batch in record.batches]
    cuts = [(number, first) for number, rows in enumerate(read) for first in _firsts(len(rows), samples)]
    cuts = [cut for cut in cuts[:: max(1, int(sum(map(len, read)) / excerpt.most))] if cut not in excerpt.without]
    ends = [_end(first, samples, len(read[number])) for number, first in cuts]
    length = max(end - first for (_, first), end in zip(cuts, ends, strict=True))
    unknown = [0.0] * (len(layout.parameters) + fitting.unexpected)

    def stacked(rows: list[Array], fill: bool) -> Array:
        parts = [rows[number][first:end] for (number, first), end in zip(cuts, ends, strict=True)]
        tails = [np.repeat(part[-1:] if fill else part[-1:] * np.nan, length - len(part), axis=0) for part in parts]
        return np.stack([np.concatenate(pair) for pair in zip(parts, tails, strict=True)], axis=1)

    return Problem(
        compiled=compiled(
            Stretches(
                model=model.with_parameters(dict.fromkeys(layout.merged, 0.0)),
                sought=tuple(model.names.index(name) for name in layout.parameters),
                states=states,
                drive=stacked(drives, fill=True),
                windy=layout.predictor.wind,
                sample_time_s=time_s,
                integrator=fitting.integration.integrator,
                substeps=fitting.integration.substeps,
                parts=parts_of(record.batches[0], substeps=fitting.integration.substeps),
                flowing=fitting.current,
                times=tuple(time.name for time in fitting.times),
                counts=np.array([end - first for (_, first), end in zip(cuts, ends, strict=True)]),
            )
        ),
        measured=stacked(read, fill=False),
        weights=weights,
        sensed=sensor_variance(record, fitting.sensors)[list(states)],
        batch=np.array([number for number, _ in cuts]),
        first=np.array([first for _, first in cuts]),
        constant=fitting.constant,
        expected=np.array([*unknown, *(time.change_s for time in fitting.times)]),
        precision=np.array([*unknown, *(time.std_s**-2 for time in fitting.times)]),
        spread=np.array([*unknown, *(time.std_s for time in fitting.times)]),
    )


def sensor_variance(record: Record, sensors: Sensors) -> Array:
    """(3,) variance of the sensors' noise on u, v, r: as stated, or that of third differences where this is larger.

    Third differences of white noise have 20 times its variance, and hardly anything of a slow motion. Infinite where
    velocities are smoothed, whose noise differences do not show.
    """
    if any(batch.smoothed for batch in record.batches):
        return np.full(len(OUTPUTS), np.inf)
    differences = np.concatenate([np.diff(_read(batch), 3, axis=0) for batch in record.batches])
    seen = np.isfinite(differences)
    found = np.where(seen, differences, 0.0) ** 2 / 20.0
    variance = found.sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    stated = np.array([sensors.velocity_mps, sensors.velocity_mps, sensors.yaw_rate_radps]) ** 2
    return np.where(seen.any(axis=0), np.maximum(variance, stated), np.inf)


def _means(rows: Array, every: int) -> Array:
    """(k / every, c) means of so many rows (k, c)."""
    firsts = np.arange(0, len(rows), every)
    return np.asarray(np.add.reduceat(rows, firsts) / np.diff(np.append(firsts, len(rows)))[:, None])


def _firsts(count: int, samples: int) -> range:
    """First samples of the stretches; the last stretch takes the remainder."""
    return range(0, max(1, count - samples // 2), samples)


def _end(first: int, samples: int, count: int) -> int:
    """End of a stretch: no remainder shorter than half a stretch is left."""
    return count if first + samples + (samples + 1) // 2 > count else first + samples


def _read(batch: Batch) -> Array:
    """(k, 3) velocities, nan where they are interpolated between readings."""
    return batch.velocity if batch.interpolated is None else np.where(batch.interpolated > 0, np.nan, batch.velocity)


def _drive(layout: Layout, batch: Batch, fitting: Fitting) -> Array:
    """(k, c) the drive of `Stretches`; missing wind takes the last known value."""
    names = tuple(time.name for time in fitting.times)
    inputs = drive_of(layout.model, batch, substeps=fitting.integration.substeps, times=names)
    if not np.isfinite(inputs).all():
        raise InputError(f"{batch.name}: output error needs inputs at every sample; some are not numbers")
    columns = [inputs]
    if layout.predictor.wind:
        columns.append(_wind(batch))
    if fitting.current:
        columns.append(_courses(batch, fitting.integration.integrator))
    return np.hstack(columns)


def _courses(batch: Batch, integrator: str) -> Array:
    """(k, 2) cosine and sine of the heading: in the middle of each sample, for Euler's map where it begins."""
    heading = np.unwrap(heading_of(batch))
    if not np.isfinite(heading).all():
        raise InputError(f"{batch.name}: output error with a current needs a heading at every sample")
    if integrator != "euler":
        heading = (heading + np.append(heading[1:], heading[-1:])) / 2.0
    return np.stack([np.cos(heading), np.sin(heading)], axis=1)


def _wind(batch: Batch) -> Array:
    """(k, 2) the wind's velocity in the b-frame."""
    assert batch.wind is not None  # the regression was built from it
    wind = batch.velocity[:, :2] - batch.wind
    seen = np.asarray(np.isfinite(wind).all(axis=1))
    if not seen.any():
        raise InputError(f"{batch.name}: no sample has velocity and relative wind")
    return np.asarray(wind[last_seen(seen)])


def first_states(problem: Problem, found: Mapping[Place, Array]) -> Array:
    """(W, n) first velocities for a first guess: those found before at the same places, else the first measured."""
    seen = np.isfinite(problem.measured)
    first = np.take_along_axis(problem.measured, np.argmax(seen, axis=0)[None], axis=0)[0]
    guess = np.where(seen.any(axis=0), first, 0.0)
    return np.stack([found.get(place, own) for place, own in zip(problem.places, guess, strict=True)])
