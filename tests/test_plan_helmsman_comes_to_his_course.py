"""A ship with a helm that is beside its track is steady on it by the end of a run-up, also when not the nominal one."""

import numpy as np
import pytest

from expdesign.conventions import wrap_angle
from expdesign.plan.control import Helmsman
from expdesign.plan.control.ships import HELM_RUN_UP_HULLS
from expdesign.plan.monte_carlo.procedure import YAW_RATE_SHARE
from expdesign.plan.monte_carlo.tuning import MONTE_CARLO
from expdesign.plan.runs.ensemble import Fleet, Truths
from expdesign.simulation import CALM
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
    assert np.abs(wrap_angle(fleet.states[:, 2])).max() < MONTE_CARLO.heading_rad
    assert np.abs(fleet.states[:, 5]).max() < YAW_RATE_SHARE * water.ship.yaw_rate_radps
