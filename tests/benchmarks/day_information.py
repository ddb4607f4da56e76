"""Information of a planned day of the 30 m ship, recomputed from its files by a program that imports nothing of ours.

`python tests/benchmarks/day_information.py runs/helsinki`, after `expdesign run` on a scenario with the vessel
azimuth-30m: D-information about the 18 parameters per parameter, with complete mean subtraction, of the whole track
over that of the optimum of the dictionary in `total_s`, with the current known and with a steady one unknown beside
the parameters. The regressors are those of F. Ljungberg, doctoral thesis, Linköping University, (3.60).
"""

from __future__ import annotations

import argparse
import csv
import json
import tomllib
from pathlib import Path

import numpy as np

VESSEL = Path(__file__).parents[2] / "scenarios/vessels/azimuth-30m.toml"
WIND_TO_MPS = 3.0, 2.0  # north, east: forecast of the scenario
STEP_MPS = 1e-3  # of differences by the current
LEVER_M = 9.0  # of the thrusters


def columns(path: Path) -> dict[str, np.ndarray]:
    """(k,) numbers by column name."""
    with path.open(encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, np.array(rows, dtype=float).T, strict=True))


def relative(track: dict[str, np.ndarray], to_mps: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """(k,) surge and sway through a fluid that moves to north and east."""
    c, s = np.cos(track["heading_rad"]), np.sin(track["heading_rad"])
    north, east = to_mps
    return track["u_mps"] - c * north - s * east, track["v_mps"] + s * north - c * east


def regressors(track: dict[str, np.ndarray], commands: dict[str, np.ndarray], current_to: tuple[float, float]):
    """(3, k, 18) of surge, sway and yaw."""
    r, (u, v), (ua, va) = track["r_radps"], relative(track, current_to), relative(track, WIND_TO_MPS)
    n1, a1, n2, a2 = (commands[name] for name in ("n1_rps", "a1_rad", "n2_rps", "a2_rad"))
    ahead, aside = n1 * np.cos(a1) + n2 * np.cos(a2), n1 * np.sin(a1) + n2 * np.sin(a2)
    turning = LEVER_M * (n1 * np.sin(a1) - n2 * np.sin(a2))
    equations = (
        (u, v * r, abs(u) * u, abs(ua) * ua, ahead, u * ahead),
        (v, u * r, abs(v) * v, abs(v) * r, abs(va) * va, aside),
        (r, u * v, abs(v) * v, abs(v) * r, ua * va, turning),
    )
    table = np.zeros((3, len(r), 18))
    for place, equation in enumerate(equations):
        table[place, :, 6 * place : 6 * place + 6] = np.stack(equation, axis=1)
    return table


def information(table: np.ndarray) -> np.ndarray:
    """(p, p) of regressors (3, k, p) without their means."""
    centred = table - table.mean(axis=1, keepdims=True)
    return np.einsum("eka,ekb->ab", centred, centred)


def log_det(matrix: np.ndarray) -> float:
    return float(np.linalg.slogdet(matrix)[1])


def shares(folder: Path) -> tuple[float, float]:
    """Information over the dictionary's optimum, per parameter: with the current known, and unknown."""
    vessel = tomllib.loads(VESSEL.read_text(encoding="utf-8"))
    theta = np.array(list(vessel["model"]["parameters"].values()))
    sensors = vessel["sensors"]
    noise = np.array([sensors["velocity_mps"], sensors["velocity_mps"], sensors["yaw_rate_radps"]])
    durations = json.loads((folder / "durations.json").read_text(encoding="utf-8"))
    commands, track = (columns(folder / f"{name}.csv") for name in ("commands", "track"))
    track = {name: values[: len(commands["time_s"])] for name, values in track.items()}
    asked = durations["log_det"] + 18 * np.log(durations["total_s"] / vessel["vessel"]["sample_time_s"])
    table = regressors(track, commands, (0.0, 0.0))
    slopes = [
        (regressors(track, commands, (north, east)) - regressors(track, commands, (-north, -east))) @ theta
        for north, east in STEP_MPS * np.eye(2)
    ]
    for slope, towards in zip(slopes, (0.0, np.pi / 2), strict=True):  # as the ship turns in the current
        heading, step = track["heading_rad"] - towards, 2 * STEP_MPS * vessel["vessel"]["sample_time_s"]
        slope[0] -= step * track["r_radps"] * np.sin(heading)
        slope[1] -= step * track["r_radps"] * np.cos(heading)
    beside = np.concatenate([table, np.stack(slopes, axis=-1) / (2 * STEP_MPS)], axis=2) / noise[:, None, None]
    size = np.repeat(noise, 6)
    unknown = np.linalg.inv(information(beside))[:18, :18] / np.outer(size, size)
    known_share, unknown_share = np.exp((np.array([log_det(information(table)), -log_det(unknown)]) - asked) / 18)
    return float(known_share), float(unknown_share)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="results of expdesign run")
    known, unknown = shares(parser.parse_args().folder)
    print(f"information over the dictionary's optimum: {known:.3f} with the current known, {unknown:.3f} unknown")
