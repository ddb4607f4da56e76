"""A ship with a helm that is beside its track is steady on it by the end of a run-up, also when not the nominal one."""

import numpy as np
import pytest

from expdesign.conventions import wrap_angle
from expdesign.plan.control import Helmsman, capability
from expdesign.plan.control.ships import HELM_RUN_UP_HULLS
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
