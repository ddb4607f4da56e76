"""A ship with a helm that is beside its track is steady on it by the end of a run-up, also when not the nominal one."""

from dataclasses import replace

import numpy as np
import pytest

from expdesign.conventions import wrap_angle
from expdesign.plan.control import HelmShip, Helmsman, capability
from expdesign.plan.control.ships import HELM_RUN_UP_HULLS
from expdesign.plan.legs import recover
from expdesign.plan.monte_carlo.procedure import HEADING_RAD, YAW_RATE_SHARE
from expdesign.plan.runs import Fleet, Truths
from expdesign.plan.values import PlanSettings
from expdesign.scenario import load_vessel
from expdesign.simulation import CALM
from expdesign.vessel import Vessel
from expdesign.workflows import new
from helm_case import coaster, open_water


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_ship_beside_the_track_is_steady_on_it_when_the_run_begins(side):
    vessel, water, count = coaster(), open_water(coaster()), 8
    rng = np.random.default_rng(1)
    model, speed = vessel.model, water.ship.transit_speed_mps
    drawn = model.parameters * (1.0 + 0.1 * rng.uniform(-1, 1, (count, len(model.parameters))))
    truths = Truths(parameters=drawn, current_to=np.zeros((count, 2)), wind_to=np.zeros((count, 2)))
    start = np.array([0.0, side * vessel.length_m / 2, 0.0, speed, 0.0, 0.0])
    standing = np.zeros(len(vessel.limits))
    standing[0] = water.ship.approach.helm.inputs(water.ship.approach.drive, 0.0)[0]
    fleet = Fleet(vessel, CALM, truths, state=start, standing=standing, rng=rng)
    helm = Helmsman(vessel=vessel, environment=CALM, ship=water.ship)
    unexplained = np.zeros((count, 3))
    for _ in range(int(HELM_RUN_UP_HULLS * vessel.length_m / speed / vessel.sample_time_s)):
        before = fleet.states
        desired = np.column_stack([before[:, :1], 0 * before[:, :2], np.full((count, 1), speed), 0 * before[:, :2]])
        fleet.advance(helm.commands(desired, before, fleet.given, unexplained=unexplained))
        unexplained = helm.unexplained(unexplained, before, fleet.states, fleet.delivered)
    assert np.abs(wrap_angle(fleet.states[:, 2])).max() < HEADING_RAD
    assert np.abs(fleet.states[:, 5]).max() < YAW_RATE_SHARE * water.ship.yaw_rate_radps


@pytest.fixture(scope="module")
def azimuths(tmp_path_factory: pytest.TempPathFactory) -> Vessel:
    """An offshore vessel that two stern azimuths drive and steer."""
    folder = tmp_path_factory.mktemp("new") / "trial"
    new(folder, kind="azimuth")
    return load_vessel(folder / "vessel.toml")


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_ship_steered_by_azimuths_keeps_her_course_while_they_push_astern(azimuths: Vessel, side: float) -> None:
    """Turned thrust acts the other way round astern: a helm that did not know would turn her broadside."""
    ship = capability(azimuths, PlanSettings())
    helm, speed = Helmsman(vessel=azimuths, environment=CALM, ship=ship), ship.transit_speed_mps
    truths = Truths(parameters=azimuths.model.parameters[None], current_to=np.zeros((1, 2)), wind_to=np.zeros((1, 2)))
    start = np.array([0.0, 0.0, side * np.radians(2.0), speed, 0.0, 0.0])
    standing = np.array(ship.approach.inputs)
    fleet = Fleet(azimuths, CALM, truths, state=start, standing=standing, rng=np.random.default_rng(0))
    astern = 0
    for _ in range(60):
        desired = np.column_stack([fleet.states[:, :1], [[0.0, 0.0, 0.2 * speed, 0.0, 0.0]]])
        fleet.advance(helm.commands(desired, fleet.states, fleet.given))
        astern += ship.approach.helm.drives(fleet.given)[0] < -0.1
    assert astern > 5  # it brakes
    assert fleet.states[0, 3] < 0.5 * speed
    assert abs(wrap_angle(fleet.states[0, 2])) < HEADING_RAD


def test_engine_orders_are_read_from_commands(azimuths: Vessel) -> None:
    helm = capability(azimuths, PlanSettings()).approach.helm
    orders = np.array([-1.0, -0.3, 0.0, 0.4, 1.0])
    np.testing.assert_allclose(helm.drives(helm.rows(orders, 0.2 * orders)), orders, atol=1e-12)
    assert helm.turns_thrust
    assert not open_water(coaster()).ship.approach.helm.turns_thrust


PARTICULARS = {
    "X_uu": -0.00106, "X_vr": 1.49, "X_T1": 0.0026, "X_T2": 0.0026, "X_uT": -0.0015, "Y_uv": -0.015, "Y_vv": -0.026,
    "Y_ur": -0.5, "Y_T1": 0.0016, "Y_T2": 0.0016, "N_uv": -0.0035, "N_ur": -0.045, "N_rr": -0.6, "N_T1": 1.57e-5,
    "N_T2": 1.57e-5,
}  # fmt: skip
"""Of an offshore vessel of 45 m by published regressions: a small turn grows by itself, and her thrust is modest."""


