"""What an import learns of sensors and actuators acts in later commands as if the vessel file stated it."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.cli.commands import app
from expdesign.errors import FileError
from expdesign.export.files import vessel_toml
from expdesign.importing import Channel, sampled, sensor_keys
from expdesign.importing.mapping import COG, SOG, Mapping
from expdesign.scenario import equipped_vessel, load_vessel
from logged_trial import SHIP, Voyage, sentence, voyage

pytestmark = pytest.mark.usefixtures("undrawn")

SILENT = SHIP[: SHIP.index("[sensors]")]
TOLD = {"position_interval_s": 5.0, "velocity_interval_s": 5.0, "heading_rad": 0.004}


def folders(tmp_path: Path, text: str, *instruments: str) -> tuple[Path, list[Path]]:
    """A vessel file, and folders of imports."""
    (tmp_path / "ship.toml").write_text(text)
    found = []
    for number, own in enumerate(instruments):
        (tmp_path / f"log{number}").mkdir()
        (tmp_path / f"log{number}" / "instruments.toml").write_text(own)
        found.append(tmp_path / f"log{number}")
    return tmp_path / "ship.toml", found


LINES = "[sensors]\n" + "".join(f"{key} = {value}\n" for key, value in TOLD.items())
RESPONSES = "[actuators.rudder1]\nangle_lag_s = 0.7\n[actuators.n1]\nspeed_rate_rps2 = 0.4\n"


def test_a_silent_vessel_file_is_as_one_that_states_what_the_logs_tell(tmp_path: Path) -> None:
    ship, logs = folders(tmp_path, SILENT, LINES + RESPONSES)
    stated = SILENT.replace("angle_rate_radps", "angle_lag_s = 0.7\nangle_rate_radps")
    stated = stated.replace("speed_max_rps = 4.0", "speed_max_rps = 4.0\nspeed_rate_rps2 = 0.4") + LINES
    (tmp_path / "stated.toml").write_text(stated)
    found, notes = equipped_vessel(ship, logs)
    assert vessel_toml(found) == vessel_toml(load_vessel(tmp_path / "stated.toml"))
    assert vessel_toml(found) != vessel_toml(load_vessel(ship))
    (note,) = notes
    assert note.startswith("by log0/instruments.toml, as ship.toml does not say: ")
    assert all(f"{key} = {value:.3g}" in note for key, value in TOLD.items())
    assert "rudder1 angle_lag_s = 0.7" in note
    assert "n1 speed_rate_rps2 = 0.4" in note


def test_what_the_vessel_file_states_counts_and_a_difference_is_told(tmp_path: Path) -> None:
    near = "[sensors]\nheading_rad = 0.0032\n[actuators.rudder1]\nangle_rate_radps = 0.051\n"
    far = "[sensors]\nheading_rad = 0.03\n[actuators.rudder1]\nangle_rate_radps = 0.07\n"
    ship, logs = folders(tmp_path, SHIP, near, far)
    found, notes = equipped_vessel(ship, logs)
    assert vessel_toml(found) == vessel_toml(load_vessel(ship))
    assert notes == (
        "log1/instruments.toml shows heading_rad = 0.03, where ship.toml says 0.003, which counts",
        "log1/instruments.toml shows rudder1 angle_rate_radps = 0.07, where ship.toml says 0.05, which counts",
    )


def test_two_imports_that_differ_are_told_and_the_first_counts(tmp_path: Path) -> None:
    ship, logs = folders(tmp_path, SILENT, LINES, LINES.replace("heading_rad = 0.004", "heading_rad = 0.04"))
    found, notes = equipped_vessel(ship, logs)
    assert found.sensors.heading_rad == 0.004
    told = "log1/instruments.toml shows heading_rad = 0.04, where log0/instruments.toml says 0.004, which counts"
    assert told in notes


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[sensors\n", "is not valid TOML"),
        ("[sensors]\nheading = 0.1\n", "sensors.heading: is not a known key"),
        ("[sensors]\nheading_rad = -1.0\n", "sensors.heading_rad"),
        ("[actuators.helm1]\nangle_lag_s = 1.0\n", "actuators: is 'helm1'"),
        ("[actuators.rudder1]\nspeed_lag_s = 1.0\n", "actuators.rudder1: is 'speed_lag_s'"),
        ("[actuators.rudder1]\nangle_lag_s = 'x'\n", "actuators.rudder1.angle_lag_s"),
    ],
)
def test_a_wrong_file_of_instruments_is_one_line(text: str, told: str, tmp_path: Path) -> None:
    ship, logs = folders(tmp_path, SILENT, text)
    with pytest.raises(FileError) as caught:
        equipped_vessel(ship, logs)
    assert "instruments.toml" in str(caught.value)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def channels(trip: Voyage, every: dict[str, int]) -> dict[str, Channel]:
    """Speed, course, heading and rudder, each every so many tenths of a second."""
    values = {SOG: trip.speed_mps, COG: trip.course_rad, "heading_rad": trip.heading_rad, "rudder1_rad": trip.order_rad}
    return {
        name: Channel(name=name, source="a", time_s=trip.time_s[:: every[name]], values=own[:: every[name]])
        for name, own in values.items()
    }


def test_a_velocity_that_is_read_less_often_is_of_the_ships_axes_when_it_is_read() -> None:
    trip = voyage(parts=(("steady", 20.0), ("circle", 100.0)))
    found = sampled(channels(trip, {SOG: 50, COG: 50, "heading_rad": 10, "rudder1_rad": 10}), Mapping(uses=()))
    (stretch,) = found.stretches
    read = np.flatnonzero(np.isclose((stretch.time_s - trip.time_s[0]) % 5.0, 0.0))
    for name, truth in (("u_mps", trip.u_mps), ("v_mps", trip.v_mps)):
        values = stretch.columns[name]
        assert np.abs(values[read] - np.interp(stretch.time_s[read], trip.time_s, truth)).max() < 1e-9
        assert set(np.flatnonzero(np.diff(values)) + 1) <= set(read)
    assert sensor_keys(found)["velocity_interval_s"][0] == 5.0


def test_rows_that_are_means_of_readings_have_their_noise() -> None:
    rng = np.random.default_rng(5)
    times = np.arange(0, 2000, 0.1)
    noisy = {"heading_rad": 0.02, "u_mps": 0.1, "v_mps": 0.1}
    table = {
        name: Channel(name=name, source="a", time_s=times, values=1.0 + rng.normal(scale=std, size=len(times)))
        for name, std in noisy.items()
    }
    found = sampled(table, Mapping(uses=(), sample_time_s=1.0))
    keys = sensor_keys(found)
    (stretch,) = found.stretches
    for key, name in (("heading_rad", "heading_rad"), ("velocity_mps", "u_mps")):
        # ten readings of 0.1 s in a row of 1 s; the robust deviation of 20,000 readings is known to 1 per cent, that of
        # the 2,000 rows to 2
        assert keys[key][0] == pytest.approx(noisy[name] / math.sqrt(10.0), rel=0.05)
        assert float(np.std(stretch.columns[name])) == pytest.approx(keys[key][0], rel=0.08)


def bridge(path: Path, seed: int, *, heading_s: int, fix_s: int, rounded_deg: float) -> Path:
    """NMEA of a bridge whose sensors are read less often than the rudder, and rounded."""
    rng = np.random.default_rng(seed)
    parts = (("steady", 60.0), ("zigzag", 200.0), ("steady", 150.0), ("circle", 200.0), ("steady", 60.0))
    trip = voyage(parts=parts, heading=float(rng.uniform(0, 6))).every(10)
    lines = []
    for k in range(len(trip.time_s)):
        second = 36_000 + k
        clock = f"{second // 3600:02d}{second // 60 % 60:02d}{second % 60:02d}.00"
        lines.append(sentence(f"GPZDA,{clock},09,10,2025,00,00"))
        if k % fix_s == 0:
            knots = trip.speed_mps[k] * 3600 / 1852 + rng.normal(scale=0.02)
            course = math.degrees(trip.course_rad[k]) + rng.normal(scale=0.3)
            lines.append(sentence(f"GPVTG,{course % 360:.1f},T,,M,{knots:.1f},N,,K,A"))
        if k % heading_s == 0:
            heading = math.degrees(trip.heading_rad[k]) + rng.normal(scale=0.1)
            lines.append(sentence(f"HEHDT,{round(heading / rounded_deg) * rounded_deg % 360:.1f},T"))
        lines.append(sentence(f"IIRSA,{math.degrees(trip.rudder_rad[k]):.1f},A,,V"))
        lines.append(sentence(f"IIRPM,S,0,{trip.n_rps[k] * 60:.1f},100,A"))
    path.write_text("\n".join(lines) + "\n")
    return path


TRUTH = {"X_vr": 1.2, "Y_uv": -0.02, "Y_ur": -0.3, "N_ur": -0.02, "N_ud": 0.0005}


def relative_errors(folder: Path) -> np.ndarray:
    """Of least squares of an imported folder beside a vessel file that says nothing of sensors."""
    words = [
        "estimate",
        folder,
        "--vessel",
        folder.parent / "ship.toml",
        "--method",
        "ls",
        "--out",
        folder.parent / "e",
    ]
    assert main([*map(str, words), "--quiet"]) == 0
    found = json.loads((folder.parent / "e" / "estimate.json").read_text())["ls"]["parameters"]
    return np.array([found[name]["value"] / truth - 1.0 for name, truth in TRUTH.items()])


def imported_bridge(tmp_path: Path, seed: int, **how: float) -> Path:
    (tmp_path / "ship.toml").write_text(SILENT)
    log = bridge(tmp_path / "a.nmea", seed, **how)  # type: ignore[arg-type]
    out = tmp_path / f"out{seed}"
    assert main(["import", str(log), "--length-m", "50", "--out", str(out), "--quiet"]) == 0
    return out


@pytest.mark.slow
def test_velocities_every_five_seconds_give_the_parameters(tmp_path: Path) -> None:
    """In turns; taken as repeated in the axes of each row, they gave a Y_ur that was wrong by half."""
    how = {"heading_s": 1, "fix_s": 5, "rounded_deg": 0.1}
    errors = [relative_errors(imported_bridge(tmp_path, seed, **how)) for seed in range(5)]
    # each of these has a standard deviation of 1 to 2 per cent
    assert np.sqrt(np.mean(np.square(errors), axis=0)).max() < 0.05


SCENARIO = """[scenario]
vessel = "ship.toml"
dictionary = "none.toml"
area = "none.toml"
[design]
total_s = 600
{prior}
[start]
north_m = 0
east_m = 0
heading_deg = 0
[goal]
north_m = 0
east_m = 0
heading_deg = 0
"""
COMMANDS = {
    "estimate": "estimate log0/a.csv --vessel ship.toml", "diagnose": "diagnose log0/a.csv --vessel ship.toml",
    "indices": "indices log0/a.csv --vessel ship.toml", "mine": "mine log0/a.csv --vessel ship.toml --keep 1",
    "monitor": "monitor log0/a.csv --vessel ship.toml", "folder": "estimate log0 --vessel ship.toml",
    "identify-steps": "identify-steps log0/a.csv --vessel ship.toml",
    "watch-steps": "watch-steps log0/a.csv --vessel ship.toml --steps none.csv",
    "roll": "roll log0/a.csv --vessel ship.toml --loads none.toml",
    "replan": "replan scenario.toml --data log0/a.csv",
    "replan, vessel": "replan scenario.toml --data log0/a.csv --vessel ship.toml",
    **{name: f"{name} prior.toml" for name in ("durations", "score", "plan", "run", "foresee", "validate")},
    "whatif": "whatif prior.toml prior.toml",
}  # fmt: skip
"""Every command that reads measured data, with data in log0."""
WITHOUT = {
    "import",
    "new",
    "nominal",
    "roll-plan",
    "export",
    "check-route",
    "simulate",
    "trial-result",
    "incline",
    "explain",
    "web",
}
"""Commands that read none: logs, plans and particulars only."""


@pytest.mark.parametrize("case", COMMANDS)
def test_every_command_that_reads_measured_data_reads_what_an_import_tells_beside_it(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folders(tmp_path, SHIP, "[sensors]\nheading = 0.1\n")  # a key that is none, so that reading it is refused
    (tmp_path / "log0" / "a.csv").write_text("time_s,u_mps\n0,1\n1,1\n")
    (tmp_path / "scenario.toml").write_text(SCENARIO.format(prior=""))
    (tmp_path / "prior.toml").write_text(SCENARIO.format(prior='prior_data = ["log0/a.csv"]'))
    monkeypatch.chdir(tmp_path)
    assert main([*COMMANDS[case].split(), "--quiet"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "log0/instruments.toml: sensors.heading: is not a known key" in line


def test_no_command_is_forgotten() -> None:
    known = {words.split()[0] for words in COMMANDS.values()} | WITHOUT
    assert {info.name or info.callback.__name__.replace("_", "-") for info in app.registered_commands} == known
