"""Measured batches cut into windows that are simulated side by side, each from a free initial state.

Data sampled much faster than the ship moves are first averaged over several samples. The forces of the simulation are
averaged in the same way, because the mean of a linear motion is its response to the mean force. Data sampled too
coarsely for the integrator get steps in between, with inputs held. Windows are as long as a batch unless the model is
unstable, so that slow disturbances remain visible.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis.data.sampled_batch import (
    SampledBatch,
    derived_outputs,
    has_depth,
    has_heading,
    has_position,
    has_wind,
)
from expdesign.errors import InputError
from expdesign.estimation.regression import inputs_of
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import VesselModel

COARSEST_STEP_S = 1.0  # integrator step, at most [s]; faster data are averaged over it
STEP_SHARE = 0.4  # integrator step as a share of the ship's shortest time constant, at most
LONGEST_WINDOW = 700  # compared samples, at most
FEWEST_IN_WINDOW = 4  # compared samples, at least
SAME_TIME = 1e-6  # relative difference up to which sample times count as equal


@dataclass(frozen=True, kw_only=True, eq=False)
class Windows:
    """Windows of equal shape; shorter ones are padded, with nan as measurements."""

    step_s: float  # integrator step [s]
    steps_per_sample: int  # integrator steps from one compared sample to the next
    batch: Array  # (w,) batch number of each window
    # one (k_b rows_per_step, m) array per batch, held inputs, as many rows in every integrator step
    batch_inputs: tuple[Array, ...]
    first: Array  # (w,) first integrator step of each window in its batch
    # (w, s, 4) channels u, v, r, and the rate of the measured heading where r is a measurement of its own; nan where
    # not measured
    measured: Array
    heading: Array  # (w, k) measured heading in the middle of integrator steps, continuous; zero where there is none
    # (w, k, 2) likewise the wind in the b-frame from measured relative wind, the last measured one where a sample lacks
    # it, nan in batches without
    wind: Array
    depth_m: Array  # (w, k), the last measured one where a sample lacks it, inf in batches without
    time_s: Array  # (w, k) time since the first batch began, batches laid end to end
    # has_heading, has_wind, has_depth: whether these are measured
    has_heading: bool
    has_wind: bool
    has_depth: bool
    derived: tuple[str, ...]  # those of u, v, r that come from the pose
    names: tuple[str, ...]  # of the batches, those of one file "NAME, batch NUMBER"
    rows_per_step: int = 1  # samples of the data in an integrator step, where several are averaged
    has_position: bool = False  # whether any batch has positions
    # fits take what is left for white noise. In windows too short to tell slow noise or a random current from a steady
    # force, either would take the place of any slow effect.
    white_noise: bool = False
    # (batches,) where each begins on the clock of `time_s`; empty where nothing depends on it
    starts: tuple[float, ...] = ()

    @property
    def sample_s(self) -> float:
        """Time between compared samples [s]."""
        return self.step_s * self.steps_per_sample

    @property
    def shortest_period_s(self) -> float:
        """Period of the fastest oscillation that the compared samples show: two of them [s]."""
        return 2.0 * self.sample_s

    @property
    def steps(self) -> int:
        """Integrator steps per window."""
        return int(self.heading.shape[1])

    @property
    def duration_s(self) -> float:
        """Time covered by all windows [s]."""
        return float(np.isfinite(self.measured).any(axis=2).sum() * self.sample_s)

    @cached_property
    def step_numbers(self) -> NDArray[np.int64]:
        """(w, k) integrator steps of each window in its batch, the last one repeated in the padding."""
        ends = np.array([len(rows) // self.rows_per_step for rows in self.batch_inputs])[self.batch.astype(int)]
        return np.asarray(np.minimum(self.first[:, None] + np.arange(self.steps), ends[:, None] - 1).astype(int))

    @cached_property
    def run_starts(self) -> Array:
        """(batches,) where the run begins that each is of, on the clock of `time_s`: batches of one file are a run."""
        files = [name.partition(BATCH)[0] for name in self.names]
        first = [number for number, name in enumerate(files) if not number or name != files[number - 1]]
        begun = np.array(self.starts)[first]
        return np.asarray(begun[np.searchsorted(first, np.arange(len(files)), side="right") - 1])

    @property
    def run_time_s(self) -> Array:
        """(w, k) time since the run of each window began [s]: clocks of separate runs tell nothing of each other."""
        return self.time_s - self.run_starts[self.batch.astype(int)][:, None] if self.starts else self.time_s

    def place(self, time_s: float) -> tuple[str, float, float]:
        """Run at a time on the clock of `time_s`, where it begins and how long it is [s]."""
        begin = float(self.run_starts[max(int(np.searchsorted(self.starts, time_s, side="right")) - 1, 0)])
        batch = int(np.searchsorted(self.starts, begin))
        last = int(np.flatnonzero(self.run_starts == begin)[-1])
        rows = len(self.batch_inputs[last]) // self.rows_per_step
        return self.names[batch].partition(BATCH)[0], begin, self.starts[last] + rows * self.step_s - begin

    def share_after(self, time_s: float) -> Array:
        """(w, k) share of every step after a time, in the run that is under way then; all that begins after 0 s."""
        share = np.clip((self.time_s + self.step_s - time_s) / self.step_s, 0.0, 1.0)
        if not self.starts or time_s <= 0.0:
            return np.asarray(share)
        mine = self.run_starts[self.batch.astype(int)] == self.place(time_s)[1]
        return np.asarray(share * mine[:, None])

    @property
    def step_inputs(self) -> Array:
        """(w, k, m) held inputs, their mean over each step."""
        n = self.rows_per_step
        return self.gather(tuple(rows.reshape(len(rows) // n, n, -1).mean(axis=1) for rows in self.batch_inputs))

    def gather(self, batches: Sequence[Array] | Mapping[int, Array]) -> Array:
        """(w, k, ...) rows of per-batch arrays at the steps of every window; by number where only some are there."""
        return np.stack([batches[int(b)][rows] for b, rows in zip(self.batch, self.step_numbers, strict=True)])

    def selected(self, keep: NDArray[np.bool_]) -> Windows:
        """Only some of the windows, by a mask (w,)."""
        parts = {name: getattr(self, name)[keep] for name in ROWS}
        others = {name: getattr(self, name) for name in self.__dataclass_fields__ if name not in ROWS}
        return Windows(**parts, **others)

    def begun(self, samples: int) -> Windows:
        """The first samples of every window."""
        steps = samples * self.steps_per_sample
        parts = {name: getattr(self, name)[:, :steps] for name in ROWS if getattr(self, name).ndim > 1}
        return replace(self, **{**parts, "measured": self.measured[:, :samples]})

    def cut_shorter(self, samples: int) -> Windows:
        """The same data in windows of fewer samples, the last of each padded."""
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
        return whole.selected(np.isfinite(whole.measured[..., :3]).any(axis=2).sum(axis=1) >= FEWEST_IN_WINDOW)


BATCH = ", batch "
ROWS = ("batch", "first", "measured", "heading", "wind", "depth_m", "time_s")


def fastest_rate(model: VesselModel, record: Record) -> float:
    """Largest linear damping rate of the model at the measured speeds [1/s].

    Speeds are means over `COARSEST_STEP_S`, because differences of positions at a high rate are mostly noise.
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
    """(k, 3) velocities averaged over the samples of an integrator step, if there are several."""
    count = int(COARSEST_STEP_S / batch.sample_time_s + 1e-9)
    whole = len(batch) // max(count, 1) * count
    if count <= 1 or not whole:
        return batch.velocity
    return np.asarray(batch.velocity[:whole].reshape(-1, count, 3).mean(axis=1))


