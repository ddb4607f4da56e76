"""Data of the first 200 s of the story's trial, sailed by its nominal ship."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from expdesign.scenario import load_scenario, load_vessel
from expdesign.signals import Commands
from expdesign.simulation import Environment, simulate
from scenario_files import SCENARIOS

STORY = SCENARIOS / "story.toml"
SHIP = load_vessel(SCENARIOS / "vessels/tender-20m.toml")
SAMPLES = 200
NAMES = ("time_s", "north_m", "east_m", "heading_rad", "u_mps", "v_mps", "r_radps")


def wandering() -> Commands:
    """Commands that excite every parameter: slow beats of both thrusters."""
    time = np.arange(SAMPLES)
    speeds = np.stack([7 + 4 * np.sin(time / 9), 6 + 5 * np.sin(time / 14 + 1)], axis=1)
    angles = np.stack([0.9 * np.sin(time / 23), 0.8 * np.sin(time / 31 + 2)], axis=1)
    values = np.stack([speeds[:, 0], angles[:, 0], speeds[:, 1], angles[:, 1]], axis=1)
    return Commands(sample_time_s=1.0, names=SHIP.model.inputs, values=values)


def measured(
    path: Path, *, noise: float = 1e-3, drop=(), degrees=False, pose=(-100.0, -450.0, 1.0), current=(0.0, 0.0)
):
    """A data file of the nominal ship; the last row's pose."""
    commands, rng = wandering(), np.random.default_rng(0)
    run = simulate(SHIP, commands, pose=np.array(pose), environment=Environment(current_to=np.array(current)))
    state = np.concatenate([run.pose[:-1], run.velocity[:-1] + noise * rng.standard_normal((SAMPLES, 3))], axis=1)
    table = dict(zip(NAMES, np.column_stack([np.arange(SAMPLES), state]).T, strict=True))
    if degrees:
        lat_lon = load_scenario(STORY).area.frame.to_degrees(state[:, :2])
        table |= {"lat_deg": lat_lon[:, 0], "lon_deg": lat_lon[:, 1]}
        drop = (*drop, "north_m", "east_m")
    table |= dict(zip(("n1_rps", "a1_rad", "n2_rps", "a2_rad"), commands.values.T, strict=True))
    kept = {name: values for name, values in table.items() if name not in drop}
    rows = [",".join(kept), *(",".join(map(repr, row)) for row in np.array(list(kept.values())).T.tolist())]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return state[-1, :3]
