"""Recorded inputs are held against the vessel file's limits; an angle is the same in every way to write it."""

from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.errors import FileError
from expdesign.records import load_records
from expdesign.vessel import Actuator, Limit
from instrumented_ship import NAMES, Log, voyages, write_log, write_vessel
from record_files import motion, write_trial

LIMITS = (
    Actuator(kind="azimuth", number=1, limits=(Limit(low=-6.0, high=6.0), Limit())),
    Actuator(kind="azimuth", number=2, limits=(Limit(low=0.0, high=6.0), Limit(low=-1.6, high=1.6))),
    Actuator(kind="tunnel", number=3, limits=(Limit(low=-5.0, high=5.0),)),
    Actuator(kind="rudder", number=1, limits=(Limit(low=-0.6, high=0.6),)),
)
FORCE = (Actuator(kind="force", number=1, limits=(Limit(low=-9.0, high=9.0), Limit(), Limit(low=-30.0, high=30.0))),)
ROWS = 80


def held_against(folder: Path, name: str, values: np.ndarray | float, actuators: tuple[Actuator, ...]) -> list[str]:
    """Notes on the limits of one input."""
    columns = {key: value for key, value in motion().items() if key not in ("n1_rps", "rudder1_rad")}
    own = {name: np.broadcast_to(values, ROWS) * np.ones(ROWS)}
    rest = {"tau_x": 1.0, "tau_y": 0.0, "tau_psi": 0.0} if actuators == FORCE else {}
    columns |= {other: value + 0.001 * np.arange(ROWS) for other, value in rest.items() if other != name}
    record = load_records(write_trial(folder / "trial.csv", columns | own), actuators=actuators)
    return [note for note in record.notes if "limits" in note]


INPUTS = {
    "n1_rps": (LIMITS, 5.9, 7.0, 300.0, "revolutions per minute belong under n1_rpm"),
    "n2_rps": (LIMITS, 5.9, 7.0, 300.0, "revolutions per minute belong under n2_rpm"),
    "n3_rps": (LIMITS, -4.9, -6.0, -240.0, "revolutions per minute belong under n3_rpm"),
    "a2_rad": (LIMITS, 1.55, 2.2, 2.5, ""),
    "rudder1_rad": (LIMITS, -0.6, -0.9, -0.96, ""),
    "rudder1_deg": (LIMITS, 34.0, 50.0, 55.0, ""),
    "n1_rpm": (LIMITS, 355.0, 420.0, 600.0, ""),
    "tau_x": (FORCE, 8.9, 12.0, 8000.0, "is it in a unit a thousand times as small as the vessel file's?"),
    "tau_psi": (FORCE, -29.0, -40.0, -45.0, ""),
    "planned_rudder1_rad": (LIMITS, 0.6, 0.9, 0.96, ""),
}


@pytest.mark.parametrize("name", INPUTS)
def test_every_input_beyond_its_limits_is_told_and_refused_where_most_are(tmp_path: Path, name: str) -> None:
    actuators, within, beyond, far, cause = INPUTS[name]
    if name.startswith("planned"):
        base, planned = name.removeprefix("planned_"), True
    else:
        base, planned = name, False

    def notes(values: np.ndarray | float) -> list[str]:
        if not planned:
            return held_against(tmp_path, name, values, actuators)
        columns = motion() | {base: np.zeros(ROWS), name: np.ones(ROWS) * values, "planned_n1_rps": np.ones(ROWS)}
        record = load_records(write_trial(tmp_path / "trial.csv", columns), actuators=actuators)
        return [note for note in record.notes if "limits" in note]

    assert notes(within) == []
    some = np.where(np.arange(ROWS) < 8, beyond, 0.5 * within)
    (note,) = notes(some)
    assert note.startswith(f"trial.csv: {name} is beyond the vessel's limits of ")
    assert note.endswith(f" in 10 % of the rows (rows 2 to 9), as far as {beyond:g}")
    with pytest.raises(FileError) as caught:
        notes(far)
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'trial.csv'}: {name}: is {far:g} in row 2, beyond the vessel's limits of ")
    assert message.endswith(f"in 100 % of the rows; {cause}" if cause else "in 100 % of the rows")


def test_a_wrong_unit_is_refused_though_the_engine_stood_still_most_of_the_time(tmp_path: Path) -> None:
    speeds = np.where(np.arange(ROWS) < 50, 0.0, 180.0)
    with pytest.raises(FileError, match="revolutions per minute belong under n1_rpm"):
        held_against(tmp_path, "n1_rps", speeds, LIMITS)


