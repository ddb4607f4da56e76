"""Azimuths whose propellers do not reverse go astern as a mate lets them: stopped, turned half round, and on."""

from dataclasses import replace

import numpy as np
import pytest

from expdesign.conventions import wrap_angle
from expdesign.dictionary import PrimitiveSpec, build_primitive, complete_settings, family
from expdesign.indices.outcomes import simulated_stop
from expdesign.particulars.card import Trial
from expdesign.particulars.trials import Fleet as Variants
from expdesign.plan.control import HelmShip, Helmsman
from expdesign.plan.legs import LegTask
from expdesign.plan.legs.helm import helm_leg
from expdesign.plan.runs import Fleet, Truths
from expdesign.plan.values import WorkBudget
from expdesign.simulation import CALM, Conduct, Helm, steady_ahead, stopping
from expdesign.vessel import Response, Vessel
from helm_case import ahead_only, coaster, offshore_vessel, open_water

SHIP = ahead_only(offshore_vessel())
SPEED = 3.0


def pushes_astern(vessel: Vessel, rows: np.ndarray) -> np.ndarray:
    """(k,) whether the stern thrusters give thrust, and all of it astern."""
    thrust, angles = rows[:, [0, 2]], rows[:, [1, 3]]
    return np.asarray(((thrust > 0.0) & (np.cos(angles) < 0.0)).all(axis=1))


def test_orders_astern_push_as_propellers_that_reverse_would() -> None:
    turning, reversing = Helm(vessel=SHIP), Helm(vessel=offshore_vessel())
    assert {one.starboard_m: way for one, way in turning.turning_round.items()} == {-3.0: -np.pi, 3.0: np.pi}
    assert not reversing.turning_round
    astern, ahead = (np.array(helm.inputs(order, 0.3)) for helm, order in ((turning, -0.5), (reversing, 0.5)))
    push = astern[0] * np.exp(1j * astern[[1, 3]])
    np.testing.assert_allclose(push, -ahead[0] * np.exp(1j * ahead[[1, 3]]), atol=1e-12)
    orders = np.array([-1.0, -0.3, 0.0, 0.4, 1.0])
    np.testing.assert_allclose(turning.drives(turning.rows(orders, 0.2 * orders)), orders, atol=1e-12)


@pytest.mark.parametrize("rate", [np.inf, 0.3])
def test_no_thrust_is_given_until_the_thrusters_have_turned(rate: float) -> None:
    """Each turns by its own side, so that nothing turns her meanwhile."""
    actuators = tuple(
        replace(one, responses=(Response(rate=rate), *one.responses[1:])) if one.kind == "azimuth" else one
        for one in SHIP.actuators
    )
    ship = replace(SHIP, model=replace(SHIP.model, actuators=actuators))
    commands, motion = stopping(ship, conduct=Conduct(speed_mps=SPEED))
    rows = commands.values
    turning = (np.abs(np.cos(rows[:, 1])) < 0.999) & (np.abs(np.diff(rows[:, 1], prepend=0.0)) > 0.1)
    assert turning.sum() * ship.sample_time_s > 0.8 * np.pi / 0.2
    assert (rows[turning, 0] < 0.25 * ship.limits[0].high).all()
    assert pushes_astern(ship, rows).any()
    assert np.abs(np.diff(rows, axis=0)).max(axis=0)[1] <= 0.2 * ship.sample_time_s * (1 + 1e-9)
    np.testing.assert_allclose(rows[:, 1], -rows[:, 3], atol=1e-9)
    assert np.abs(motion.pose[:, 1:]).max() < 1e-6
    assert motion.velocity[-2, 0] > 0.0 >= motion.velocity[-1, 0]


