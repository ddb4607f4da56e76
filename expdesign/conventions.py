"""Frames, signs, units and column names of the package, and how numbers with their errors and lists are written.

- n-frame: north, east, down, fixed to the earth; its origin is the reference point of the sea area.
- b-frame: x forward, y starboard, z down; origin at the centre of rotation.
- Pose [north m, east m, heading rad]; heading clockwise from north. Velocity [u, v, r] = [surge m/s, sway m/s, yaw
  rate rad/s], in the b-frame.
- Currents and winds are velocities *to* which the medium moves, in the n-frame.
- Inside the package: SI units and radians. Knots, degrees and latitudes live in `scenario`, `records` and `export`.

Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2011), chapter 2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OUTPUTS = ("u", "v", "r")
AXES = {"u": "surge", "v": "sway", "r": "yaw"}
POSE_COLUMNS = ("north_m", "east_m", "heading_rad")
VELOCITY_COLUMNS = ("u_mps", "v_mps", "r_radps")
METRES_PER_NAUTICAL_MILE = 1852.0
KNOTS_PER_MPS = 3600.0 / METRES_PER_NAUTICAL_MILE


def wrap_angle(angle_rad: Array | float) -> Array:
    """The angle of the same direction in [-pi, pi)."""
    return np.asarray((np.asarray(angle_rad) + np.pi) % (2.0 * np.pi) - np.pi)


def whole_turns(angle_rad: Array | float) -> Array:
    """The multiples of 2 pi nearest to angles."""
    return np.asarray(2.0 * np.pi * np.round(np.asarray(angle_rad) / (2.0 * np.pi)))


def rotation(heading_rad: float) -> Array:
    """R_nb of shape (2, 2): turns b-frame (forward, starboard) into n-frame (north, east)."""
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    return np.array([[c, -s], [s, c]])


def rotated(vector: Any, angle_rad: Array | float) -> tuple[Array, Array]:
    """A vector (2, ...) turned clockwise: from the b-frame to the n-frame by headings, back by minus these."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    x, y = vector
    return np.asarray(x * c - y * s), np.asarray(x * s + y * c)


def to_n_frame(points_b: Array, pose: Array) -> Array:
    """Points (..., 2) given forward/starboard of a pose (3,), as (..., 2) north/east [m]."""
    return np.asarray(points_b @ rotation(float(pose[2])).T + pose[:2])


def to_b_frame(points_n: Array, pose: Array) -> Array:
    """Points (..., 2) north/east as (..., 2) forward/starboard of a pose (3,) [m]."""
    return np.asarray((points_n - pose[:2]) @ rotation(float(pose[2])))


def plus_minus(value: float, std: float) -> str:
    """A value to the second digit of its standard deviation, e.g. -0.0548 ± 0.0036; to four digits without one."""
    if not (std > 0 and math.isfinite(std)):
        whole = not value or 1e-7 <= abs(value) < 1e9
        return np.format_float_positional(value, precision=4, fractional=False, trim="-") if whole else f"{value:.3e}"
    decimals, apart = 1 - math.floor(math.log10(std)), "\N{PLUS-MINUS SIGN}"
    if abs(value) < 1e-4 or decimals > 9 or abs(value) >= 1e6:
        exponent = math.floor(math.log10(max(abs(value), std)))
        decimals = max(0, decimals + exponent)
        return f"({value / 10**exponent:z.{decimals}f} {apart} {std / 10**exponent:.{decimals}f})e{exponent}"
    return f"{value:z.{max(0, decimals)}f} {apart} {std:.{max(0, decimals)}f}"


def listed(words: Sequence[str], last: str = "and") -> str:
    """A, B and C."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"
