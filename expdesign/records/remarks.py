"""What is not wrong but worth knowing: dead sensors, inputs that never move, held positions, a ship going sideways."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from expdesign.records.file import Table, is_input
from expdesign.records.pose import MEASURED
from expdesign.signals import Batch

HELD = 0.5
"""Share of rows that repeat the position of a moving ship from which it counts as held."""
SIDEWAYS = 2.0
UNTOLD = ("time_s", "batch", "depth_m", "lat_deg", "lon_deg")


def table_remarks(table: Table) -> Iterator[str]:
    """Remarks on the columns of a file."""
    for name, values in table.columns.items():
        if name in UNTOLD or np.ptp(values) > 0:
            continue
        what = "so its effect cannot be estimated" if is_input(name) else "a dead sensor?"
        yield f"{table.sources[name].header} is {table.value(name, 0)} in all rows, {what}"
    if "north_m" in table.columns:
        still = np.all(np.diff(table.stack("north_m", "east_m"), axis=0) == 0, axis=1)
        if HELD < np.mean(still) < 1:
            yield f"the position repeats in {np.mean(still):.0%} of the rows: differences of held values are inaccurate"


def motion_remarks(batches: list[Batch], origins: Mapping[str, str]) -> Iterator[str]:
    """Remarks on velocities that come from the pose of one file."""
    if any(origins.get(output, MEASURED) == MEASURED for output in ("u", "v")):
        return
    u, v = np.sqrt(np.mean(np.vstack([batch.velocity[:, :2] for batch in batches]) ** 2, axis=0))
    if v > SIDEWAYS * u:
        found = f"the ship moves sideways at {v:.3g} m/s and ahead at {u:.3g} m/s, root mean square"
        yield f"{found}: are the axes of the pose what their names say?"
