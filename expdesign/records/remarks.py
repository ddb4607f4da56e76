"""Remarks on suspicious data: dead sensors, constant inputs, held positions, sideways motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from expdesign.records.file import Table, is_input
from expdesign.records.pose import MEASURED
from expdesign.records.tuning import TUNING
from expdesign.signals import Batch

UNCHECKED = ("time_s", "batch", "depth_m", "lat_deg", "lon_deg")


def table_remarks(table: Table) -> Iterator[str]:
    """Remarks on the columns of a file."""
    for name, values in table.columns.items():
        if name in UNCHECKED or np.ptp(values) > 0:
            continue
        what = "so its effect cannot be estimated" if is_input(name) else "a dead sensor?"
        yield f"{table.sources[name].header} is {table.value(name, 0)} in all rows, {what}"
    if "north_m" in table.columns:
        still = np.all(np.diff(table.stack("north_m", "east_m"), axis=0) == 0, axis=1)
        if TUNING.held_share < np.mean(still) < 1:
            yield f"the position repeats in {np.mean(still):.0%} of the rows: differences of held values are inaccurate"


def motion_remarks(batches: list[Batch], origins: Mapping[str, str]) -> Iterator[str]:
    """Remarks on velocities that come from the pose of one file."""
    if any(origins.get(output, MEASURED) == MEASURED for output in ("u", "v")):
        return
    u, v = np.sqrt(np.mean(np.vstack([batch.velocity[:, :2] for batch in batches]) ** 2, axis=0))
    if v > TUNING.sideways_ratio * u:
        found = f"the ship moves sideways at {v:.3g} m/s and ahead at {u:.3g} m/s, root mean square"
        yield f"{found}: are the axes of the pose what their names say?"
