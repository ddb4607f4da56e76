"""[roll] of a vessel file: a pendulum that simulations follow, that plans leave out, and that `roll` finds again."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from design_case import SCENARIOS
from diagnosis_case import vessel_of
from expdesign.errors import FileError, InputError
from expdesign.export.files import vessel_toml
from expdesign.roll import G_MPS2, PARAMETERS
from expdesign.scenario import load_vessel
from expdesign.signals import AUXILIARY, Commands
from expdesign.simulation import simulate
from expdesign.vessel import NOMINAL, NOT_ACTING_BACK, ROLL_PARAMETERS, Load, Roll, Term, Vessel, VesselModel
from expdesign.waves import Waves
from expdesign.workflows import roll, score
from rolling_ship import HIGH, ROLL_MODEL, UNDER_WAY, UNKNOWN, loaded, orders, roll_model, trial, write_csv

SHIP = roll_model()
ROLL_ANGLE, RATE, SIDE, READING = (
    AUXILIARY.index(name) for name in ("roll_rad", "roll_rate_radps", "lateral_acceleration_mps2", "imu_lateral_mps2")
)


def rewritten(folder: Path, *changes: tuple[str, str]) -> Path:
    text = ROLL_MODEL.read_text()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / "ship.toml"
    path.write_text(text)
    return path


def test_a_held_drive_rolls_as_the_matrix_exponential_says() -> None:
    """A ship that only sways, without damping: under a held side force the drive is held."""
    base = rigid()
    held = Commands(sample_time_s=0.25, names=base.model.inputs, values=np.tile([0.0, 3.0, 0.0], (200, 1)))
    sailed = simulate(base, held)
    assert sailed.auxiliary is not None
    pendulum = base.pendulum
    assert pendulum is not None
    side = 3.0 * 0.02
    np.testing.assert_allclose(sailed.auxiliary[:, SIDE], side, rtol=1e-9)
    push = (pendulum.parameters["K_vd"] + pendulum.moment_kgm) * side / pendulum.inertia_kgm2
    back = np.array([-pendulum.righting_nm, -pendulum.parameters["d"]]) / pendulum.inertia_kgm2
    A = np.array([[0, 1, 0], [*back, 1], [0, 0, 0]])
    exact = np.array([expm(A * t) @ [0, 0, push] for t in sailed.time_s])
    np.testing.assert_allclose(sailed.auxiliary[:, [ROLL_ANGLE, RATE]], exact[:, :2], atol=1e-12)
    spin = exact @ A[1]
    z_s = pendulum.body.z_s + pendulum.parameters["z_f"]
    reading = z_s * spin + G_MPS2 * exact[:, 0] - side
    np.testing.assert_allclose(sailed.auxiliary[:, READING], -reading, atol=1e-12)


def rigid() -> Vessel:
    """The coaster's roll on a ship that a side force accelerates for ever."""
    barge = vessel_of("barge")
    terms = (Term("v", "Y_mu", "tau_y"), Term("r", "N_r", "r"))
    model = VesselModel(
        terms=terms, parameters=np.array([0.02, -1.0]), parameter_std=np.zeros(2), form="continuous",
        sample_time_s=0.25, actuators=barge.actuators,
    )  # fmt: skip
    return replace(barge, model=model, sample_time_s=0.25, pendulum=SHIP.pendulum)


def test_roll_converges_as_samples_get_shorter() -> None:
    """Halving the sample time, with the same orders, changes roll by little and by less each time."""
    found = []
    rudder = np.repeat([0.0, 0.4, -0.4, 0.2], 50)
    for factor in (1, 2, 4):
        step = 0.04 / factor
        ship = replace(SHIP, sample_time_s=step, model=replace(SHIP.model, sample_time_s=step))
        values = np.column_stack([np.full(len(rudder) * factor, 10.0), np.repeat(rudder, factor)])
        sailed = simulate(
            ship, Commands(sample_time_s=step, names=ship.model.inputs, values=values), velocity=UNDER_WAY
        )
        assert sailed.auxiliary is not None
        found.append(sailed.auxiliary[::factor, ROLL_ANGLE])
    coarse, fine = (np.abs(one - found[2]).max() for one in found[:2])
    assert fine < coarse / 3
    assert coarse < np.abs(found[2]).max() / 100


