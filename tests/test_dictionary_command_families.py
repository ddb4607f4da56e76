"""Families that give commands work on any vessel, also one whose model reads propeller and rudder directly."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from design_case import SCENARIOS, one_line, spec, vessel
from expdesign.dictionary import FAMILIES, PrimitiveSpec, build_primitive, complete_settings, family
from expdesign.dictionary.trim import STEADY_CHANGE, lost
from expdesign.errors import InputError, Unreachable
from expdesign.export.files.design_files import dictionary_files
from expdesign.information import score_primitives
from expdesign.scenario import load_dictionary
from expdesign.simulation import Conduct, simulate, simulate_many, steady_ahead, zigzag
from rudder_ship import rudder_ship

ORDERED = tuple(item for item in FAMILIES if item.orders is not None and item.name != "recorded")
SETTINGS = {
    "crash_stop": {"speed_mps": 4.0},
    "turning_circle_helm": {"speed_mps": 4.0},
    "zigzag_heading": {"speed_mps": 4.0},
    "pull_out": {"speed_mps": 4.0},
    "dieudonne_spiral": {"speed_mps": 4.0},
    "throttle_steps": {"speed_mps": 4.0, "rise": 1.1},
    "rudder_steps": {"speed_mps": 4.0},
    "helm_and_engine_waves": {"speed_mps": 4.0, "helm_rad": 0.1, "helm_period_s": 30.0, "engine_period_s": 50.0},
    "steps": {"speed_mps": 4.0, "helm_rad": 0.3, "hold_s": 10.0, "engine_swing": 0.3},
}


SHIPS = {"propeller and rudder": rudder_ship(), "azimuths": vessel("azimuth-30m"), "forces": vessel("model-ship")}


def request(name: str, ship: str = "propeller and rudder", **more: float) -> PrimitiveSpec:
    """A run of a family at a speed that suits the ship."""
    speed = {"propeller and rudder": 4.0, "azimuths": 1.2, "forces": 0.8}[ship]
    length = 240.0 if ship != "forces" else 40.0
    return spec(name, **{"duration_s": length, **SETTINGS[name], "speed_mps": speed, **more})


@pytest.mark.parametrize("ship", SHIPS)
@pytest.mark.parametrize("kind", ORDERED, ids=lambda kind: kind.name)
def test_commands_keep_limits_and_rates_and_begin_in_equilibrium(kind, ship: str):
    run = build_primitive(SHIPS[ship], request(kind.name, ship))
    low, high = (np.array([getattr(x, side) for x in SHIPS[ship].limits]) for side in ("low", "high"))
    rate = SHIPS[ship].rates
    commands = np.vstack([run.entry_inputs, run.commands.values])
    slack = 1e-9 * np.abs(commands).max()
    assert ((commands >= low - slack) & (commands <= high + slack)).all()
    assert (np.abs(np.diff(commands, axis=0)) <= rate * SHIPS[ship].sample_time_s + slack).all()
    assert lost(SHIPS[ship], run.entry_velocity, run.entry_inputs) <= STEADY_CHANGE
    again = simulate(SHIPS[ship], run.commands, velocity=run.entry_velocity)
    np.testing.assert_allclose(again.velocity, run.trajectory.velocity, atol=1e-9)


@pytest.mark.parametrize("name", ["turning_circle_helm", "zigzag_heading", "pull_out", "dieudonne_spiral"])
def test_positive_helm_turns_to_starboard_and_negative_helm_gives_the_mirror_image(name: str):
    starboard, port = (build_primitive(rudder_ship(), request(name, helm_rad=side * 0.2)) for side in (1, -1))
    assert starboard.trajectory.velocity[10, 2] > 0
    np.testing.assert_allclose(port.trajectory.velocity, starboard.trajectory.velocity * (1, -1, -1), atol=1e-9)


def test_a_zigzag_by_heading_is_the_standard_trial():
    ship, angle = rudder_ship(), np.radians(10.0)
    run = build_primitive(ship, request("zigzag_heading"))
    _, motion = zigzag(ship, heading_rad=angle, helm_rad=angle, conduct=Conduct(speed_mps=4.0, duration_s=240.0))
    np.testing.assert_allclose(run.trajectory.pose, motion.pose, atol=1e-6)
    assert np.abs(run.trajectory.pose[:, 2]).max() > angle  # it overshoots


def test_a_pull_out_of_a_stable_ship_goes_straight_again_and_a_circle_does_not():
    out, circle = (build_primitive(rudder_ship(), request(name)) for name in ("pull_out", "turning_circle_helm"))
    turning = np.abs(out.trajectory.velocity[:, 2]).max()
    assert abs(out.exit_velocity[2]) < 0.05 * turning
    assert abs(circle.exit_velocity[2]) > 0.5 * turning


@pytest.mark.parametrize("ship", SHIPS)
def test_a_crash_stop_ends_the_way_ahead_and_does_not_go_astern(ship: str):
    run = build_primitive(SHIPS[ship], request("crash_stop", ship))
    u = run.trajectory.velocity[:, 0]
    still = int(np.argmax(u <= 0.0))
    assert still > 0  # in time
    assert u.min() > -0.25 * u[0]  # what the propeller still does while it comes to rest
    assert not run.commands.values[-1].any()  # engines are stopped
    longer = build_primitive(SHIPS[ship], request("crash_stop", ship, astern_fraction=1.0))
    np.testing.assert_array_equal(longer.trajectory.velocity[: still + 1], run.trajectory.velocity[: still + 1])
    assert longer.trajectory.velocity[-1, 0] < u.min()  # goes astern for as long as it is told to


def test_a_crash_stop_takes_the_way_off_faster_than_idling():
    hard, idle = (build_primitive(rudder_ship(), request("crash_stop", astern=share)) for share in (1.0, 0.0))
    assert hard.trajectory.velocity[-1, 0] < 0 < idle.trajectory.velocity[-1, 0]


def test_a_stop_without_a_stated_time_lasts_until_ships_of_the_prior_lie_still():
    """95 of 100 other ships than those that gave the time, within four standard errors; of a known ship, just her."""
    ship, count = rudder_ship(), 400
    known = replace(ship, model=replace(ship.model, parameter_std=np.zeros(len(ship.model.names)), unstated_std={}))
    spec = request("crash_stop", duration_s=0.0)
    alone = build_primitive(known, spec)
    assert alone.exit_velocity[0] <= 0.0 < alone.trajectory.velocity[-3, 0]
    model = replace(ship.model, parameter_std=0.1 * np.abs(ship.model.parameters), unstated_std={})
    run = build_primitive(replace(ship, model=model), spec)
    assert run.duration_s > alone.duration_s
    states = simulate_many(
        ship, run.commands, pose=np.zeros((count, 3)), velocity=np.tile(run.entry_velocity, (count, 1)),
        current_to=np.zeros((count, 2)), wind_to=np.zeros((count, 2)), standing=run.entry_inputs,
        parameters=model.drawn_parameters(count, np.random.default_rng(8)),
    )  # fmt: skip
    stopped = (states[:, :, 3] <= 0.0).any(axis=0).mean()
    assert abs(stopped - 0.95) < 4 * np.sqrt(0.95 * 0.05 * (1 / count + 1 / 200))


def test_a_ship_that_does_not_stop_needs_a_stated_time():
    with pytest.raises(InputError, match=r"does not lie still .* expected a duration_s") as caught:
        build_primitive(rudder_ship(), request("crash_stop", duration_s=0.0, astern=0.0))
    assert one_line(caught.value)


def test_helm_that_the_actuators_cannot_give_is_refused_with_file_and_key():
    hard = request("turning_circle_helm", helm_rad=1.2)
    placed = PrimitiveSpec(name="hard", family=hard.family, settings=hard.settings, place="d.toml: primitives[3]")
    with pytest.raises(
        InputError, match=r"^d.toml: primitives\[3\]: primitive 'hard': .*68.75 deg needs rudder1"
    ) as caught:
        build_primitive(rudder_ship(), placed)
    assert one_line(caught.value)


@pytest.mark.parametrize("kind", [item for item in FAMILIES if item.reference is not None], ids=lambda kind: kind.name)
def test_motions_out_of_reach_of_direct_models_are_refused_with_file_and_key(kind, tmp_path: Path):
    path = tmp_path / "requests.toml"
    needed = {item.name: 1.0 for item in kind.settings if item.default is None} | {"duration_s": 30.0}
    needed |= {item.name: 50.0 for item in kind.settings if item.name.endswith("speed_mps")}
    given = {**needed, **({"period_s": 10.0} if "period_s" in needed else {})}
    lines = "\n".join(f"{name} = {value}" for name, value in given.items())
    path.write_text(f'[dictionary]\nname = "d"\n[[primitives]]\nfamily = "{kind.name}"\n{lines}\n', encoding="utf-8")
    (request_,) = load_dictionary(path)
    with pytest.raises(
        Unreachable,
        match=r"requests.toml: primitives\[1\]: primitive .*the actuators cannot hold its entry state u = 50",
    ):
        build_primitive(rudder_ship(), request_)


def test_a_direct_model_can_be_scored_from_helm_and_engine_alone():
    ship = rudder_ship()
    runs = [build_primitive(ship, request(kind.name)) for kind in ORDERED]
    information = score_primitives(ship, runs, mean_subtraction="none")
    total = np.mean([item.X for item in information], axis=0)
    scale = np.sqrt(np.diag(total))
    assert np.linalg.eigvalsh(total / np.outer(scale, scale))[0] > 1e-6


def test_the_approach_is_the_standard_trials_approach():
    run = build_primitive(rudder_ship(), request("turning_circle_helm"))
    approach = steady_ahead(rudder_ship(), 4.0)
    np.testing.assert_allclose(run.entry_inputs, approach.inputs)
    np.testing.assert_allclose(run.entry_velocity, approach.velocity)


@pytest.mark.parametrize("ship", SHIPS)
def test_a_dictionary_with_recorded_runs_reads_back_the_same(ship: str, tmp_path: Path):
    first = request("steps", ship)
    run = build_primitive(SHIPS[ship], first)
    speed = float(run.entry_velocity[0])
    settings = complete_settings(family("recorded"), {"duration_s": run.duration_s, "speed_mps": speed})
    recorded = PrimitiveSpec(name="again", family="recorded", settings=settings, commands=run.commands)
    for name, text in dictionary_files([first, recorded], name="both", stem="grown").items():
        (tmp_path / name).write_text(text if isinstance(text, str) else text.decode(), encoding="utf-8")
    back = load_dictionary(tmp_path / "grown.toml")
    assert [item.settings for item in back] == [first.settings, settings]
    again = [build_primitive(SHIPS[ship], item) for item in back]
    for item in again:
        np.testing.assert_array_equal(item.commands.values, run.commands.values)
        np.testing.assert_allclose(item.trajectory.velocity, run.trajectory.velocity, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "row 1: has no column time_s"),
        ("time_s,depth\n0,1\n", "row 1: has no column of commands"),
        ("time_s,n1_rps\n0,1\n", "has 1 rows of commands, expected at least 2"),
        ("time_s,n1_rps\n0,1\n1,x\n", "row 3, n1_rps: is 'x', expected a number"),
        ("time_s,n1_rps\n0,1\n1\n", "row 3, n1_rps: is '', expected a number"),
        ("time_s,n1_rps\n0,1\n1,1\n3,1\n4,1\n", "row 4, time_s: is 3, expected even steps of 1 s"),
        ("time_s,n1_rps,n1_rps\n0,1,1\n", "row 1: names a column twice"),
    ],
)
def test_command_files_that_make_no_sense_are_refused_in_one_line(text: str, says: str, tmp_path: Path):
    (tmp_path / "made.csv").write_text(text, encoding="utf-8")
    body = '[dictionary]\nname = "d"\n[[primitives]]\nfamily = "recorded"\nfile = "made.csv"\n'
    (tmp_path / "d.toml").write_text(body, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_dictionary(tmp_path / "d.toml")
    assert says in str(caught.value)
    assert one_line(caught.value)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("", "primitives[1].file: is missing, expected the path of a CSV of commands"),
        ('file = "none.csv"', "primitives[1].file: names 'none.csv'"),
        ('file = "made.csv"\nduration_s = 3', "primitives[1].duration_s: is given"),
        ('file = "made.csv"\nspeed_mps = [1, 2]', "primitives[1].speed_mps: is a list, expected a number"),
    ],
)
def test_recorded_entries_that_make_no_sense_are_refused_in_one_line(line: str, says: str, tmp_path: Path):
    (tmp_path / "made.csv").write_text("time_s,tau_x,tau_y,tau_psi\n0,1,0,0\n0.125,1,0,0\n", encoding="utf-8")
    body = f'[dictionary]\nname = "d"\n[[primitives]]\nfamily = "recorded"\n{line}\n'
    (tmp_path / "d.toml").write_text(body, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_dictionary(tmp_path / "d.toml")
    assert says in str(caught.value)


def test_a_recorded_run_for_another_vessel_names_both():
    run = build_primitive(SHIPS["forces"], request("steps", "forces"))
    settings = complete_settings(family("recorded"), {"duration_s": run.duration_s})
    recorded = PrimitiveSpec(name="r", family="recorded", settings=settings, commands=run.commands)
    with pytest.raises(InputError, match="commands tau_x, tau_y, tau_psi, vessel 'rudder ship' takes n1, rudder1"):
        build_primitive(rudder_ship(), recorded)


def test_the_standard_trials_file_builds_and_holds_each_trial_to_both_sides():
    specs = load_dictionary(SCENARIOS / "dictionaries" / "imo-trials.toml")
    runs = {item.name: build_primitive(SHIPS["azimuths"], item) for item in specs}
    for stem in ("circle", "zigzag-10-10", "zigzag-20-20", "pull-out", "spiral"):
        starboard, port = (run for name, run in runs.items() if name.startswith(stem))
        np.testing.assert_allclose(
            port.trajectory.velocity, starboard.trajectory.velocity * (1, -1, -1), atol=1e-6, err_msg=stem
        )
    heading = runs["zigzag-10-10-helm-0.174533"].trajectory.pose[:, 2]
    assert heading.max() > np.radians(10.0)
    assert heading.min() < -np.radians(10.0)
    assert runs["circle-helm-0.610865"].trajectory.pose[-1, 2] > 2 * np.pi  # a full turn
    assert abs(runs["stop"].exit_velocity[0]) < 0.1 * 1.4
