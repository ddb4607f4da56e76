"""How a ship with a helm comes out of what it was doing: the helmsman checks the swing, the engines go to transit.

Legs begin with it, and the search for places counts on it: a ship still turns and slides for some lengths.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from expdesign.plan.control import Capability, HelmShip
from expdesign.plan.legs.water import LegWater, last_state
from expdesign.values import Array, seal
from expdesign.vessel import within_limits

CHECK = 3.0
"""Helm against the swing, per yaw rate, in times of a hull length at transit speed."""
CHECKED = 0.05
"""Yaw rate at which a swing counts as checked, in that of a leg's turns."""
OFF = 1.0
"""Hull lengths straight off before the first turn: what the helm does shows that much later."""
LONGEST = 8.0
"""Time after which the helmsman goes on whatever is left, in that of a hull length at transit speed."""


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
    """Check the swing of a ship at a state (6,) after commands (h, m); empty where it does not turn."""
    vessel, approach = water.vessel, ship.approach
    pace_s, swing = vessel.length_m / ship.transit_speed_mps, ship.transit_speed_mps / ship.turning_radius_m
    hardest = approach.helm.hardest(approach.drive) - abs(approach.angle_rad)
    states, rows = [np.asarray(state)], [past[-1]]
    while abs(states[-1][5]) > CHECKED * swing and len(states) * vessel.sample_time_s < LONGEST * pace_s:
        against = float(np.clip(CHECK * pace_s * states[-1][5], -hardest, hardest))
        wish = np.array(approach.helm.inputs(approach.drive, approach.angle_rad - approach.starboard * against))
        row = within_limits(vessel.actuators, wish[None], sample_time_s=vessel.sample_time_s, before=rows[-1])
        given = past if water.prompt else water.remembered(np.concatenate([past, *(row[None] for row in rows[1:])]))
        states.append(last_state(water.sail(states[-1], row, given)))
        rows.append(row[0])
    return Recovery(states=np.array(states), commands=np.array(rows[1:]).reshape(-1, len(vessel.limits)))


def displaced(recovery: Recovery, ship: Capability, *, sample_time_s: float, hull_m: float) -> Array:
    """(4,) from a state until the ship can be in a turn of its choice: recovery, and a straight while the helm bites.

    Way ahead and to starboard [m], course at its end from the first heading [rad], and time [s].
    """
    first, last = recovery.states[0], recovery.states[-1]
    c, s = math.cos(first[2]), math.sin(first[2])
    course = last[2] + (math.atan2(last[4], last[3]) if last[3] > 0 else 0.0)
    north, east = last[:2] - first[:2] + OFF * hull_m * np.array([math.cos(course), math.sin(course)])
    time_s = len(recovery.commands) * sample_time_s + OFF * hull_m / ship.transit_speed_mps
    return np.array([north * c + east * s, east * c - north * s, course - first[2], time_s])