def test_roll_does_not_act_back_on_the_path() -> None:
    commands = orders(SHIP, 400, np.random.default_rng(1))
    plain, heavy = replace(SHIP, pendulum=None), loaded(SHIP, HIGH)
    paths = [simulate(ship, commands, velocity=UNDER_WAY) for ship in (plain, SHIP, heavy)]
    for other in paths[1:]:
        assert np.array_equal(paths[0].pose, other.pose)
        assert np.array_equal(paths[0].velocity, other.velocity)
    assert paths[0].auxiliary is None


YARD = (
    (
        "sensor_height_m = 0.23",
        "sensor_height_m = 0.23\nmetacentric_height_m = 0.02\nperiod_s = 1.3\ndamping_ratio = 0.1",
    ),
    ("k = 9.0\nA_x = 0.157\nd = 0.267\n", ""),
)
"""What a yard states in place of three parameters."""


def test_what_a_yard_states_is_what_the_pendulum_has(tmp_path: Path) -> None:
    pendulum = load_vessel(rewritten(tmp_path, *YARD)).pendulum
    assert pendulum is not None
    assert pendulum.period_s == pytest.approx(1.3, rel=1e-12)
    assert pendulum.metacentric_height_m == pytest.approx(0.02, rel=1e-12)
    damping = pendulum.parameters["d"] / 2 / np.sqrt(pendulum.righting_nm * pendulum.inertia_kgm2)
    assert damping == pytest.approx(0.1, rel=1e-12)


def test_a_mass_above_the_axis_takes_its_weight_s_share_of_the_righting_moment() -> None:
    assert PARAMETERS[: len(ROLL_PARAMETERS)] == ROLL_PARAMETERS
    pendulum, raised = SHIP.pendulum, loaded(SHIP, HIGH).pendulum
    assert pendulum is not None
    assert raised is not None
    lever = HIGH.mass_kg * (-HIGH.z_m - pendulum.parameters["z_f"])
    assert raised.righting_nm == pytest.approx(pendulum.righting_nm - G_MPS2 * lever, rel=1e-12)


def test_she_leans_into_a_turn_first_and_out_of_it_later() -> None:
    """The rudder's moment acts at once, that of the turn after a while: rudder to roll is not minimum phase."""
    values = np.tile([10.0, 0.5], (500, 1))
    sailed = simulate(SHIP, Commands(sample_time_s=0.02, names=SHIP.model.inputs, values=values), velocity=UNDER_WAY)
    assert sailed.auxiliary is not None
    roll_angle = sailed.auxiliary[:, ROLL_ANGLE]
    assert sailed.velocity[-1, 2] > 0.1  # to starboard
    assert roll_angle[:20].max() > 0.005
    assert roll_angle[-1] < -0.05


