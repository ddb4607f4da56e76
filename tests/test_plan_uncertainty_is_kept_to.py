from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from plan_case import area, ship
from test_plan_verification_catches_what_is_wrong import primitive

from expdesign.errors import NoPlan
from expdesign.plan.footprint import covering_discs
from expdesign.plan.safety import leave_water_probability
from expdesign.plan.uncertainty import stray_m
from expdesign.plan.values import Leg
from expdesign.simulation import CALM, Environment

CENTRES = covering_discs(30.0, 9.0)[0]


def certain(vessel):
    return replace(vessel, model=replace(vessel.model, parameter_std=np.zeros(len(vessel.model.names))))


def stray(vessel, environment=CALM, confidence=0.9, seed=0, draws=400):
    rng = np.random.default_rng(seed)
    return stray_m(
        vessel, primitive(vessel), environment, centres_m=CENTRES, confidence=confidence, rng=rng, draws=draws
    )


def test_nothing_uncertain_nothing_strays():
    assert stray(certain(ship())).max() < 1e-6


def test_a_known_mean_current_is_no_uncertainty():
    steady = Environment(current_to=np.array([0.3, -0.2]))
    assert stray(certain(ship()), steady).max() < 1e-6


def test_an_uncertain_current_strays_like_its_rayleigh_quantile():
    # the water carries the ship bodily: distance after t is t x |drawn current|, a Rayleigh variable
    vessel = certain(ship())
    spread = Environment(current_std_mps=0.05)
    draws, confidence = 4000, 0.9
    end = stray(vessel, spread, confidence, draws=draws)[-1]
    exact = 60.0 * 0.05 * np.sqrt(-2 * np.log(1 - confidence))
    density = (1 - confidence) * np.sqrt(-2 * np.log(1 - confidence)) / (60.0 * 0.05)
    error = np.sqrt(confidence * (1 - confidence) / draws) / density
    # entering water that moves, the ship lags by its own time constant: allow that besides four standard errors
    assert exact * 0.85 - 4 * error < end < exact + 4 * error


def test_higher_confidence_needs_more_room():
    low, high = stray(ship(), confidence=0.5), stray(ship(), confidence=0.99)
    assert (high[1:] > low[1:]).all()


def test_a_prior_of_unstable_ships_is_refused_with_its_reason():
    vessel = ship()
    std = np.array([1.0 if name == "X_abs_u_u" else 0.0 for name in vessel.model.names])
    wild = replace(vessel, model=replace(vessel.model, parameter_std=std))
    with pytest.raises(NoPlan, match="unstable for"):
        stray(wild, confidence=0.95)


def leave(vessel, water, environment=CALM, draws=400):
    run = primitive(vessel)
    total, by_leg = leave_water_probability(
        vessel,
        area(water),
        environment,
        commands=run.commands,
        trajectory=run.trajectory,
        legs=(Leg(kind="primitive", name="go", first=0, last=len(run.commands)),),
        rng=np.random.default_rng(1),
        draws=draws,
    )
    assert by_leg == (total,)
    return total


def test_a_certain_ship_leaves_never_or_always():
    vessel = certain(ship())
    assert leave(vessel, shapely.box(-100, -100, 100, 200)) == 0.0
    assert leave(vessel, shapely.box(-100, -100, 100, 30)) == 1.0


def test_half_of_the_currents_carry_the_ship_over_a_line_at_its_side():
    # the hull grazes the line with no current: it crosses when the drawn east current is to the east
    vessel = certain(ship())
    draws = 1000
    share = leave(vessel, shapely.box(-300, -100, 4.5 + 1e-6, 300), Environment(current_std_mps=0.05), draws)
    assert abs(share - 0.5) < 4 * np.sqrt(0.25 / draws)


@pytest.mark.parametrize("north_m", np.linspace(20.0, 40.0, 9))
def test_a_thin_wall_across_the_course_is_not_stepped_over(north_m):
    basin = shapely.box(-100, -100, 100, 200).difference(shapely.box(-101, north_m, 101, north_m + 0.3))
    assert leave(certain(ship()), basin) == 1.0


def test_more_confidence_than_draws_can_tell_is_refused():
    with pytest.raises(NoPlan, match="too high to be estimated"):
        stray(ship(), confidence=0.99999, draws=None)