def test_inputs_without_limits_and_turns_of_a_free_thruster_are_not_doubted(tmp_path: Path) -> None:
    assert held_against(tmp_path, "tau_y", 1e6, FORCE) == []
    assert held_against(tmp_path, "a1_rad", np.linspace(0.0, 40.0, ROWS), LIMITS) == []
    assert held_against(tmp_path, "a2_rad", np.linspace(5.0, 7.0, ROWS), LIMITS) == []  # -73 to 41 degrees


@pytest.fixture(scope="module")
def log() -> Log:
    (one,) = voyages(1, "zigzag", last_s=120.0)
    return {**one, "n1_rps": 60.0 * one["n1_rps"], "roll_rate_radps": 0.01 * one["r_radps"]}


COMMANDS = {
    "estimate": "estimate {log} --vessel {ship}",
    "estimate's test": "estimate {good} --vessel {ship} --test {log}",
    "diagnose": "diagnose {log} --vessel {ship}",
    "monitor": "monitor {log} --vessel {ship}",
    "monitor's reference": "monitor {good} --vessel {ship} --reference {log}",
    "indices": "indices {log} --vessel {ship}",
    "mine": "mine {log} --vessel {ship} --keep 1",
    "identify-steps": "identify-steps {log} --vessel {ship}",
    "watch-steps": "watch-steps {log} --vessel {ship} --steps {steps}",
    "roll": "roll {log} --vessel {ship} --loads {loads}",
}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_that_reads_records_refuses_a_wrong_unit(
    tmp_path: Path, log: Log, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    ship = write_vessel(tmp_path / "ship.toml")
    bad = write_log(tmp_path / "log.csv", log)
    good = write_log(tmp_path / "good.csv", {**log, "n1_rps": log["n1_rps"] / 60.0})
    (tmp_path / "steps.csv").write_text("n1_rps,rudder1_rad\n2,0\n3,0\n3,0.2\n")
    (tmp_path / "loads.toml").write_text(LOADS)
    words = COMMANDS[command].format(
        log=bad, good=good, ship=ship, steps=tmp_path / "steps.csv", loads=tmp_path / "loads.toml"
    )
    assert main([*words.split(), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    where = "in row 2, beyond the vessel's limits of -3 to 4 in 100 % of the rows"
    assert error == f"expdesign: error: {bad}: n1_rps: is 180 {where}; revolutions per minute belong under n1_rpm"
    assert not (tmp_path / "out").exists() or command == "watch-steps"  # it says what it has seen so far


LOADS = """[ship]
mass_kg = 22.04
mass_height_m = -0.0073
sensor_height_m = 0.23
beam_m = 0.3
period_s = 1.3
[[load]]
"""


def turning(columns: dict[str, np.ndarray]) -> np.ndarray:
    """An azimuth order that goes round twice and back, with a jump across the stern."""
    time = columns["time_s"]
    return np.where(time < 30, 0.45 * time - 3.0, 10.5 - 0.6 * (time - 30)) + 0.3 * (time > 20)


WAYS = {
    "within half a turn": lambda angle: (angle + np.pi) % (2 * np.pi) - np.pi,
    "from 0 to 360 degrees": lambda angle: angle % (2 * np.pi),
    "turns later": lambda angle: angle + 6 * np.pi,
    "turns earlier": lambda angle: angle - 4 * np.pi,
}


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("stem", ["a1", "heading", "planned_a1", "reached_a1"])
def test_an_angle_is_the_same_in_every_way_to_write_it(tmp_path: Path, stem: str, way: str, unit: str) -> None:
    """What follows one of them, such as a thruster with a lag or a rate, follows all."""
    columns = {name: value for name, value in motion().items() if name not in ("heading_rad", "r_radps", "u_mps")}
    columns |= {"a1_rad": np.zeros(ROWS), "planned_a1_rad": np.zeros(ROWS), "planned_n1_rps": columns["n1_rps"]}
    columns |= {"planned_rudder1_rad": columns["rudder1_rad"]}
    angle = 0.05 * np.cumsum(turning(columns)) if stem == "heading" else turning(columns)
    columns |= {"heading_rad": angle, "r_radps": np.append(np.diff(angle), 0.0) / 0.5} if stem == "heading" else {}

    def read(angle: np.ndarray, unit: str) -> np.ndarray:
        own = {name: value for name, value in columns.items() if name != f"{stem}_rad"}
        own[f"{stem}_{unit}"] = np.degrees(angle) if unit == "deg" else angle
        record = load_records(write_trial(tmp_path / "trial.csv", own), outputs=(), velocity="measured")
        (batch,) = record.batches
        if stem == "heading":
            assert batch.pose is not None
            return np.asarray(batch.pose[:, 2])
        values = batch.planned if stem == "planned_a1" else batch.inputs
        assert values is not None
        return np.asarray(values[:, batch.input_names.index("a1")])

    expected, found = read(angle, "rad"), read(WAYS[way](angle), unit)
    turns = (found - expected)[0] / (2 * np.pi)
    assert turns == pytest.approx(round(turns) if stem == "heading" else 0, abs=1e-9)
    np.testing.assert_allclose(np.diff(found), np.diff(expected), atol=1e-9)
    if stem == "reached_a1":  # means over the samples
        angle = (angle + np.append(angle[1:], angle[-1:])) / 2
    np.testing.assert_allclose(np.diff(expected), np.diff(angle), atol=1e-9)


def test_half_a_turn_at_once_goes_the_same_way_however_it_is_written(tmp_path: Path) -> None:
    angle = np.where(np.arange(ROWS) // 20 % 2 == 0, 0.0, np.pi)
    found = []
    for way in WAYS.values():
        columns = motion() | {"a1_rad": way(angle)}
        (batch,) = load_records(write_trial(tmp_path / "trial.csv", columns)).batches
        found.append(batch.inputs[:, batch.input_names.index("a1")])
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], atol=1e-9)


def test_a_thruster_with_limits_has_one_angle_between_them(tmp_path: Path) -> None:
    angle = 1.5 * np.sin(0.2 * np.arange(ROWS))
    for way in WAYS.values():
        columns = {**motion(), "n2_rps": np.ones(ROWS), "a2_rad": way(angle)}
        (batch,) = load_records(write_trial(tmp_path / "trial.csv", columns), actuators=LIMITS[1:2]).batches
        np.testing.assert_allclose(batch.inputs[:, batch.input_names.index("a2")], angle, atol=1e-9)


def test_degrees_are_not_taken_for_radians_of_several_turns(tmp_path: Path) -> None:
    time = motion()["time_s"]
    degrees = {
        "held": np.full(ROWS, 30.0),
        "in steps": np.where(time < 20, 10.0, 85.5),
        "slowly turned": np.degrees(0.05 * time),
        "wrapped": np.degrees(0.3 * time) % 360,
        "over several turns": np.degrees(0.5 * time),
    }
    for name in ("a1_rad", "wind_angle_rad"):
        for values in degrees.values():
            path = write_trial(tmp_path / "trial.csv", motion() | {name: values})
            with pytest.raises(FileError, match=f"{name}: is .* expected radians; degrees belong under"):
                load_records(path)


def test_vanes_may_count_turns(tmp_path: Path) -> None:
    columns = motion()
    winds = []
    for turns in (0, 3):
        (batch,) = load_records(
            write_trial(
                tmp_path / "trial.csv", columns | {"wind_angle_rad": columns["wind_angle_rad"] + 2 * np.pi * turns}
            )
        ).batches
        winds.append(batch.wind)
    np.testing.assert_allclose(winds[1], winds[0], atol=1e-9)


def test_a_heading_that_counts_turns_from_the_start_is_read_where_positions_show_it(tmp_path: Path) -> None:
    (log,) = voyages(1, "circle", last_s=200.0)
    log["heading_rad"] = log["heading_rad"] - log["heading_rad"][0] + 31.0
    names = tuple(name for name in NAMES if name not in ("u_mps", "v_mps", "r_radps"))
    north = log["north_m"].copy()
    turn = 31.0 - np.arctan2(log["east_m"][20] - log["east_m"][0], north[20] - north[0])
    log["north_m"], log["east_m"] = (
        np.cos(turn) * north - np.sin(turn) * log["east_m"],
        np.sin(turn) * north + np.cos(turn) * log["east_m"],
    )
    (batch,) = load_records(write_log(tmp_path / "log.csv", log, names)).batches
    assert batch.pose is not None
    np.testing.assert_allclose(np.diff(batch.pose[:, 2]), np.diff(log["heading_rad"])[1:-1], atol=1e-6)
