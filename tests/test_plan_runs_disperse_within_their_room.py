from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.errors import NoPlan
from expdesign.plan.control.ships import capability
from expdesign.plan.control.tracking import Helmsman
from expdesign.plan.monte_carlo.risk import CollisionCheck, open_loop
from expdesign.plan.runs import Fleet, dispersion_m, draw_truths
from expdesign.plan.values import PlanSettings
from expdesign.simulation import CALM, Environment, Variation
from expdesign.vessel.vessel import covering_discs
from plan_case import area, primitive, ship

CENTRES = covering_discs(30.0, 9.0)[0]


def certain(vessel):
    return replace(vessel, model=replace(vessel.model, parameter_std=np.zeros(len(vessel.model.names))))


def stray(vessel, environment=CALM, confidence=0.9, seed=0, draws=400):
    rng = np.random.default_rng(seed)
    return dispersion_m(
        vessel, primitive(vessel), environment, centres_m=CENTRES, confidence=confidence, rng=rng, draws=draws
    )


def test_without_uncertainty_there_is_no_dispersion():
    assert stray(certain(ship())).max() < 1e-6


def test_a_known_mean_current_is_no_uncertainty():
    steady = Environment(current_to=np.array([0.3, -0.2]))
    assert stray(certain(ship()), steady).max() < 1e-6


def test_an_uncertain_current_disperses_runs_like_its_rayleigh_quantile():
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


def test_a_variation_of_infinite_memory_disperses_runs_like_an_uncertain_mean():
    # a process that forgets nothing is a mean drawn once: the same current, known in another way
    vessel = certain(ship())
    held = Environment(current_variation=Variation(std_mps=0.05, correlation_s=1e9))
    draws, confidence = 4000, 0.9
    drawn, varied = stray(vessel, Environment(current_std_mps=0.05), draws=draws), stray(vessel, held, draws=draws)
    density = (1 - confidence) * np.sqrt(-2 * np.log(1 - confidence)) / (60.0 * 0.05)
    error = np.sqrt(confidence * (1 - confidence) / draws) / density
    assert abs(drawn[-1] - varied[-1]) < 4 * np.sqrt(2) * error


def test_higher_confidence_needs_more_room():
    low, high = stray(ship(), confidence=0.5), stray(ship(), confidence=0.99)
    assert (high[1:] > low[1:]).all()


def test_a_prior_of_unstable_ships_is_refused_with_its_reason():
    vessel = ship()
    std = np.array([1.0 if name == "X_abs_u_u" else 0.0 for name in vessel.model.names])
    wild = replace(vessel, model=replace(vessel.model, parameter_std=std))
    with pytest.raises(NoPlan, match=r"unstable for .* allows each 5\.00%"):
        stray(wild, confidence=0.95)


def leave(vessel, water, environment=CALM, draws=400):
    """Share of drawn ships whose hull leaves the water in an acceleration from the origin, sailed open loop."""
    run, rng = primitive(vessel), np.random.default_rng(1)
    truths = draw_truths(vessel, environment, draws, rng)
    state, standing = np.r_[run.trajectory.pose[0], run.trajectory.velocity[0]], run.entry_inputs
    fleet = Fleet(vessel, environment, truths, state=state, standing=standing, rng=rng)
    helm = Helmsman(vessel=vessel, environment=environment, ship=capability(vessel, PlanSettings()))
    poses = open_loop(helm, fleet, run.commands.values, np.ones(draws, dtype=bool))
    watch = CollisionCheck(area=area(water), vessel=vessel)
    return float((fleet.lost | ~np.isnan(watch.exits(poses)[:, 0])).mean())


def test_a_certain_ship_always_or_never_leaves_the_water():
    vessel = certain(ship())
    assert leave(vessel, shapely.box(-100, -100, 100, 200)) == 0.0
    assert leave(vessel, shapely.box(-100, -100, 100, 30)) == 1.0


def test_half_of_the_currents_push_the_ship_over_a_line_at_its_side():
    # the hull grazes the line with no current: it crosses when the drawn east current is to the east
    vessel = certain(ship())
    draws = 1000
    share = leave(vessel, shapely.box(-300, -100, 4.5 + 1e-6, 300), Environment(current_std_mps=0.05), draws)
    assert abs(share - 0.5) < 4 * np.sqrt(0.25 / draws)


@pytest.mark.parametrize("north_m", np.linspace(20.0, 40.0, 9))
def test_a_thin_wall_across_the_course_is_not_stepped_over(north_m):
    basin = shapely.box(-100, -100, 100, 200).difference(shapely.box(-101, north_m, 101, north_m + 0.3))
    assert leave(certain(ship()), basin) == 1.0


def test_more_confidence_than_the_draws_resolve_is_refused():
    with pytest.raises(NoPlan, match="too high to be estimated"):
        stray(ship(), confidence=0.99999, draws=None)