@pytest.fixture(scope="module")
def lively(azimuths: Vessel) -> tuple[Vessel, HelmShip]:
    """An offshore vessel that is unstable on her course, and what she can do."""
    own = dict(zip(azimuths.model.names, azimuths.model.parameters.tolist(), strict=True))
    vessel = replace(azimuths, model=azimuths.model.with_parameters(own | PARTICULARS))
    ship = capability(vessel, PlanSettings())
    tilt, speed = 1e-6, ship.transit_speed_mps
    columns = [
        vessel.model.accelerations((speed, *(tilt * unit)), (speed, tilt * unit[0]), ship.approach.inputs)[1:]
        for unit in np.eye(2)
    ]
    assert np.linalg.eigvals(np.array(columns).T / tilt).real.max() > 0.5 * speed / vessel.length_m
    return vessel, ship


def northward(vessel: Vessel, ship: HelmShip, start: list[float], speed_mps: float) -> tuple[np.ndarray, np.ndarray]:
    """(k, 40, 6) states and (k, 40) engine orders of ships up to 30 % off the nominal one that are to go north."""
    rng, count = np.random.default_rng(2), 40
    drawn = vessel.model.parameters * (1.0 + 0.3 * rng.uniform(-1, 1, (count, len(vessel.model.parameters))))
    truths = Truths(parameters=drawn, current_to=np.zeros((count, 2)), wind_to=np.zeros((count, 2)))
    fleet = Fleet(vessel, CALM, truths, state=np.array(start), standing=np.array(ship.approach.inputs), rng=rng)
    helm, unexplained = Helmsman(vessel=vessel, environment=CALM, ship=ship), np.zeros((count, 3))
    states, orders = [], []
    for _ in range(int(25 * vessel.length_m / ship.transit_speed_mps / vessel.sample_time_s)):
        before = fleet.states
        desired = np.column_stack([before[:, :2], 0 * before[:, :1], np.full(count, speed_mps), 0 * before[:, :2]])
        fleet.advance(helm.commands(desired, before, fleet.given, unexplained=unexplained))
        unexplained = helm.unexplained(unexplained, before, fleet.states, fleet.delivered)
        states.append(fleet.states.copy())
        orders.append(ship.approach.helm.drives(fleet.given))
    return np.array(states), np.array(orders)


def test_ships_that_are_unstable_on_their_course_come_to_it_and_keep_it(lively: tuple[Vessel, HelmShip]) -> None:
    vessel, ship = lively
    speed = ship.transit_speed_mps
    states, _ = northward(vessel, ship, [0.0, 0.0, np.radians(30.0), speed, 0.0, 0.0], speed)
    assert np.mean(np.abs(wrap_angle(states[-1, :, 2])) < HEADING_RAD) > 0.95


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_azimuths_stop_a_turn_before_they_slow_her_down(lively: tuple[Vessel, HelmShip], side: float) -> None:
    """Without the thrust that steers, she would turn on until she goes another way."""
    vessel, ship = lively
    turning = [0.0, 0.0, 0.0, ship.transit_speed_mps, -0.6 * side, 0.03 * side]
    states, orders = northward(vessel, ship, turning, 0.5 * ship.transit_speed_mps)
    assert np.median(np.abs(wrap_angle(states[:, :, 2])).max(axis=0)) < np.radians(30.0)
    assert (orders[:12] > 0.0).all()
    assert np.abs(states[-1, :, 3] / ship.transit_speed_mps - 0.5).max() < 0.2


def test_wound_azimuths_steer_by_the_shortest_turn(lively: tuple[Vessel, HelmShip]) -> None:
    """Runs leave azimuths without stops whole turns away; unwinding them would push all round meanwhile."""
    vessel, ship = lively
    helm, rng = Helmsman(vessel=vessel, environment=CALM, ship=ship), np.random.default_rng(4)
    states = rng.normal(size=(30, 6)) * [50.0, 50.0, 1.0, 1.0, 0.3, 0.02] + [0.0, 0.0, 0.0, 3.0, 0.0, 0.0]
    desired = np.tile([0.0, 0.0, 0.0, ship.transit_speed_mps, 0.0, 0.0], (30, 1))
    standing = ship.approach.inputs + rng.uniform(-0.2, 0.2, (30, len(vessel.limits)))
    turns = 2.0 * np.pi * rng.integers(-3, 4, standing.shape) * vessel.turns_freely
    unwound = helm.commands(desired, states, standing)
    assert turns.any()
    np.testing.assert_allclose(helm.commands(desired, states, standing + turns), unwound + turns, atol=1e-9)


@pytest.mark.parametrize("turns", [0, 2])
def test_the_check_of_a_turn_ends_where_counter_helm_does_little_more(
    lively: tuple[Vessel, HelmShip], turns: int
) -> None:
    """Sway keeps a ship that is unstable on her course turning slowly: lengths ahead on which no leg can turn her."""
    vessel, ship = lively
    water = replace(open_water(vessel), ship=ship)
    over = ship.approach.inputs + 0.35 * vessel.angles + 2.0 * np.pi * turns * vessel.turns_freely
    turning = np.array([0.0, 0.0, 0.0, 3.6, -0.35, 0.012])
    found = recover(turning, over[None], water, ship)
    assert abs(found.states[-1, 5]) < 0.8 * turning[5]
    assert np.hypot(*found.states[-1, :2]) < 2.5 * vessel.length_m
    wound = 2.0 * np.pi * turns * vessel.turns_freely
    assert (np.abs(found.commands - wound)[:, vessel.turns_freely] < np.pi / 2).all()