def test_a_stop_is_the_same_for_indices_cards_and_dictionaries() -> None:
    _, motion = stopping(SHIP, conduct=Conduct(speed_mps=SPEED))
    reach_m = float(motion.pose[-1, 0])
    assert simulated_stop(SHIP, conduct=Conduct(speed_mps=SPEED)).track_reach_m == pytest.approx(reach_m, rel=1e-2)
    fleet = Variants(SHIP, SHIP.model.parameters[None], fastest_mps=30.0)
    found = fleet.results(Trial(kind="stop", speed_mps=SPEED))["reach_m"]
    assert found[0] == pytest.approx(reach_m, rel=0.02)
    settings = complete_settings(family("crash_stop"), {"duration_s": 200.0, "speed_mps": SPEED})
    run = build_primitive(SHIP, PrimitiveSpec(name="stop", family="crash_stop", settings=settings))
    last = int(np.argmax(run.trajectory.velocity[:, 0] <= 0.0))
    assert last > 0
    assert run.trajectory.pose[last, 0] == pytest.approx(reach_m, rel=0.1)


def test_drawn_ships_brake_on_their_course_and_turn_their_thrusters_no_oftener_than_they_must() -> None:
    found, count = open_water(SHIP).ship, 30
    assert isinstance(found, HelmShip)
    ship = replace(found, hovers=False)  # at rest, too, she has her helm alone
    rng = np.random.default_rng(3)
    drawn = SHIP.model.parameters * (1.0 + 0.1 * rng.uniform(-1, 1, (count, len(SHIP.model.parameters))))
    truths = Truths(parameters=drawn, current_to=np.zeros((count, 2)), wind_to=np.zeros((count, 2)))
    start, standing = np.array([0.0, 0.0, 0.05, SPEED, 0.0, 0.0]), steady_ahead(SHIP, SPEED).inputs
    fleet = Fleet(SHIP, CALM, truths, state=start, standing=standing, rng=rng)
    helm, unexplained, rows = Helmsman(vessel=SHIP, environment=CALM, ship=ship), np.zeros((count, 3)), []
    for _ in range(100):
        before = fleet.states
        desired = np.column_stack([before[:, :2], 0 * before[:, :1], np.zeros(count), 0 * before[:, :2]])
        fleet.advance(helm.commands(desired, before, fleet.given, unexplained=unexplained))
        unexplained = helm.unexplained(unexplained, before, fleet.states, fleet.delivered)
        rows.append(fleet.given.copy())
    given = np.array(rows)
    assert pushes_astern(SHIP, given.reshape(-1, given.shape[-1])).any()
    sides = np.cos(given[:, :, 1]) < 0.0
    assert np.abs(np.diff(sides, axis=0)).sum(axis=0).max() <= 2
    assert np.median(fleet.states[:, 3]) == pytest.approx(0.0, abs=0.2)
    assert np.mean(np.abs(wrap_angle(fleet.states[:, 2])) < np.radians(8.0)) > 0.9


@pytest.mark.thorough
def test_a_leg_ends_at_rest_with_thrusters_where_they_stopped_her() -> None:
    water, rest = open_water(SHIP), np.zeros(len(SHIP.limits))
    approach = water.ship.approach
    task = LegTask(
        start=np.array([0.0, 0.0, 0.0, *approach.velocity]),
        end=np.array([700.0, 150.0, 0.3, 0.0, 0.0, 0.0]),
        start_inputs=approach.inputs,
        end_inputs=rest,
        seed=0,
        before=approach.inputs[None],
        budget=WorkBudget(most_s=40.0),
    )
    found = helm_leg(task, water, water.ship)
    assert found is not None
    assert pushes_astern(SHIP, found.commands).any()
    assert np.abs(found.commands[-1, [0, 2]]).max() < 1e-6
    assert np.abs(np.cos(found.commands[-1, [1, 3]]) + 1.0).max() < 1e-3
    assert np.abs(found.commands[:, [1, 3]]).max() < 1.5 * np.pi  # not wound up


def test_ships_that_reverse_are_ordered_as_before() -> None:
    for ship in (coaster(), offshore_vessel()):
        helm, order = Helm(vessel=ship), np.linspace(-1.0, 1.0, 7)
        assert helm.lever_rate == helm.drive_rate
        np.testing.assert_array_equal(helm.moved_rows(order, 0.1 * order), helm.rows(order, 0.1 * order))
        np.testing.assert_array_equal(helm.lever(order), order)
