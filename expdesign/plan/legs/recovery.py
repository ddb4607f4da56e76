"""How a ship with a helm recovers from a run, by simulation, before the path of a leg begins.

The engines go to transit speed; when she no longer goes astern, counter helm ends her turn.
"""

from __future__ import annotations

import math

import numpy as np

from expdesign.plan.control import Capability, HelmShip
from expdesign.plan.legs.water import LegWater, nearest_turns, through_water
from expdesign.values import Array, sealed
from expdesign.vessel import within_limits

STRAIGHT_OFF_HULLS = 1.0  # straight before the first turn, as the helm takes that long to act
COUNTER_HELM = 3.0  # helm against a residual turn, per yaw rate, in times of a hull length at transit speed
# yaw rate in that a hull length before, above which counter helm does little more: the sway of a ship that is unstable
# on her course keeps her turning slowly, for many lengths
LITTLE_FELL = 0.5
RECOVERED_SHARE = 0.05  # yaw rate at which the ship has recovered, in that of a leg's turns
RECOVERY_HULLS = 8.0  # time after which a turn's recovery ends in any case, in that of a hull length at transit speed
STERNWAY_SHARE = 0.05  # transit speeds astern from which on a ship is brought to a stop first
STOPPING_HULLS = 40.0  # hull lengths at transit speed in whose time, at most


@sealed(states="n 6", commands="k m")
class Recovery:
    """From a state until the ship goes straight ahead, or stands."""

    states: Array  # (k + 1, 6) at every sample
    commands: Array  # (k, m)


def recover(state: Array, past: Array, water: LegWater, ship: HelmShip) -> Recovery:
    """End sternway and turn of a ship at a state (6,) after commands (h, m); empty where she has neither."""
    vessel, approach = water.vessel, ship.approach
    pace_s, swing = vessel.length_m / ship.transit_speed_mps, ship.transit_speed_mps / ship.turning_radius_m
    hardest = approach.helm.hardest(approach.drive) - abs(approach.angle_rad)
    states, rows, turning = [np.asarray(state)], [past[-1]], list[float]()  # rates since the helm has come over
    count = max(1, round(pace_s / vessel.sample_time_s))
    astern, stopped_s = _surge_mps(water, state) < -STERNWAY_SHARE * ship.transit_speed_mps, 0.0
    while True:
        spent_s = len(states) * vessel.sample_time_s
        astern = astern and _surge_mps(water, states[-1]) < 0.0 and spent_s < STOPPING_HULLS * pace_s
        stopped_s = spent_s if astern else stopped_s
        settled = abs(states[-1][5]) <= RECOVERED_SHARE * swing or spent_s >= stopped_s + RECOVERY_HULLS * pace_s
        if settled and not astern:
            break
        # astern the rudder turns her the other way, or not at all
        against = 0.0 if astern else float(np.clip(COUNTER_HELM * pace_s * states[-1][5], -hardest, hardest))
        desired = np.array(approach.helm.inputs(approach.drive, approach.angle_rad - approach.starboard * against))
        desired = nearest_turns(vessel, desired, rows[-1])
        row = within_limits(vessel.actuators, desired[None], sample_time_s=vessel.sample_time_s, before=rows[-1])
        given = past if water.prompt else water.remembered(np.concatenate([past, *(row[None] for row in rows[1:])]))
        states.append(water.states(states[-1], row, given)[-1])
        rows.append(row[0])
        turning += [abs(states[-1][5])] if np.allclose(row, desired) and not astern else []
        if len(turning) > count and turning[-1] > LITTLE_FELL * turning[-1 - count]:
            break
    return Recovery(states=np.array(states), commands=np.array(rows[1:]).reshape(-1, len(vessel.limits)))


def displaced(recovery: Recovery, ship: Capability, *, sample_time_s: float, hull_m: float) -> Array:
    """(4,) displacement until the ship can be in any turn: recovery, and a straight while the helm takes effect.

    Distance ahead and to starboard [m], course at its end from the first heading [rad], and time [s].
    """
    first, last = recovery.states[0], recovery.states[-1]
    c, s = math.cos(first[2]), math.sin(first[2])
    course = last[2] + (math.atan2(last[4], last[3]) if last[3] > 0 else 0.0)
    north, east = last[:2] - first[:2] + STRAIGHT_OFF_HULLS * hull_m * np.array([math.cos(course), math.sin(course)])
    time_s = len(recovery.commands) * sample_time_s + STRAIGHT_OFF_HULLS * hull_m / ship.transit_speed_mps
    return np.array([north * c + east * s, east * c - north * s, course - first[2], time_s])


def _surge_mps(water: LegWater, state: Array) -> float:
    """Speed ahead through water at a state (6,)."""
    return float(through_water(water.environment, state)[0])
