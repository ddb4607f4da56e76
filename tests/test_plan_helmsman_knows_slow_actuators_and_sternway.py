"""The helmsman of drawn ships allows for actuators that lag, and does not turn a ship round that is wanted astern."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.plan import PlanSettings
from expdesign.plan.control.ships import capability
from expdesign.plan.control.tracking import Helmsman
from expdesign.plan.runs import Fleet, Truths
from expdesign.simulation import CALM
from expdesign.vessel import Response, Vessel
from helm_case import coaster, open_water
from plan_case import ship

LATE = Response(lag_s=8.0, delay_s=2.0)
SAMPLES, NEAR_M = 400, 2.0


def nominal(vessel: Vessel, count: int) -> Truths:
    still = np.zeros((count, 2))
    return Truths(parameters=np.tile(vessel.model.parameters, (count, 1)), current_to=still, wind_to=still)


def settled_s(vessel: Vessel, *, allowed_for: bool) -> np.ndarray:
    """Times after which ships all round a place, 40 m off, heading away, stay at it."""
    bearing = np.arange(8) * np.pi / 4
    helm = Helmsman(vessel=vessel, environment=CALM, ship=capability(vessel, PlanSettings()))
    rng = np.random.default_rng(0)
    fleet = Fleet(vessel, CALM, nominal(vessel, 8), state=np.zeros(6), standing=np.zeros(4), rng=rng)
    off = np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    fleet.states = np.column_stack([40.0 * off, bearing, np.zeros((8, 3))])
    away = []
    for _ in range(SAMPLES):
        delivered = fleet.delivered if allowed_for else None
        told = helm.commands(np.zeros((8, 6)), fleet.states, fleet.given, delivered=delivered)
        fleet.advance(told)
        away.append(np.hypot(*fleet.states[:, :2].T))
    far = np.array(away) > NEAR_M
    assert not far[-1].any()
    return vessel.sample_time_s * (SAMPLES - np.argmax(far[::-1], axis=0))


def test_ships_with_slow_actuators_come_to_rest_sooner_when_commanded_more_than_desired():
    prompt = ship()
    slow = [
        replace(item, responses=tuple(replace(LATE, rate=own.rate) for own in item.responses))
        for item in prompt.actuators
    ]
    late = replace(prompt, model=replace(prompt.model, actuators=tuple(slow)))
    ideal_s, allowed_s, ignored_s = (
        settled_s(vessel, allowed_for=allowed) for vessel, allowed in ((prompt, True), (late, True), (late, False))
    )
    assert (allowed_s < ignored_s).all()
    swing_s = 2 * np.pi * (LATE.lag_s + LATE.delay_s)  # one swing of a loop as late as that
    assert allowed_s.mean() < ideal_s.mean() + swing_s / 2 < ignored_s.mean()


def test_commands_of_actuators_without_lag_do_not_depend_on_what_they_deliver():
    vessel = ship()
    helm = Helmsman(vessel=vessel, environment=CALM, ship=capability(vessel, PlanSettings()))
    rng = np.random.default_rng(1)
    wanted, states, before, given = (rng.normal(size=(20, width)) for width in (6, 6, 4, 4))
    np.testing.assert_array_equal(
        helm.commands(wanted, states, before, delivered=given), helm.commands(wanted, states, before)
    )


def test_a_helm_steered_ship_that_is_to_go_astern_does_not_turn_round():
    vessel = coaster()
    helm = Helmsman(vessel=vessel, environment=CALM, ship=open_water(vessel).ship)
    astern = np.array([0.0, 0.0, 0.0, -2.0, 0.0, 0.0])
    standing = np.zeros(len(vessel.limits))
    fleet = Fleet(vessel, CALM, nominal(vessel, 1), state=astern, standing=standing, rng=np.random.default_rng(0))
    for sample in range(int(60 / vessel.sample_time_s)):
        place = -2.0 * (sample + 1) * vessel.sample_time_s
        wanted = np.array([[place, 0.0, 0.0, -2.0, 0.0, 0.0]])
        fleet.advance(helm.commands(wanted, fleet.states, fleet.given))
    assert abs(fleet.states[0, 2]) < 0.1
    assert fleet.states[0, 3] < -1.0
