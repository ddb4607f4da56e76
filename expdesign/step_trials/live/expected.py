"""How fast the vessel is expected to answer, by the model that is guessed before the trial."""

from __future__ import annotations

import math

import numpy as np

from expdesign.errors import NotInformative
from expdesign.signals import Commands
from expdesign.simulation import simulate
from expdesign.step_trials.holds import CHANNELS, commands_of
from expdesign.step_trials.live.step_list import Inputs, StepList
from expdesign.values import Array
from expdesign.vessel import Vessel

PART_S = 20.0
"""Simulated at a time [s], for a vessel of 1 m; with the square root of the length, as Froude's law has it."""
MOST_PARTS = 8
STILL = 0.01
"""Change in the second half of what was simulated, as a share of all of it, below which the vessel is steady."""


def expected_constants(vessel: Vessel, steps: StepList) -> tuple[float, float]:
    """Time constants of U and r [s]: the upper quartile of the times to 1 - 1/e of the changes that steps make.

    Raises:
        NotInformative: by the model, no step of the throttle changes the speed, or none of the rudder the yaw rate.
    """
    found: tuple[list[float], list[float]] = ([], [])
    motion, at = _passed(vessel, steps.start, np.array([1.0, 0.0, 0.0]))[-1], steps.start
    for step in steps.steps:
        if step.before != at:
            motion = _passed(vessel, step.before, motion)[-1]
        passed = _passed(vessel, step.after, motion)
        motion, at = passed[-1], step.after
        moved = np.diff(commands_of(steps.controls, steps.names, np.array([step.before, step.after])), axis=0)[0]
        state = np.stack([np.hypot(passed[:, 0], passed[:, 1]), passed[:, 2]], axis=1)
        for channel in np.flatnonzero(moved).tolist():
            apart = np.abs(state[:, channel] - state[-1, channel])
            if apart[0] > STILL * np.abs(state[:, channel]).max():
                found[channel].append(float(np.argmax(apart < apart[0] / math.e)) * vessel.sample_time_s)
    for name, state_name, constants in zip(CHANNELS, ("speed", "yaw rate"), found, strict=True):
        if not constants:
            raise NotInformative(
                f"by the model of vessel {vessel.name!r} no step of the {name} in the list changes the {state_name}"
            )
    return float(np.quantile(found[0], 0.75)), float(np.quantile(found[1], 0.75))


def _passed(vessel: Vessel, inputs: Inputs, motion: Array) -> Array:
    """(k, 3) u, v, r under commands that stand, until they hardly change."""
    count = math.ceil(PART_S * math.sqrt(vessel.length_m) / vessel.sample_time_s)
    passed = np.asarray(motion, dtype=float)[None]
    for _ in range(MOST_PARTS):
        commands = Commands(
            sample_time_s=vessel.sample_time_s, names=vessel.model.inputs, values=np.tile(inputs, (count, 1))
        )
        more = simulate(vessel, commands, velocity=passed[-1]).velocity
        passed = np.concatenate([passed, more[1:]])
        late = passed[len(passed) // 2 :]
        if np.all(np.ptp(late, axis=0) <= STILL * np.maximum(np.abs(late[-1] - passed[0]), 1e-3)):
            break
    return passed
