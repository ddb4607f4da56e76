"""One measured batch on the comparison grid and the integration grid, with the channels that it measures."""

from __future__ import annotations

import numpy as np

from expdesign.conventions import OUTPUTS, rotated
from expdesign.estimation.regression import inputs_of
from expdesign.records import central_difference
from expdesign.signals import Batch, Record, last_seen
from expdesign.values import Array
from expdesign.vessel import VesselModel


def has_heading(record: Record) -> bool:
    """Whether every sample has a measured heading."""
    return all(batch.pose is not None and np.isfinite(batch.pose[:, 2]).all() for batch in record.batches)


def has_position(record: Record) -> bool:
    """Whether any batch has measured positions."""
    return any(batch.pose is not None and np.isfinite(batch.pose[:, :2]).any() for batch in record.batches)


def has_depth(batch: Batch) -> bool:
    """Whether any depth is measured."""
    return batch.depth_m is not None and bool(np.isfinite(batch.depth_m).any())


def has_wind(record: Record) -> bool:
    """Whether every batch has measured wind."""
    return all(air_velocity(batch) is not None for batch in record.batches)


def air_velocity(batch: Batch) -> Array | None:
    """(k, 2) velocity of the air over ground in the b-frame, nan where it or the ship's is not measured; or None."""
    if batch.wind is None:
        return None
    air = batch.velocity[:, :2] - batch.wind
    return air if np.isfinite(air).all(axis=1).any() else None


def missing_wind_share(record: Record) -> float:
    """Share of missing samples in runs that measure the wind."""
    airs = [air for batch in record.batches if (air := air_velocity(batch)) is not None]
    seen = np.concatenate([np.isfinite(air).all(axis=1) for air in airs]) if airs else np.ones(1, dtype=bool)
    return float(1.0 - seen.mean())


def derived_outputs(record: Record) -> tuple[str, ...]:
    """Those of u, v, r that come from the pose in every batch, as the batches state or as central differences show."""
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


def averaging_half_width(rows_per_step: int) -> int:
    """Number of samples averaged on either side of a comparison instant."""
    return rows_per_step // 2


class SampledBatch:
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
        self.heading = midpoints(self._between(self._centred(heading)))
        wind = air_velocity(batch)
        wind = np.full((len(batch), 2), np.nan) if wind is None else wind_held_over_gaps(wind, heading)
        self.wind = midpoints(self._between(self._centred(wind)))
        self.depth = np.full(len(self.heading), np.inf)
        if batch.depth_m is not None and has_depth(batch):
            depth = batch.depth_m[last_seen(np.isfinite(batch.depth_m))]
            self.depth = self._between(self._centred(depth))

    def measured(self, derived: tuple[str, ...]) -> Array:
        """(s, 4) channels; the heading adds no information where the yaw rate is derived from it.

        Velocities from the pose are compared as central differences, whatever their smoothing: a smoother leaves an
            error
        that no short filter whitens. Means over too few samples, at the ends, are left out.
        """
        velocity, rate = self.batch.velocity.copy(), np.full(len(self.batch), np.nan)
        if self.batch.pose is not None and len(self.batch) > 2:
            rates = central_difference(self.batch.pose, self.batch.sample_time_s)
            columns = [OUTPUTS.index(name) for name in derived]
            velocity[1:-1, columns] = rates[:, columns]
            rate[1:-1] = np.nan if "r" in derived else rates[:, 2]
        channels = self._centred(np.column_stack([velocity, rate]))
        middle = self.merged * np.arange(len(channels))
        half = averaging_half_width(self.merged)
        channels[(middle < half) | (middle >= len(self.batch) - half)] = np.nan
        return channels

    def _whole(self, values: Array) -> Array:
        """Held inputs to the end of the last step of comparison."""
        return np.concatenate([values, np.repeat(values[-1:], self.samples * self.merged - len(values), axis=0)])

    def _centred(self, values: Array) -> Array:
        """Values at the instants of comparison, averaged over the samples around them."""
        if self.merged == 1:
            return np.asarray(values, dtype=float)
        half = averaging_half_width(self.merged)
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
        """Linear interpolation between the comparison instants."""
        if self.between == 1:
            return values
        following = np.concatenate([values[1:], values[-1:]])
        share = (np.arange(self.between) / self.between).reshape(1, -1, *([1] * (values.ndim - 1)))
        with np.errstate(invalid="ignore"):
            mixed = values[:, None] * (1 - share) + following[:, None] * share
        mixed[:, 0] = values
        return np.asarray(mixed.reshape(-1, *values.shape[1:]))


def wind_held_over_gaps(air: Array, heading: Array) -> Array:
    """(k, 2) wind in the b-frame; gaps hold the last measured value in the n-frame."""
    held = last_seen(np.asarray(np.isfinite(air).all(axis=1)))
    return np.stack(rotated(air[held].T, heading[held] - heading), axis=-1)


def midpoints(values: Array) -> Array:
    """Values in the middle of every step, from those at its ends."""
    return np.concatenate([(values[:-1] + values[1:]) / 2, values[-1:]])
