"""Data faster than the motion, averaged: velocities over blocks of samples, inputs as they drive these means.

The mean of a linear motion over a block is its response to the mean input: with blocks of m samples,

    mean of x over block j + 1  -  mean of x over block j  =  1/m  sum over i, s < m of  dx(j m + i + s)

so inputs of a step are means over blocks of means over m samples. White noise of the sensors shrinks by the root of m,
and hardly anything is lost, as long as a block is short beside the ship's own times. These scale with the time in which
she sails, or turns through, her length.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from expdesign.signals import Batch, Delivered, Record
from expdesign.values import Array

SHORTEST_BATCH = 4  # samples that a batch must keep

LONGEST_MEAN_S = 1.0  # over which samples are averaged, at most [s]
# of the time in which the ship sails, or turns through, her length, over which they are, at most. Her own times are a
# third of it and more
MEAN_SHARE = 0.1


def averaged(record: Record, count: int) -> Record:
    """The record with so many samples averaged to one; the record itself for 1.

    Batches of fewer than `SHORTEST_BATCH` means are left out, unless all are so short.

    Args:
        record: reduced, with inputs as delivered.
        count: of `samples_of_a_mean`.
    """
    long = [batch for batch in record.batches if len(batch) >= count * SHORTEST_BATCH]
    return record if count < 2 or not long else replace(record, batches=tuple(_averaged(b, count) for b in long))


def samples_of_a_mean(record: Record, length_m: float) -> int:
    """Number of samples to average to one, as the motion of a ship of this length [m] allows."""
    if len({batch.sample_time_s for batch in record.batches}) != 1:
        return 1
    sample_s = record.batches[0].sample_time_s
    slow = max(1, int(LONGEST_MEAN_S / sample_s + 1e-9))
    rows = np.concatenate([_block_means(batch.velocity, slow) for batch in record.batches])
    rows = rows[np.isfinite(rows).all(axis=1)]
    if not len(rows):
        return 1
    u, v, r = np.sqrt(np.mean(rows**2, axis=0)).tolist()
    speed = float(np.hypot(np.hypot(u, v), length_m * r))
    mean_s = min(LONGEST_MEAN_S, MEAN_SHARE * length_m / max(speed, 1e-9))
    return max(1, int(mean_s / sample_s + 1e-9))


def _averaged(batch: Batch, count: int) -> Batch:
    velocity = batch.velocity
    if batch.interpolated is not None:
        velocity = np.where(batch.interpolated > 0, np.nan, velocity)
    optional = {name: getattr(batch, name) for name in ("pose", "wind", "depth_m", "steered", "planned")}
    means: dict[str, Any] = {name: _block_means(rows, count) for name, rows in optional.items() if rows is not None}
    if "steered" in means:
        means["steered"] = np.ceil(means["steered"])
    return replace(
        batch,
        sample_time_s=count * batch.sample_time_s,
        velocity=_block_means(velocity, count),
        inputs=_driving(batch.inputs, count),
        delivered=None if batch.delivered is None else _delivered(batch.delivered, count),
        interpolated=None,
        auxiliary=None,
        **means,
    )


def _delivered(steps: Delivered, count: int) -> Delivered | None:
    """What drives the means, in one part a step; None where nothing about it is uncertain."""
    if not steps.times:
        return None
    by_time = np.einsum("ksmu,s->kmu", steps.values_by_time, steps.shares)
    by_time += np.einsum("ksm,su->kmu", steps.values, steps.shares_by_time)
    return Delivered(
        values=_driving(steps.mean, count)[:, None],
        shares=np.ones(1),
        times=steps.times,
        values_by_time=_driving(by_time, count)[:, None],
        shares_by_time=np.zeros((1, len(steps.times))),
    )


def _driving(rows: Array, count: int) -> Array:
    """(k / count, ...) means over blocks of the means over so many rows; the last row lasts."""
    wide = np.concatenate([rows, np.repeat(rows[-1:], count - 1, axis=0)])
    sums = np.cumsum(np.concatenate([np.zeros_like(wide[:1]), wide]), axis=0)
    return _block_means((sums[count:] - sums[:-count]) / count, count)


def _block_means(rows: Array, count: int) -> Array:
    """(k / count, ...) means of whole blocks; nan where less than half of one is a number."""
    blocks = rows[: len(rows) // count * count].reshape(-1, count, *rows.shape[1:])
    seen = np.isfinite(blocks)
    number = seen.sum(axis=1)
    means = np.where(seen, blocks, 0.0).sum(axis=1) / np.maximum(number, 1)
    return np.asarray(np.where(2 * number >= count, means, np.nan))
