"""Inclining tests: heel, metacentric height and inertia are the textbook's, errors are their derivatives."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy

from design_case import SCENARIOS
from expdesign.cli import main
from expdesign.errors import InputError
from expdesign.loading import heel_in_waves, heel_of_shift, inclining
from expdesign.scenario import load_vessel
from expdesign.waves import Waves
from rolling_ship import ROLL_MODEL, roll_model

SHIP = {"displacement_kg": 3.7e6, "metacentric_height_m": 1.3}
TEST = {**SHIP, "mass_kg": 2e4, "shift_m": 10.0, "period_s": 9.0}


def test_the_height_follows_from_the_heel() -> None:
    heel = heel_of_shift(mass_kg=2e4, shift_m=10.0, **SHIP)
    assert 2e4 * 10.0 / (3.7e6 * math.tan(heel)) == pytest.approx(1.3, rel=1e-12)


def test_errors_of_height_and_inertia_are_derivatives() -> None:
    found = inclining(**TEST, heel_std_rad=1e-6, period_std_s=1e-5)
    height = [2e4 * 10.0 / (3.7e6 * math.tan(found.heel_rad + step)) for step in (-1e-6, 1e-6)]
    assert found.metacentric_height_std_m == pytest.approx((height[0] - height[1]) / 2, rel=1e-6)

    def inertia(gm: float, period: float) -> float:
        return 3.7e6 * 9.81 * gm * (period / (2 * math.pi)) ** 2

    by_height = (inertia(height[0], 9.0) - inertia(height[1], 9.0)) / 2
    by_period = (inertia(1.3, 9.0 + 1e-5) - inertia(1.3, 9.0 - 1e-5)) / 2
    assert found.inertia_kgm2 == pytest.approx(inertia(1.3, 9.0), rel=1e-12)
    assert found.inertia_std_kgm2 == pytest.approx(math.hypot(by_height, by_period), rel=1e-6)


def test_four_shifts_halve_the_error_and_no_decay_leaves_the_inertia_open() -> None:
    one, four = (inclining(**TEST, heel_std_rad=1e-4, shifts=count) for count in (1, 4))
    assert four.metacentric_height_std_m == pytest.approx(one.metacentric_height_std_m / 2, rel=1e-12)
    assert one.inertia_std_kgm2 == np.inf


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("shift_m", 0.0, "shift_m is 0, expected more than 0"),
        ("period_std_s", -0.1, "period_std_s is -0.1, expected more than 0"),
        ("mass_kg", 4e6, "mass_kg is 4e\\+06, expected a weight on board, of less than all 3.7e\\+06 kg"),
        ("shift_m", 100.0, "20000 kg shifted by 100 m heel the ship by 23 degrees, expected 10 or less"),
    ],
)
def test_what_is_no_inclining_test_is_not_taken(name: str, value: float, line: str) -> None:
    with pytest.raises(InputError, match=line):
        inclining(**{**TEST, "heel_std_rad": 1e-4, name: value})


BEAM_ON = Waves(height_m=0.01, period_s=1.6, from_rad=np.pi / 2)


def test_means_of_drawn_roll_in_waves_have_the_errors_that_are_told() -> None:
    """Records of the ship at rest in drawn waves, a differential equation solved over time; 4 standard errors."""
    pendulum = roll_model().pendulum
    assert pendulum is not None
    righting, step_s, read_s = pendulum.righting_nm, 0.1, 7.3
    ship = scipy.signal.lti([righting], [pendulum.inertia_kgm2, pendulum.parameters["d"], righting])
    time = step_s * np.arange(6000)
    slope = BEAM_ON.slope(np.zeros((len(time), 3)), step_s, np.random.default_rng(4))
    roll = scipy.signal.lsim(ship, slope, time)[1][200:]
    rms, left = heel_in_waves(replace(pendulum, waves=BEAM_ON), read_s)
    each = round(read_s / step_s)
    means = roll[: len(roll) // each * each].reshape(-1, each).mean(axis=1)
    assert means.std() == pytest.approx(left, rel=4.0 / np.sqrt(2 * len(means)))
    assert roll.std() == pytest.approx(rms, rel=0.1)
    assert left < 0.1 * rms
    assert heel_in_waves(replace(pendulum, waves=BEAM_ON), 0.0) == pytest.approx((rms, rms))


def test_waves_of_the_vessel_file_count_in_heel_and_longer_readings_help(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rough = tmp_path / "rough.toml"
    waves = "\n[roll.waves]\nheight_m = 0.01\nperiod_s = 1.6\nfrom_deg = 90.0\n"
    rough.write_text(ROLL_MODEL.read_text() + waves)
    stds = {}
    for name, vessel, more in (("calm", ROLL_MODEL, ()), ("long", rough, ("600",)), ("short", rough, ("5",))):
        asked = ("--read-s", *more) if more else ()
        assert inclined("--out", str(tmp_path / name), *asked, "--period-std-s", "0.02", vessel=vessel) == 0
        told = json.loads((tmp_path / name / "incline.json").read_text())
        stds[name] = told["tests"][0]["metacentric_height_std_m"]
        printed = " ".join(capsys.readouterr().out.split())
        assert ("The waves of [roll.waves] roll her by" in printed) == (vessel is rough)
        assert ("They disturb a decay, too" in printed) == (vessel is rough)
    assert stds["calm"] < stds["long"] < 0.5 * stds["short"]


def inclined(*more: str, vessel: Path = ROLL_MODEL) -> int:
    return main(["incline", "--vessel", str(vessel), "--mass-kg", "0.2", "0.4", "--shift-m", "0.05", *more])


def test_the_command_tells_every_mass_and_shift(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Numbers of the file are those of the closed forms, by hand from the vessel file's [roll]."""
    asked = ("--heel-std-deg", "0.01", "--period-std-s", "0.02", "--shifts", "2", "--out", str(tmp_path))
    assert inclined(*asked) == 0
    told = json.loads((tmp_path / "incline.json").read_text())
    pendulum = load_vessel(ROLL_MODEL).pendulum
    assert pendulum is not None
    assert told["displacement_kg"] == 22.04
    height = (9.0 + 9.81 * 22.04 * (0.0073 - 0.0294)) / (9.81 * 22.04)
    assert told["metacentric_height_m"] == pytest.approx(height, rel=1e-12)
    assert [(row["mass_kg"], row["shift_m"]) for row in told["tests"]] == [(0.2, 0.05), (0.4, 0.05)]
    for row in told["tests"]:
        heel = math.atan(row["mass_kg"] * 0.05 / (22.04 * height))
        assert row["heel_rad"] == pytest.approx(heel, rel=1e-12)
        share = math.radians(0.01) / math.sqrt(2) / (math.sin(heel) * math.cos(heel))
        assert row["metacentric_height_std_m"] == pytest.approx(height * share, rel=1e-9)
        period = 2 * 0.02 / told["period_s"]
        assert row["inertia_std_kgm2"] == pytest.approx(row["inertia_kgm2"] * math.hypot(share, period), rel=1e-9)
    printed = capsys.readouterr().out
    assert f"{math.degrees(told['tests'][1]['heel_rad']):.2f}" in printed


def test_without_a_decay_the_command_leaves_the_inertia_open(tmp_path: Path) -> None:
    assert inclined("--out", str(tmp_path)) == 0
    assert json.loads((tmp_path / "incline.json").read_text())["tests"][0]["inertia_std_kgm2"] is None


def test_what_cannot_be_inclined_is_one_line_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    falling = tmp_path / "falling.toml"
    falling.write_text(ROLL_MODEL.read_text().replace("k = 9.0", "k = 4.0"))
    without = SCENARIOS / "vessels" / "model-ship.toml"
    for asked, vessel, status, line in (
        ((), without, 2, "roll: is missing, expected a table [roll] with masses and heights"),
        ((), falling, 3, "does not stay upright: her metacentric height is -0.0"),
        (("--heel-std-deg", "0"), ROLL_MODEL, 2, "heel_std_rad is 0, expected more than 0"),
    ):
        assert inclined(*asked, "--out", str(tmp_path / "out"), vessel=vessel) == status
        error = capsys.readouterr().err.strip().splitlines()
        assert len(error) == 1
        assert line in error[0]
    assert not (tmp_path / "out").exists()
