"""Measured batches cut into windows that are simulated side by side, each from a free initial state.

Data sampled much faster than the ship moves are averaged over several samples first, and so are the forces that drive
the simulation beside them: the mean of a linear motion is the motion that the mean force makes. Data sampled too
coarsely for an integrator get steps in between, with inputs held. Windows are as long as a batch unless the model is
unstable, so that slow disturbances show as what they are.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError
from expdesign.estimation.regression import inputs_of
from expdesign.records import central_difference
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import VesselModel

COARSEST_S, SHARE_OF_TIME_CONSTANT = 1.0, 0.4
LONGEST = 700
"""Samples per window, at most."""
FEWEST = 4
"""Samples per window, at least."""
SAME_TIME = 1e-6
"""Relative difference up to which sample times count as one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Windows:
    """Windows of equal shape; shorter ones are filled up and their measurements are nan there.

    Attributes:
        step_s: integrator step [s].
        steps_per_sample: integrator steps from one compared sample to the next.
        batch: (w,) batch number of each window.
        batch_inputs: one (k_b rows_per_step, m) array per batch, held inputs, as many rows in every integrator step.
        first: (w,) first integrator step of each window in its batch.
        measured: (w, s, 4) channels u, v, r, and the rate of the measured heading where r is a measurement of its own;
            nan where not measured.
        heading: (w, k) measured heading in the middle of integrator steps, continuous; zero where there is none.
        wind: (w, k, 2) likewise the wind in the b-frame from measured relative wind, the last one seen where a sample
            lacks it, nan in batches without.
        depth_m: (w, k), the last one seen where a sample lacks it, inf in batches without.
        time_s: (w, k) time since the first batch began, batches laid end to end.
        has_heading, has_wind, has_depth: whether these are measured.
        derived: those of u, v, r that come from the pose.
        names: of the batches.
        rows_per_step: samples of the data in an integrator step, where several are averaged.
    """

    step_s: float
    steps_per_sample: int
    batch: Array
    batch_inputs: tuple[Array, ...]
    first: Array
    measured: Array
    heading: Array
    wind: Array
    depth_m: Array
    time_s: Array
    has_heading: bool
    has_wind: bool
    has_depth: bool
    derived: tuple[str, ...]
    names: tuple[str, ...]
    rows_per_step: int = 1

    @property
    def sample_s(self) -> float:
        """Time between compared samples [s]."""
        return self.step_s * self.steps_per_sample

    @property
    def steps(self) -> int:
        """Integrator steps per window."""
        return int(self.heading.shape[1])

    @property
    def duration_s(self) -> float:
        """Time covered by all windows [s]."""
        return float(np.isfinite(self.measured).any(axis=2).sum() * self.sample_s)

    @cached_property
    def places(self) -> NDArray[np.int64]:
        """(w, k) integrator steps of each window in its batch, the last one repeated where the window is filled up."""
        ends = np.array([len(rows) // self.rows_per_step for rows in self.batch_inputs])[self.batch.astype(int)]
        return np.asarray(np.minimum(self.first[:, None] + np.arange(self.steps), ends[:, None] - 1).astype(int))

    @property
    def step_inputs(self) -> Array:
        """(w, k, m) held inputs, their mean over each step."""
        n = self.rows_per_step
        return self.gather(tuple(rows.reshape(len(rows) // n, n, -1).mean(axis=1) for rows in self.batch_inputs))

    def gather(self, batches: tuple[Array, ...]) -> Array:
        """(w, k, ...) rows of per-batch arrays at the steps of every window."""
        return np.stack([batches[int(b)][rows] for b, rows in zip(self.batch, self.places, strict=True)])

    def picked(self, keep: NDArray[np.bool_]) -> Windows:
        """Only some of the windows, by a mask (w,)."""
        parts = {name: getattr(self, name)[keep] for name in ROWS}
        others = {name: getattr(self, name) for name in self.__dataclass_fields__ if name not in ROWS}
        return Windows(**parts, **others)

    def shortened(self, samples: int) -> Windows:
        """The same data in windows of fewer samples, the last of each filled up."""
        s, between = self.measured.shape[1], self.steps_per_sample
        size = -(-s // -(-s // samples))
        parts: dict[str, list[Array]] = {name: [] for name in ROWS}
        for low in range(0, s, size):
            index = np.minimum(np.arange(low * between, (low + size) * between), self.steps - 1)
            rows = np.full((len(self.batch), size, self.measured.shape[2]), np.nan)
            rows[:, : min(size, s - low)] = self.measured[:, low : low + size]
            values = {"batch": self.batch, "first": self.first + low * between, "measured": rows}
            for name in ROWS:
                parts[name].append(values[name] if name in values else getattr(self, name)[:, index])
        joined: dict[str, Any] = {name: np.concatenate(items) for name, items in parts.items()}
        whole = replace(self, **joined)
        return whole.picked(np.isfinite(whole.measured[..., :3]).any(axis=2).sum(axis=1) >= FEWEST)


ROWS = ("batch", "first", "measured", "heading", "wind", "depth_m", "time_s")


def half_width(rows_per_step: int) -> int:
    """How many samples on either side of an instant of comparison are averaged with it."""
    return rows_per_step // 2


def fastest_rate(model: VesselModel, record: Record) -> float:
    """Largest linear damping rate of the model at the measured speeds [1/s].

    Speeds are means over `COARSEST_S`: differences of positions taken many times a second are noise, of any size.
    """
    speeds = np.abs(np.concatenate([_slowly(batch) for batch in record.batches]))
    seen = np.isfinite(speeds)
    base = np.where(seen, speeds, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    inputs = np.concatenate([inputs_of(model, batch) for batch in record.batches]).mean(axis=0)
    rates = []
    for axis in range(3):
        high, low = base.copy(), base.copy()
        high[axis] += 1e-4
        low[axis] -= 1e-4
        push = [np.array(model.accelerations(x, (x[0], x[1]), inputs), dtype=float) for x in (high, low)]
        rates.append(abs(float(push[0][axis] - push[1][axis])) / 2e-4)
    return max(*rates, 1e-6)


def _slowly(batch: Batch) -> Array:
    """(k, 3) velocities averaged over the samples of `COARSEST_S`; the batch as it is where it has no more."""
    count = int(COARSEST_S / batch.sample_time_s + 1e-9)
    whole = len(batch) // max(count, 1) * count
    if count <= 1 or not whole:
        return batch.velocity
    return np.asarray(batch.velocity[:whole].reshape(-1, count, 3).mean(axis=1))


def cut_windows(model: VesselModel, record: Record, *, longest_s: float | None = None) -> Windows:
    """Windows of a record for a model driven by its inputs (`estimation.tables.model_for`).

    Raises:
        InputError: batches of different sample times.
    """
    sample_s = _sample_time(record)
    step_s = min(COARSEST_S, SHARE_OF_TIME_CONSTANT / fastest_rate(model, record))
    merged = max(1, int(step_s / sample_s + 1e-9))
    between = max(1, int(np.ceil(merged * sample_s / step_s - 1e-9)))
    parts = [_Part(model, batch, merged, between) for batch in record.batches]
    limit = LONGEST if longest_s is None else max(12, round(longest_s / (merged * sample_s)))
    pieces = [(b, low, high) for b, part in enumerate(parts) for low, high in _cut(part.samples, limit)]
    size = max(high - low for _, low, high in pieces)
    derived = derived_outputs(record)
    starts = np.concatenate([[0.0], np.cumsum([len(batch) * sample_s for batch in record.batches])])
    rows: dict[str, list[Array]] = {name: [] for name in ROWS}
    for b, low, high in pieces:
        part = parts[b]
        index = np.minimum(np.arange(low * between, (low + size) * between), high * between - 1)
        rows["batch"].append(np.array(float(b)))
        rows["first"].append(np.array(float(low * between)))
        rows["measured"].append(_filled(part.measured(derived)[low:high], size))
        rows["heading"].append(part.heading[index])
        rows["wind"].append(part.wind[index])
        rows["depth_m"].append(part.depth[index])
        rows["time_s"].append(starts[b] + part.step_s * np.arange(low * between, (low + size) * between))
    return Windows(
        step_s=parts[0].step_s,
        steps_per_sample=between,
        batch_inputs=tuple(part.inputs for part in parts),
        has_heading=has_heading(record),
        has_wind=all(_air(batch) is not None for batch in record.batches),
        has_depth=all(_has_depth(batch) for batch in record.batches),
        derived=derived,
        names=tuple(batch.name for batch in record.batches),
        rows_per_step=merged,
        **{name: np.stack(values) for name, values in rows.items()},
    )


def _sample_time(record: Record) -> float:
    times = sorted({batch.sample_time_s for batch in record.batches})
    if times[-1] > (1 + SAME_TIME) * times[0]:
        found = ", ".join(f"{time:g} s" for time in times)
        raise InputError(f"the batches have different sample times, found {found}; a diagnosis takes one for all")
    return record.batches[0].sample_time_s


def _cut(samples: int, limit: int) -> list[tuple[int, int]]:
    count = -(-samples // limit)
    edges = np.linspace(0, samples, count + 1).round().astype(int).tolist()
    return [(low, high) for low, high in itertools.pairwise(edges) if high - low >= FEWEST]


def _filled(values: Array, size: int) -> Array:
    result = np.full((size, values.shape[1]), np.nan)
    result[: len(values)] = values
    return result


class _Part:
    """One batch on the grids of comparison and integration."""

    def __init__(self, model: VesselModel, batch: Batch, merged: int, between: int) -> None:
        self.batch, self.merged, self.between = batch, merged, between
        self.samples = (len(batch) - 1) // merged + 1
        self.step_s = batch.sample_time_s * merged / between
        raw = inputs_of(model, batch)
        self.inputs = np.repeat(self._whole(raw), between, axis=0)
        heading = np.zeros(len(batch)) if batch.pose is None else batch.pose[:, 2]
        if not np.isfinite(heading).all():
            heading = np.cumsum(np.nan_to_num(batch.velocity[:, 2])) * batch.sample_time_s
        self.heading = _middles(self._between(self._centred(heading)))
        wind = _air(batch)
        wind = np.full((len(batch), 2), np.nan) if wind is None else held_wind(wind, heading)
        self.wind = _middles(self._between(self._centred(wind)))
        self.depth = np.full(len(self.heading), np.inf)
        if batch.depth_m is not None and _has_depth(batch):
            depth = batch.depth_m[_last_seen(np.isfinite(batch.depth_m))]
            self.depth = self._between(self._centred(depth))

    def measured(self, derived: tuple[str, ...]) -> Array:
        """(s, 4) channels; the heading tells nothing more where the yaw rate is derived from it.

        What comes from the pose is compared as central differences, however it was smoothed: smoothing leaves an error
        whose colour no short filter undoes. Means over too few samples, at the ends, are left out.
        """
        velocity, rate = self.batch.velocity.copy(), np.full(len(self.batch), np.nan)
        if self.batch.pose is not None and len(self.batch) > 2:
            rates = central_difference(self.batch.pose, self.batch.sample_time_s)
            columns = [OUTPUTS.index(name) for name in derived]
            velocity[1:-1, columns] = rates[:, columns]
            rate[1:-1] = np.nan if "r" in derived else rates[:, 2]
        channels = self._centred(np.column_stack([velocity, rate]))
        middle = self.merged * np.arange(len(channels))
        half = half_width(self.merged)
        channels[(middle < half) | (middle >= len(self.batch) - half)] = np.nan
        return channels

    def _whole(self, values: Array) -> Array:
        """Held inputs to the end of the last step of comparison."""
        return np.concatenate([values, np.repeat(values[-1:], self.samples * self.merged - len(values), axis=0)])

    def _centred(self, values: Array) -> Array:
        """Values at the instants of comparison, averaged over the samples around them."""
        if self.merged == 1:
            return np.asarray(values, dtype=float)
        half = half_width(self.merged)
        padded = np.concatenate([np.repeat(values[:1], half, axis=0), values, np.repeat(values[-1:], half, axis=0)])
        total = np.cumsum(np.concatenate([np.zeros_like(padded[:1]), np.nan_to_num(padded, posinf=1e6)]), axis=0)
        width = 2 * half + 1
        mean = (total[width:] - total[:-width]) / width
        bad = ~np.isfinite(padded)
        seen = np.cumsum(np.concatenate([np.zeros_like(bad[:1]), bad]).astype(int), axis=0)
        mean[(seen[width:] - seen[:-width]) > 0] = np.nan
        exact = values.copy().astype(float)
        exact[half : len(values) - half] = mean[half : len(values) - half]  # ends keep their single samples
        return np.asarray(exact[:: self.merged][: self.samples])

    def _between(self, values: Array) -> Array:
        """Straight lines between the instants of comparison."""
        if self.between == 1:
            return values
        following = np.concatenate([values[1:], values[-1:]])
        share = (np.arange(self.between) / self.between).reshape(1, -1, *([1] * (values.ndim - 1)))
        with np.errstate(invalid="ignore"):
            mixed = values[:, None] * (1 - share) + following[:, None] * share
        mixed[:, 0] = values
        return np.asarray(mixed.reshape(-1, *values.shape[1:]))


def has_heading(record: Record) -> bool:
    """Whether every sample has a measured heading."""
    return all(batch.pose is not None and np.isfinite(batch.pose[:, 2]).all() for batch in record.batches)


def _has_depth(batch: Batch) -> bool:
    """Whether any depth is measured."""
    return batch.depth_m is not None and bool(np.isfinite(batch.depth_m).any())


def _air(batch: Batch) -> Array | None:
    """(k, 2) velocity of the air over ground in the b-frame, nan where it or the ship's is not measured; or None."""
    if batch.wind is None:
        return None
    air = batch.velocity[:, :2] - batch.wind
    return air if np.isfinite(air).all(axis=1).any() else None


def held_wind(air: Array, heading: Array) -> Array:
    """(k, 2) wind in the b-frame with the last one seen, in the n-frame, where it is not measured."""
    places = _last_seen(np.asarray(np.isfinite(air).all(axis=1)))
    turned = heading - heading[places]
    c, s, held = np.cos(turned), np.sin(turned), air[places]
    return np.stack([held[:, 0] * c + held[:, 1] * s, held[:, 1] * c - held[:, 0] * s], axis=-1)


def _last_seen(seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(k,) place of the last sample seen at every one; of the first seen before that."""
    places = np.maximum.accumulate(np.where(seen, np.arange(len(seen)), -1))
    return np.asarray(np.where(places < 0, np.argmax(seen), places))


def unseen_wind(record: Record) -> float:
    """Share of the samples at which wind that is measured otherwise is not."""
    airs = [air for batch in record.batches if (air := _air(batch)) is not None]
    seen = np.concatenate([np.isfinite(air).all(axis=1) for air in airs]) if airs else np.ones(1, dtype=bool)
    return float(1.0 - seen.mean())


def _middles(values: Array) -> Array:
    """Values in the middle of every step from those at its ends: what acts on average while inputs are held."""
    return np.concatenate([(values[:-1] + values[1:]) / 2, values[-1:]])


def derived_outputs(record: Record) -> tuple[str, ...]:
    """Those of u, v, r that come from the pose in every batch, as these say or as central differences show."""
    found = [{*batch.derived, *_differences(batch)} for batch in record.batches]
    return tuple(name for name in OUTPUTS if all(name in names for names in found))


def _differences(batch: Batch) -> tuple[str, ...]:
    """Velocities that agree with central differences of the pose far better than noise would let them."""
    if batch.pose is None or len(batch) < 8:
        return ()
    rates = central_difference(batch.pose, batch.sample_time_s)
    apart = np.median(np.abs(rates - batch.velocity[1:-1]), axis=0)
    jitter = np.median(np.abs(np.diff(rates, 2, axis=0)), axis=0)
    same = (apart < 1e-6 * (jitter + 1e-12)) | (apart < 1e-9)
    return tuple(name for name, found in zip(OUTPUTS, same.tolist(), strict=True) if found)