def cut_windows(
    model: VesselModel, record: Record, *, longest_s: float | None = None, step_s: float | None = None
) -> Windows:
    """Windows of a record for a model driven by its inputs (`estimation.tables.model_for`).

    Args:
        model: what is simulated.
        longest_s: of a window; None for the longest that there may be.
        step_s: of the integrator, that of other windows; None for what the model needs at the measured speeds.

    Raises:
        InputError: batches of different sample times.
    """
    sample_s = _sample_time(record)
    if step_s is None:
        step_s = min(COARSEST_STEP_S, STEP_SHARE / fastest_rate(model, record))
    merged = max(1, int(step_s / sample_s + 1e-9))
    between = max(1, int(np.ceil(merged * sample_s / step_s - 1e-9)))
    parts = [SampledBatch(model, batch, merged, between) for batch in record.batches]
    limit = LONGEST_WINDOW if longest_s is None else max(12, round(longest_s / (merged * sample_s)))
    pieces = [(b, low, high) for b, part in enumerate(parts) for low, high in _cut(part.samples, limit)]
    size = max(high - low for _, low, high in pieces)
    derived = derived_outputs(record)
    measured = [part.measured(derived) for part in parts]
    starts = np.concatenate([[0.0], np.cumsum([len(batch) * sample_s for batch in record.batches])])
    rows: dict[str, list[Array]] = {name: [] for name in ROWS}
    for b, low, high in pieces:
        part = parts[b]
        index = np.minimum(np.arange(low * between, (low + size) * between), high * between - 1)
        rows["batch"].append(np.array(float(b)))
        rows["first"].append(np.array(float(low * between)))
        rows["measured"].append(_filled(measured[b][low:high], size))
        rows["heading"].append(part.heading[index])
        rows["wind"].append(part.wind[index])
        rows["depth_m"].append(part.depth[index])
        rows["time_s"].append(starts[b] + part.step_s * np.arange(low * between, (low + size) * between))
    return Windows(
        step_s=parts[0].step_s,
        steps_per_sample=between,
        batch_inputs=tuple(part.inputs for part in parts),
        has_heading=has_heading(record),
        has_position=has_position(record),
        has_wind=has_wind(record),
        has_depth=all(has_depth(batch) for batch in record.batches),
        derived=derived,
        names=tuple(batch.name for batch in record.batches),
        starts=tuple(starts[:-1].tolist()),
        rows_per_step=merged,
        white_noise=False,
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
    return [(low, high) for low, high in itertools.pairwise(edges) if high - low >= FEWEST_IN_WINDOW]


def _filled(values: Array, size: int) -> Array:
    result = np.full((size, values.shape[1]), np.nan)
    result[: len(values)] = values
    return result
