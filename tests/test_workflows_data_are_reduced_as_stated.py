"""Every command that reads data undoes what the vessel file states of actuators and sensors, and says so."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign import workflows
from expdesign.export.files import vessel_toml
from expdesign.scenario import load_scenario, load_vessel
from expdesign.signals import Commands
from expdesign.vessel import Response, Sensors, Vessel
from expdesign.workflows.steps.present import present_state
from measured_trials import TUG_TRUE, tug_commands, write_run
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")

STORY, TENDER = SCENARIOS / "story.toml", load_vessel(SCENARIOS / "vessels/tender-20m.toml")
FAULTS = Sensors(
    velocity_forward_m=6.0, velocity_delay_s=2.0, position_forward_m=6.0, yaw_rate_scale=1.1,
    heading_bias_rad=0.1,
)  # fmt: skip


def stating(vessel: Vessel, path: Path) -> Vessel:
    """The vessel with slow actuators and faulty sensors, and its file."""
    actuators = tuple(
        replace(one, responses=(Response(lag_s=3.0), Response(lag_s=2.0, delay_s=1.0)))
        for one in vessel.model.actuators
    )
    stated = replace(vessel, model=replace(vessel.model, actuators=actuators), sensors=FAULTS)
    path.write_text(vessel_toml(stated), encoding="utf-8")
    return stated


def shorten(path: Path, *, digits: int) -> None:
    """Write every number of a data file with fewer digits."""
    header, *rows = path.read_text("utf-8").splitlines()
    short = [",".join(f"{float(cell):.{digits}g}" for cell in row.split(",")) for row in rows]
    path.write_text("\n".join([header, *short]) + "\n", encoding="utf-8")


@pytest.mark.thorough
def test_estimates_and_their_run_check_are_of_the_ship_not_of_her_instruments(tmp_path: Path):
    ship = stating(TUG_TRUE, tmp_path / "ship.toml")
    data = write_run(tmp_path / "one.csv", ship, tug_commands(500), velocity=(1.7, 0.7, 0.0))
    shorten(data, digits=10)  # as `expdesign simulate` writes
    workflows.estimate([data], tmp_path / "out", vessel=tmp_path / "ship.toml", methods=["oe"])
    content = json.loads((tmp_path / "out" / "estimate.json").read_text("utf-8"))
    found = {name: item["value"] for name, item in content["oe"]["parameters"].items()}
    truth = dict(zip(TUG_TRUE.model.names, TUG_TRUE.model.parameters.tolist(), strict=True))
    for name in set(found) - {"W_abs_u_u", "W_abs_v_v", "W_uv", "X_abs_u_u", "Y_abs_v_v", "N_uv"}:
        assert found[name] == pytest.approx(truth[name], rel=1e-6)
    assert min(content["oe"]["fit"]["estimation"]["one.csv"].values()) > 99.99
    page = (tmp_path / "out" / "estimate.html").read_text("utf-8")
    for words in ("commands of n1, a1, n2, a2 act", "velocities are measured 6 m forward", "velocities are 2 s late"):
        assert words in page


def test_the_rest_of_a_trial_is_planned_with_an_estimate_of_the_ship(tmp_path: Path):
    ship = stating(TENDER, tmp_path / "ship.toml")
    text = STORY.read_text(encoding="utf-8").replace('"vessels/tender-20m.toml"', '"ship.toml"')
    for folder in ("dictionaries", "areas"):
        text = text.replace(f'"{folder}/', f'"{SCENARIOS}/{folder}/')
    (tmp_path / "story.toml").write_text(text, encoding="utf-8")
    commands = tug_commands(300)
    values = commands.values * (0.7, 1.0, 0.7, 1.0)
    slow = Commands(sample_time_s=1.0, names=ship.model.inputs, values=values)
    data = write_run(tmp_path / "so-far.csv", ship, slow, pose=(-100.0, -450.0, 1.0), velocity=(1.0, 0.0, 0.0))
    state = present_state(load_scenario(tmp_path / "story.toml"), [data])
    off = np.abs(state.ship.model.parameters / TENDER.model.parameters - 1.0)
    assert np.median(off) < 0.02
    assert any("commands of n1, a1, n2, a2 act" in note for note in state.notes)


def test_indices_are_of_the_ships_own_track(tmp_path: Path):
    """A circle seen from an antenna with a turned compass has the advance and diameters of the ship's own."""
    faulty = replace(TUG_TRUE, sensors=FAULTS)
    (tmp_path / "faulty.toml").write_text(vessel_toml(faulty), encoding="utf-8")
    (tmp_path / "exact.toml").write_text(vessel_toml(replace(TUG_TRUE, sensors=Sensors())), encoding="utf-8")
    angle = np.repeat([0.0, 0.3], (100, 500))
    values = np.stack([np.full(600, 8.0), 0 * angle, np.full(600, 8.0), angle], axis=1)
    circle = Commands(sample_time_s=1.0, names=TUG_TRUE.model.inputs, values=values)
    found = []
    for name, ship in (("faulty", faulty), ("exact", replace(TUG_TRUE, sensors=Sensors()))):
        data = write_run(tmp_path / f"{name}.csv", ship, circle, velocity=(3.0, 0.0, 0.0))
        workflows.indices([data], tmp_path / name, vessel=tmp_path / f"{name}.toml")
        (run,) = json.loads((tmp_path / name / "indices.json").read_text("utf-8"))["measured"]
        found.append({key: value for key, value in run.items() if isinstance(value, float)})
    assert len(found[1]) >= 4
    assert found[0] == pytest.approx(found[1], rel=1e-4, abs=1e-6)
