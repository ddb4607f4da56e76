"""Models whose terms read the actuators themselves: commands that give any motion, and every family sails them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.dictionary import PrimitiveSpec, build_primitive
from expdesign.dictionary.build import deviation
from expdesign.dictionary.families import FAMILIES
from expdesign.dictionary.trim import drift, hold, lost, trim
from expdesign.errors import Unreachable
from expdesign.scenario import load_vessel
from expdesign.vessel import VesselModel, by_force, commands_for, pushed_everywhere, required_push
from expdesign.vessel.thrusts import required_thrust, thrusts
from expdesign.workflows.commands.new import KINDS

TEMPLATES = Path(__file__).parents[1] / "expdesign" / "templates"
SHIPS = {kind: load_vessel(TEMPLATES / kind / "vessel.toml") for kind in KINDS}
SPEEDS = {"azimuth": 4.0, "twin-screw": 4.0, "propeller-rudder": 4.0, "asv": 1.2, "model-ship": 0.8}
STRAIGHT = ("acceleration", "deceleration")
SLOW = ("inward_spiral", "sway_step", "sway_zigzag", "turning_circle")  # motions within what the thrusters give
AGILE = ("azimuth", "twin-screw")


@pytest.mark.parametrize("kind", KINDS)
def test_a_ship_is_pushed_everywhere_where_thrusters_push_ahead_sideways_and_round(kind: str) -> None:
    assert not by_force(SHIPS[kind].model)
    assert pushed_everywhere(SHIPS[kind].model) is (kind in AGILE)


@pytest.mark.parametrize("kind", KINDS)
def test_commands_for_an_acceleration_that_some_commands_give_give_it(kind: str) -> None:
    """Random commands within limits give accelerations; the commands found for these give the same ones."""
    vessel, speed, rng = SHIPS[kind], SPEEDS[kind], np.random.default_rng(1)
    count, limits = 60, vessel.limits
    motion = rng.uniform(-1, 1, (count, 3)) * np.array([speed, speed / 8, speed / 8 / vessel.length_m])
    motion[:, 0] = np.abs(motion[:, 0])
    free = vessel.turns_freely
    low = np.where(free, -np.pi, [limit.low for limit in limits])
    high = np.where(free, np.pi, [limit.high for limit in limits])
    given = 0.5 * rng.uniform(low, high, (count, len(limits)))
    wanted = drift(vessel, motion, given)
    push = required_push(vessel.model, motion, wanted)
    found = commands_for(vessel.model, push[:, None], sample_time_s=vessel.sample_time_s)[:, 0]
    missed = np.abs(drift(vessel, motion, found) - wanted) / np.abs(wanted).max(axis=0)
    assert ((found >= low - 1e-9) | free).all()
    assert ((found <= high + 1e-9) | free).all()
    assert np.median(missed.max(axis=1)) < 1e-9
    assert np.mean(missed.max(axis=1) < 1e-6) >= 0.8  # others lie beyond a corner of |n|


@pytest.mark.parametrize("kind", KINDS)
def test_the_commands_for_many_motions_are_those_for_each(kind: str) -> None:
    model, speed = SHIPS[kind].model, SPEEDS[kind]
    motions = speed * np.array([[0.5, 0.0, 0.0], [0.2, 0.02, 0.0], [0.9, 0.0, 0.0]])
    together = required_thrust(model, motions, np.zeros(3))
    assert np.allclose(together, [required_thrust(model, motion, np.zeros(3)) for motion in motions], atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_symmetric_ship_goes_straight_with_equal_commands_on_both_sides(kind: str) -> None:
    vessel = SHIPS[kind]
    for share in (0.2, 0.6, 1.0):
        velocity = np.array([share * SPEEDS[kind], 0.0, 0.0])
        inputs = dict(zip(vessel.model.inputs, hold(vessel, velocity).tolist(), strict=True))
        assert lost(vessel, velocity, np.array(list(inputs.values()))) < 1e-6
        if "n2" in inputs:
            assert inputs["n1"] == pytest.approx(inputs["n2"], rel=1e-6)


@pytest.mark.parametrize("kind", AGILE)
def test_thrust_that_grows_with_the_square_needs_half_the_speed_for_a_quarter(kind: str) -> None:
    """At rest nothing but n|n| acts, so commands for a quarter of an acceleration are half as fast."""
    model, rest = SHIPS[kind].model, np.zeros(3)
    wanted = 1e-3 * np.array([3.0, 1.0, 0.5 / SHIPS[kind].length_m])
    whole, quarter = (required_thrust(model, rest, share * wanted) for share in (1.0, 0.25))
    assert np.allclose(quarter, whole / 2, rtol=1e-6, atol=1e-9 * np.abs(whole).max())


def test_beyond_its_limits_a_ship_gives_no_more_than_these_and_says_so() -> None:
    vessel = SHIPS["azimuth"]
    fast = np.array([8.0, 0.0, 0.0])
    inputs = trim(vessel, fast)
    assert np.abs(inputs[[0, 2]]) == pytest.approx([4.0, 4.0])
    with pytest.raises(Unreachable, match=r"cannot hold its entry state u = 8 m/s.*they reach u = 6\.\d+ m/s"):
        hold(vessel, fast)


def test_a_thruster_with_less_astern_than_ahead_is_never_turned_round_and_reversed() -> None:
    """u|n|cos(a) differs from what is left after half a turn and astern, u|n|cos(a)^2 does not."""
    vessel = SHIPS["azimuth"]
    assert [each.limits[0].low for each in thrusts(vessel.model).actuators[:2]] == [-4.0, -4.0]
    terms = [
        type(term)(term.equation, term.name, "u*abs(n1)*cos(a1)+u*abs(n2)*cos(a2)") if term.name == "X_uT" else term
        for term in vessel.model.terms
    ]
    other = VesselModel(
        terms=tuple(terms),
        parameters=vessel.model.parameters,
        parameter_std=vessel.model.parameter_std,
        form="continuous",
        sample_time_s=1.0,
        actuators=vessel.actuators,
    )
    assert [each.limits[0].low for each in thrusts(other).actuators[:2]] == [0.0, 0.0]


def specifications(kind: str) -> list[PrimitiveSpec]:
    """One run of every family that is not a file, at moderate settings of the ship's size."""
    speed, pace_s = SPEEDS[kind], SHIPS[kind].length_m / SPEEDS[kind]
    own = {
        "duration_s": 8 * pace_s, "period_s": 4 * pace_s, "helm_period_s": 4 * pace_s, "engine_period_s": 6 * pace_s,
        "speed_mps": 0.5 * speed, "from_speed_mps": 0.3 * speed, "to_speed_mps": 0.2 * speed,
        "turn_speed_mps": 0.4 * speed, "sway_mps": 0.01 * speed, "yaw_rate_radps": 0.03 / pace_s,
        "speed_swing_mps": 0.1 * speed, "entry_s": 3 * pace_s, "rise_s": 2 * pace_s, "hold_s": 3 * pace_s,
        "helm_rad": 0.2, "engine_swing": 0.1, "astern_fraction": 0.2,
    }  # fmt: skip
    made = []
    for family in FAMILIES:
        if family.name == "recorded":
            continue
        settings = {item.name: own.get(item.name, item.default) for item in family.settings}
        assert None not in settings.values(), (family.name, settings)
        made.append(PrimitiveSpec(name=family.name, family=family.name, settings=settings))
    return made


@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
def test_every_family_sails_with_every_kind_of_ship(kind: str) -> None:
    """And where a ship is pushed everywhere, and at once, she follows slow motions."""
    vessel = SHIPS[kind]
    prompt = tuple(replace(actuator, responses=()) for actuator in vessel.actuators)
    quick = replace(vessel, model=replace(vessel.model, actuators=prompt))
    for spec in specifications(kind):
        item = build_primitive(vessel, spec)
        commands = item.commands.values
        limits = np.array([(limit.low, limit.high) for limit in vessel.limits])
        assert (commands >= limits[:, 0] - 1e-9).all(), spec.name
        assert (commands <= limits[:, 1] + 1e-9).all(), spec.name
        assert np.isfinite(item.trajectory.velocity).all(), spec.name
        if spec.family in STRAIGHT or (kind in AGILE and spec.family in SLOW):
            assert deviation(build_primitive(quick, spec)) < 0.15, spec.name
