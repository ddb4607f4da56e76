"""Commands reproduce a track as a whole, or, of ships unstable on their course, in stretches whose errors add up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expdesign.plan.legs import LegTask
from expdesign.plan.legs.water import acceptable
from expdesign.plan.resimulation import OFF_RAD, Resimulation, _in_stretches, resimulated
from expdesign.plan.values import Leg, SailedTrial
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM, integrate_motion, simulate
from expdesign.vessel import Vessel
from helm_case import offshore_vessel, open_water
from plan_case import find_leg

SAMPLES, SPEED_MPS = 900, 3.0
START = (SPEED_MPS, 0.0, 0.0)


def ship(*, unstable: bool) -> Vessel:
    """The offshore vessel, or her with a moment of drift that turns her away."""
    vessel = offshore_vessel()
    names = [term.name for term in vessel.model.terms]
    values = vessel.model.parameters.copy()
    values[names.index("N_uv")] = -0.012 if unstable else 0.0
    return replace(vessel, model=replace(vessel.model, parameters=values))


def steered(vessel: Vessel) -> SailedTrial:
    """Commands that a helmsman gave to keep a course that swings, sample by sample, and the track that they made."""
    names, rows, state = vessel.model.inputs, np.zeros((SAMPLES, len(vessel.limits))), np.r_[0.0, 0.0, 0.0, START]
    states, thrusts, angles = (
        [state],
        [names.index(name) for name in ("n1", "n2")],
        [names.index("a1"), names.index("a2")],
    )
    for sample in range(SAMPLES):
        course = 0.2 * np.sin(2 * np.pi * sample / 300)
        rows[sample, thrusts] = 2.0
        rows[sample, angles] = np.clip(2.0 * (state[2] - course) + 20.0 * state[5], -0.5, 0.5)
        state = integrate_motion(
            vessel, rows[sample : sample + 1, None], state, sea=np.zeros((1, 4)), sample_time_s=vessel.sample_time_s
        )[-1]
        states.append(state)
    track = np.array(states)
    return SailedTrial(
        commands=Commands(sample_time_s=vessel.sample_time_s, names=names, values=rows),
        trajectory=Trajectory(sample_time_s=vessel.sample_time_s, pose=track[:, :3], velocity=track[:, 3:]),
        legs=(Leg(kind="reposition", name="goal", first=0, last=SAMPLES),),
    )


def with_thrust(trial: SailedTrial, vessel: Vessel, share: float) -> SailedTrial:
    """The trial with the track of more or less thrust than commanded."""
    values = trial.commands.values.copy()
    values[:, [name.startswith("n") for name in vessel.model.inputs]] *= share
    return replace(trial, trajectory=simulate(vessel, replace(trial.commands, values=values), velocity=START))


def anew(vessel: Vessel, trial: SailedTrial) -> Resimulation:
    return resimulated(vessel, CALM, trial, transit_mps=SPEED_MPS)


def moved(trial: SailedTrial, first: int, by_m: float) -> SailedTrial:
    """The trial with its track beside itself from a sample on."""
    track: Trajectory = trial.trajectory
    pose = track.pose.copy()
    pose[first:, 1] += by_m
    return replace(trial, trajectory=replace(track, pose=pose))


def test_a_stable_ship_is_simulated_as_a_whole():
    vessel = ship(unstable=False)
    found = anew(vessel, steered(vessel))
    assert found.stretch is None
    assert not found.problems(vessel.length_m)
    assert found.off_m.max() < 1e-3


def test_the_track_of_an_unstable_ship_is_reproduced_in_stretches_though_not_as_a_whole():
    vessel = ship(unstable=True)
    trial = steered(vessel)
    found = anew(vessel, trial)
    assert found.stretch is not None
    whole = Resimulation(
        track=trial.trajectory,
        motion=simulate(vessel, trial.commands, velocity=START, substeps=20),
    )
    assert whole.problems(vessel.length_m)
    assert not found.problems(vessel.length_m)
    assert found.off_m.max() < vessel.length_m / 100


@pytest.mark.parametrize("unstable", [False, True])
@pytest.mark.parametrize("first", [1, 44, 45, 46, 150, 300, 899, 900])
def test_a_jump_of_the_track_is_found_wherever_it_is(unstable, first):
    vessel = ship(unstable=unstable)
    found = anew(vessel, moved(steered(vessel), first, 2.0))
    assert any("off the track" in problem for problem in found.problems(vessel.length_m))


@pytest.mark.parametrize("thrust", [1.002, 0.998])
def test_errors_that_grow_slowly_add_up_from_stretch_to_stretch(thrust):
    """In no stretch is the track of a little other thrust off by as much as is allowed."""
    vessel = ship(unstable=False)
    found = anew(vessel, with_thrust(steered(vessel), vessel, thrust))
    allowed = vessel.length_m / 30
    assert found.off_m[-1] > allowed
    assert found.problems(vessel.length_m)
    assert found.off_m[45] < allowed


@pytest.mark.parametrize("angle_rad", [1e-4, -1e-4])
def test_a_course_that_drifts_slowly_is_found_by_where_it_leads(angle_rad):
    """Headings and places are within what is allowed in every stretch, and headings in their sum."""
    vessel = ship(unstable=False)
    trial = steered(vessel)
    values = trial.commands.values.copy()
    values[:, [name.startswith("a") for name in vessel.model.inputs]] += angle_rad
    track = simulate(vessel, replace(trial.commands, values=values), velocity=START)
    found = anew(vessel, replace(trial, trajectory=track))
    apart = Resimulation(
        track=track, motion=_in_stretches(vessel, CALM, replace(trial, trajectory=track), 45), stretch=45
    )
    assert apart.off_rad.max() < OFF_RAD
    assert found.problems(vessel.length_m)


def test_a_long_leg_of_an_unstable_ship_is_steered_and_arrives():
    """Commands that hold a stable ship on a straight lead this one off it, and IPOPT finds none for all of the leg."""
    vessel = ship(unstable=True)
    water, length = open_water(vessel), vessel.length_m
    ahead, rest = water.ship.approach, np.zeros(len(vessel.limits))
    start = np.array([-28 * length, -6 * length, 0.0, *ahead.velocity])
    off = start + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1e-9])
    end = np.array([26 * length, 4 * length, 0.4, 0.0, 0.0, 0.0])
    held = np.tile(ahead.inputs, (int(20 * length / water.ship.transit_speed_mps / vessel.sample_time_s), 1))
    assert np.abs(water.states(off, held)[-1][2:] - start[2:]).max() > 1e4 * 1e-9
    task = LegTask(start=start, end=end, start_inputs=ahead.inputs, end_inputs=rest, seed=1)
    values = find_leg(task, water)
    assert values is not None
    assert acceptable(start, end, water, values, task.past)
    assert task.budget.spent_s < 10.0
