"""A made-up trial as a CSV file, for the tests of records: 80 samples at 2 Hz, turning gently to both sides."""

from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

SAMPLE_TIME_S = 0.5
Columns = dict[str, list[str]]


def motion(count: int = 80) -> dict[str, np.ndarray]:
    """Columns of a trial whose velocities are the derivatives of its pose, but for the trapezoidal rule."""
    time = SAMPLE_TIME_S * np.arange(count)
    heading = 0.3 + 0.6 * np.sin(0.1 * time)
    u, v, r = 2.0 + 0.2 * np.sin(0.2 * time), 0.3 * np.sin(0.1 * time + 1), 0.06 * np.cos(0.1 * time)
    c, s = np.cos(heading), np.sin(heading)
    north, east = (cumulative_trapezoid(rate, time, initial=0) for rate in (c * u - s * v, s * u + c * v))
    return {
        "time_s": time,
        "north_m": north,
        "east_m": east,
        "heading_rad": heading,
        "u_mps": u,
        "v_mps": v,
        "r_radps": r,
        "n1_rps": 5.0 + np.sin(0.3 * time),
        "rudder1_rad": 0.2 * np.sin(0.1 * time),
        "wind_speed_mps": 6.0 + np.sin(0.2 * time),
        "wind_angle_rad": 1.0 + 0.5 * np.sin(0.1 * time),
        "depth_m": 20.0 + np.sin(0.05 * time),
    }


def texts(columns: dict[str, np.ndarray]) -> Columns:
    """Every number as it is written."""
    return {name: [repr(float(value)) for value in values] for name, values in columns.items()}


def csv_text(columns: Columns, separator: str = ",") -> str:
    """Header and rows."""
    rows = zip(*columns.values(), strict=True)
    return "\n".join([separator.join(columns), *(separator.join(row) for row in rows)]) + "\n"


def write_trial(path: Path, columns: dict[str, np.ndarray]) -> Path:
    """Write columns of numbers."""
    path.write_text(csv_text(texts(columns)), encoding="utf-8")
    return path
