"""Recovery of a helm-steered ship from a run: counter helm ends the turn, the engines go to transit speed.

Legs begin with it, and the search for places allows for it: a ship still turns and drifts for some lengths.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from expdesign.plan.control import Capability, HelmShip
from expdesign.plan.legs.tuning import LEGS
from expdesign.plan.legs.water import LegWater
from expdesign.values import Array, seal
from expdesign.vessel import within_limits


@dataclass(frozen=True, kw_only=True, eq=False)
class Recovery:
    """From a state until the ship goes straight.

    Attributes:
        states: (k + 1, 6) at every sample.
        commands: (k, m).
    """

    states: Array
    commands: Array

    def __post_init__(self) -> None:
        seal(self, states="n 6", commands="k m")


def recover(state: Array, past: Array, water: LegWater, ship: HelmShip) -> Recovery:
    """End the turn of a ship at a state (6,) after commands (h, m); empty where it does not turn."""
    vessel, approach = water.vessel, ship.approach
    pace_s, swing = vessel.length_m / ship.transit_speed_mps, ship.transit_speed_mps / ship.turning_radius_m
    hardest = approach.helm.hardest(approach.drive) - abs(approach.angle_rad)
    states, rows = [np.asarray(state)], [past[-1]]
    while (
        abs(states[-1][5]) > LEGS.recovered_share * swing
        and len(states) * vessel.sample_time_s < LEGS.recovery_hulls * pace_s
    ):
        against = float(np.clip(LEGS.counter_helm * pace_s * states[-1][5], -hardest, hardest))
        desired = np.array(approach.helm.inputs(approach.drive, approach.angle_rad - approach.starboard * against))
        row = within_limits(vessel.actuators, desired[None], sample_time_s=vessel.sample_time_s, before=rows[-1])
        given = past if water.prompt else water.remembered(np.concatenate([past, *(row[None] for row in rows[1:])]))
        states.append(water.states(states[-1], row, given)[-1])
        rows.append(row[0])
    return Recovery(states=np.array(states), commands=np.array(rows[1:]).reshape(-1, len(vessel.limits)))


def displaced(recovery: Recovery, ship: Capability, *, sample_time_s: float, hull_m: float) -> Array:
    """(4,) displacement until the ship can be in any turn: recovery, and a straight while the helm takes effect.

    Distance ahead and to starboard [m], course at its end from the first heading [rad], and time [s].
    """
    first, last = recovery.states[0], recovery.states[-1]
    c, s = math.cos(first[2]), math.sin(first[2])
    course = last[2] + (math.atan2(last[4], last[3]) if last[3] > 0 else 0.0)
    north, east = (
        last[:2] - first[:2] + LEGS.straight_off_hulls * hull_m * np.array([math.cos(course), math.sin(course)])
    )
    time_s = len(recovery.commands) * sample_time_s + LEGS.straight_off_hulls * hull_m / ship.transit_speed_mps
    return np.array([north * c + east * s, east * c - north * s, course - first[2], time_s])
