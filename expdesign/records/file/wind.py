"""Relative wind in the b-frame, from a Cartesian anemometer or a vane."""

from __future__ import annotations

import numpy as np

from expdesign.records.file.table import Table
from expdesign.records.tuning import TUNING
from expdesign.values import Array

CARTESIAN = ("wind_u_mps", "wind_v_mps")
VANE = ("wind_speed_mps", "wind_angle_rad")


def relative_wind(table: Table) -> Array | None:
    """(k, 2) u_q, v_q [m/s], the ship's velocity through the air, or None when not measured; Cartesian goes first."""
    if CARTESIAN[0] in table.columns:
        return table.stack(*CARTESIAN)
    return vane_wind(*table.stack(*VANE).T) if VANE[0] in table.columns else None


def vane_wind(speed_mps: Array, angle_rad: Array) -> Array:
    """(k, 2) u_q, v_q [m/s] from the speed and the direction it comes from, clockwise from the bow."""
    return np.stack([speed_mps * np.cos(angle_rad), speed_mps * np.sin(angle_rad)], axis=-1)


def check_wind(table: Table) -> Table:
    """Compare vane and Cartesian wind where a file has both; the latter is used.

    Raises:
        FileError: they differ by the direction convention of the angle.
    """
    if not {*CARTESIAN, *VANE} <= set(table.columns):
        return table
    cartesian, vane = table.stack(*CARTESIAN), vane_wind(*table.stack(*VANE).T)
    size = float(np.linalg.norm(cartesian)) or 1.0
    off = float(np.linalg.norm(cartesian - vane)) / size
    if off <= TUNING.wind_disagreement:
        return table.noted("the vane's wind agrees with wind_u_mps and wind_v_mps, which are used")
    for text, signs in (("counts counter-clockwise", (1, -1)), ("says where it blows to", (-1, -1))):
        if float(np.linalg.norm(cartesian - vane * signs)) / size < TUNING.wind_explained:
            problem = f"{text}, as wind_u_mps and wind_v_mps show; expected where it comes from, clockwise from the bow"
            raise table.error(VANE[1], problem)
    return table.noted(f"the vane's wind differs by {off:.0%} from wind_u_mps and wind_v_mps, which are used")
