"""Channels that a record measures, and velocities derived from its pose."""

from __future__ import annotations

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.records import central_difference
from expdesign.signals import Batch, Record
from expdesign.values import Array


def has_heading(record: Record) -> bool:
    """Whether every sample has a measured heading."""
    return all(batch.pose is not None and np.isfinite(batch.pose[:, 2]).all() for batch in record.batches)


def has_position(record: Record) -> bool:
    """Whether any batch has measured positions."""
    return any(batch.pose is not None and np.isfinite(batch.pose[:, :2]).any() for batch in record.batches)


def has_depth(batch: Batch) -> bool:
    """Whether any depth is measured."""
    return batch.depth_m is not None and bool(np.isfinite(batch.depth_m).any())


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
