"""Measured batches as one CSV file of the kind that `records.load_records` reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.signals import AUXILIARY, Batch
from expdesign.values import Array
from expdesign.vessel import column_name

GAP_SAMPLES = 10
"""Gap between the times of two batches, in samples."""


def record_csv(batches: Sequence[Batch]) -> str:
    """Batches as one file of measured data, numbered in the column `batch`, without signals that are not measured."""
    tables = [_columns(batch) for batch in batches]
    kept = [name for name in tables[0] if all(name in table and np.isfinite(table[name]).all() for table in tables)]
    lines, begin = [",".join(["time_s", "batch", *kept])], 0
    for number, (batch, table) in enumerate(zip(batches, tables, strict=True), start=1):
        time_s = (begin + np.arange(len(batch))) * batch.sample_time_s
        begin += len(batch) + GAP_SAMPLES
        rows = zip(time_s.tolist(), *(table[name].tolist() for name in kept), strict=True)
        lines += [f"{row[0]:.10g},{number}," + ",".join(f"{value:.10g}" for value in row[1:]) for row in rows]
    return "\n".join(lines) + "\n"


def _columns(batch: Batch) -> dict[str, Array]:
    parts = [
        (("u_mps", "v_mps", "r_radps"), batch.velocity),
        (("north_m", "east_m", "heading_rad"), batch.pose),
        (tuple(map(column_name, batch.input_names)), batch.inputs),
        (("wind_u_mps", "wind_v_mps"), batch.wind),
        (("steered",), None if batch.steered is None else batch.steered[:, None]),
        (tuple(f"planned_{column_name(name)}" for name in batch.input_names), batch.planned),
        (AUXILIARY, batch.auxiliary),
        (("depth_m",), None if batch.depth_m is None else batch.depth_m[:, None]),
    ]
    columns = {
        name: column
        for names, values in parts
        if values is not None
        for name, column in zip(names, values.T, strict=False)
    }
    if "heading_rad" in columns:
        columns["heading_rad"] = wrap_angle(columns["heading_rad"])
    return columns
