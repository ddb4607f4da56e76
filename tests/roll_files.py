"""Files of runs of a model ship that rolls, at several loads, for `expdesign roll`."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from expdesign.roll import NOMINAL, Load, Run
from roll_truths import CALIBRATION, Sea, ship_run, switching, unknown_load

SHIP = """
[ship]
mass_kg = 22.04
mass_height_m = -0.0073
sensor_height_m = 0.23
beam_m = 0.3
period_s = 1.3
"""
KNOWN = "\n[[load]]\nmass_kg = 0.2\nheight_m = 0.256\n"
UNKNOWN = "\n[[load]]\nunknown = true\n"
K_KNOWN = "\n[known]\nk = 9.0\n"
SEA = Sea(roll_rate=0.002, sensed=0.005, yaw_rate=0.002, moment=0.01, frequency_hz=0.8, damping=0.3)


@cache
def measured(load: Load, seed: int) -> Run:
    rng = np.random.default_rng(seed)
    return ship_run(load, switching(4000, 150, rng, levels=(-0.6, 0.0, 0.6)), SEA, rng, step_s=0.01)


def csv(path: Path, load: Load, seed: int, *, without: str = "") -> Path:
    run = measured(load, seed)
    columns = {
        "time_s": np.arange(len(run.signals)) * run.step_s,
        "roll_rate_radps": run.signals[:, 0],
        "imu_lateral_mps2": -run.signals[:, 1],
        "r_radps": run.signals[:, 2],
        "rudder1_rad": run.signals[:, 3],
    }
    kept = [name for name in columns if name != without]
    table = np.column_stack([columns[name] for name in kept])
    np.savetxt(path, table, delimiter=",", header=",".join(kept), comments="", fmt="%.9g")
    return path


def three(folder: Path) -> list[Path]:
    loads = {"nominal": NOMINAL, "calibration": CALIBRATION, "loaded": unknown_load()}
    return [csv(folder / f"{name}.csv", load, seed) for seed, (name, load) in enumerate(loads.items(), start=1)]


def stated(folder: Path, text: str) -> Path:
    path = folder / "loads.toml"
    path.write_text(SHIP + text)
    return path