def test_a_vessel_with_a_pendulum_survives_its_file(tmp_path: Path) -> None:
    pendulum = SHIP.pendulum
    assert pendulum is not None
    waves = Waves(height_m=0.05, period_s=1.3, from_rad=0.5, slope_share=0.8)
    pendulum = replace(pendulum, load=HIGH, parameter_correlation={("A_x", "k"): 0.5}, waves=waves)
    ship = replace(SHIP, pendulum=pendulum)
    path = tmp_path / "same.toml"
    path.write_text(vessel_toml(ship))
    assert load_vessel(path).pendulum == ship.pendulum


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("A_x = 0.157\n", "", r"roll: period_s and parameters\.A_x: neither is given, expected one of them"),
        ("mass_kg = 22.04", "mass_kg = 22.04\ndamping_ratio = 0.1", r"damping_ratio and parameters\.d: both"),
        ("K_vd = 0.95", "K_v = 0.95", r"roll\.parameters: .*'K_v'"),
        ("[roll]\n", "[roll.waves]\nheight_m = 0.1\nperiod_s = 1.3\nfrom_deg = 0.0\ngamma = 9.0\n\n[roll]\n",
         r"roll: waves\.gamma is 9, expected 1 to 7"),
        ("A_x = 0.157", "A_x = -0.157", r"roll: has a roll inertia A_x of -0\.157"),
        ("[roll]\n", "[model.roll]\nperiod_s = 9.0\ndamping_ratio = 0.1\nY_phi = 0.0\nN_phi = 0.0\n\n[roll]\n",
         r"roll: is given beside \[model\.roll\], expected one of them"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        load_vessel(rewritten(tmp_path, (old, new)))


def test_two_kinds_of_roll_are_refused() -> None:
    mode = Roll(period_s=9.0, damping_ratio=0.1, Y_phi=0.0, N_phi=0.0)
    with pytest.raises(InputError, match=r"roll twice, expected one of \[roll\] and \[model\.roll\]"):
        replace(SHIP, model=replace(SHIP.model, roll=mode))


@pytest.mark.thorough
def test_three_simulated_loads_give_the_roll_again(tmp_path: Path) -> None:
    """Estimates from a file that is wrong about most, with k known from hydrostatics, are within four deviations."""
    assert SHIP.pendulum is not None
    k = SHIP.pendulum.parameters["k"]
    rough = rewritten(
        tmp_path, ("A_x = 0.157", "A_x = 0.12"), ("d = 0.267", "d = 0.2"), ("K_r = -2.0", "K_r = -1.2"),
        ("K_vd = 0.95", "K_vd = 0.7"), ("K_delta = 0.45", "K_delta = 0.3"), ("z_f = -0.0294", "z_f = -0.01"),
    )  # fmt: skip
    loads = tmp_path / "loads.toml"
    loads.write_text(
        f"[[load]]\n\n[[load]]\nmass_kg = {HIGH.mass_kg}\nheight_m = {-HIGH.z_m}\n\n[[load]]\nunknown = true\n\n"
        f"[known]\nk = {k}\n"
    )
    on_board: tuple[Load, ...] = (NOMINAL, HIGH, UNKNOWN)
    files = [write_csv(tmp_path / f"load-{i}.csv", trial(SHIP, load, i)) for i, load in enumerate(on_board)]
    outcome = roll(files, tmp_path / "out", loads=loads, vessel=rough)
    assert {path.name for path in outcome.files} == {"roll.json", "roll.html", "vessel-roll.toml"}
    found = json.loads((tmp_path / "out" / "roll.json").read_text())["parameters"]
    truth = {**SHIP.pendulum.parameters, "m": UNKNOWN.mass_kg, "z_m": UNKNOWN.z_m}
    for name in PARAMETERS[1:]:
        assert abs(found[name]["value"] - truth[name]) < 4 * found[name]["std"], name
    fitted = load_vessel(tmp_path / "out" / "vessel-roll.toml")
    assert fitted.pendulum is not None
    assert fitted.pendulum.parameters == {name: found[name]["value"] for name in ROLL_PARAMETERS}
    assert set(fitted.pendulum.parameter_std) == set(ROLL_PARAMETERS) - {"k"}
    again = simulate(fitted, orders(fitted, 400, np.random.default_rng(9)), velocity=UNDER_WAY)
    assert again.auxiliary is not None


def test_ship_and_vessel_together_are_refused(tmp_path: Path) -> None:
    loads = tmp_path / "loads.toml"
    loads.write_text(
        "[ship]\nmass_kg = 1.0\nmass_height_m = 0.0\nsensor_height_m = 1.0\nbeam_m = 1.0\nperiod_s = 1.0\n\n[[load]]\n"
    )
    with pytest.raises(FileError, match=r"ship: is given, and \[roll\] of vessel 'roll-model' too"):
        roll([tmp_path / "none.csv"], tmp_path / "out", loads=loads, vessel=ROLL_MODEL)
    loads.write_text("[[load]]\n")
    with pytest.raises(FileError, match=r"ship: is missing, expected this table, or --vessel"):
        roll([tmp_path / "none.csv"], tmp_path / "out", loads=loads)


def test_a_design_says_in_one_line_that_it_leaves_roll_out(tmp_path: Path) -> None:
    scenario = tmp_path / "trial.toml"
    text = (SCENARIOS / "roll-trial.toml").read_text().replace("vessels/roll-model.toml", str(ROLL_MODEL))
    text = text.replace('"areas/', f'"{SCENARIOS}/areas/').replace("dictionaries/roll-model.toml", "one.toml")
    primitive = (
        "[[primitives]]\n" + (SCENARIOS / "dictionaries/roll-model.toml").read_text().split("[[primitives]]\n")[1]
    )
    (tmp_path / "one.toml").write_text(f'[dictionary]\nname = "one"\n\n{primitive}')
    scenario.write_text(text)
    with_roll = score(scenario, tmp_path / "roll").document.notes
    assert NOT_ACTING_BACK in with_roll
