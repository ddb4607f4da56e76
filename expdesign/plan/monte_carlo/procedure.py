"""How a ship comes to the beginning of a run: run-ups on the planned heading, and when she is in place.

The procedure that a plan's promise rests on, the same in run cards, report and drawn trials:

1. Each run is sailed open loop from the state the ship really has.
2. After it she rejoins the planned leg from where she is, in a straight line of sight, and follows it, steered.
3. At the planned start of the next run she begins it if position, heading, speed and yaw rate are within `Tolerances`.
4. Otherwise she goes round: the shortest way in safe water to the beginning of a run-up, and up to the start once more,
   steady on the planned heading and speed; `MOST_GO_AROUNDS` times at most. Then the trial is broken off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.control import CONTROL, Helmsman, over_ground
from expdesign.plan.legs import LegWater
from expdesign.values import Array, seal

MOST_GO_AROUNDS = 4
"""Times that a ship goes round for one run before the trial is broken off."""
OFF_PLACE, OFF_HEADING_RAD, OFF_SPEED, OFF_YAW_RATE = 0.2, float(np.radians(3.0)), 0.1, 0.1
"""Tolerances: in hull lengths; [rad]; in transit speeds; in the largest yaw rate on legs."""
ROOM_SHARE, FARTHEST_OFF = 0.25, 1.0
"""Share of the room besides the clearance that the position of a run's start may take up; hull lengths at most."""
SHORTER = (1.0, 0.75, 0.5, 0.35, 0.25)
"""Shares of a run-up tried where a whole one has no room."""
AFTER = 1.0
"""Hull lengths past the start that a reference goes on steadily."""
REST = 0.05
"""Speed over ground in transit speeds, and yaw rate in the largest, up to which a run begins from a standstill."""


ABORT_CAUSES = ("position", "heading", "speed", "yaw rate", "time", "no way round")
"""What can keep a ship from beginning a run: a tolerance, that she does not come there in time, or no way round."""


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """Within which a run may begin.

    Attributes:
        position_m: distance from the planned start.
        heading_rad, speed_mps, yaw_rate_radps: differences from the planned ones; speed as a vector over ground.
    """

    position_m: float
    heading_rad: float
    speed_mps: float
    yaw_rate_radps: float

    def used(self, states: Array, desired: Array) -> Array:
        """(n, 4) shares of the tolerances that states (n, 6) use up, by a desired one (6,); up to 1 is in place."""
        apart = over_ground(states) - over_ground(desired[None])
        return np.column_stack(
            [
                np.hypot(*(states[:, :2] - desired[:2]).T) / self.position_m,
                np.abs(wrap_angle(states[:, 2] - desired[2])) / self.heading_rad,
                np.hypot(*apart.T) / self.speed_mps,
                np.abs(states[:, 5] - desired[5]) / self.yaw_rate_radps,
            ]
        )


def tolerances(water: LegWater, spare_m: float = 0.0) -> Tolerances:
    """Of a run, by the vessel's length and its speeds on legs, and by the room there is besides the clearance.

    Information does not depend on where a run begins. So where there is room, a ship need not come back to a place
    only to begin there: a share of the room may be used up, at most a hull length.
    """
    ship, length_m = water.ship, water.vessel.length_m
    return Tolerances(
        position_m=float(np.clip(ROOM_SHARE * spare_m, OFF_PLACE * length_m, FARTHEST_OFF * length_m)),
        heading_rad=OFF_HEADING_RAD,
        speed_mps=OFF_SPEED * ship.transit_speed_mps,
        yaw_rate_radps=OFF_YAW_RATE * ship.turn_rate_radps,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretch:
    """A reference that leads to the start of a run, and a little past it.

    Attributes:
        states: (k + 1, 6) sample by sample.
        arrival: row of the planned start.
    """

    states: Array
    arrival: int

    def __post_init__(self) -> None:
        seal(self, states="k 6")


def planned_stretch(helm: Helmsman, track: Array, after_m: float) -> Stretch:
    """A planned leg (k + 1, 6), which goes on steadily past its end where a run begins there under way."""
    after = _after(helm, track[-1], after_m)
    more = steady_states(helm, track[-1], np.arange(1, after + 1))
    return Stretch(states=np.concatenate([track, more]), arrival=len(track) - 1)


def run_up(helm: Helmsman, water: LegWater, leg: Array, after_m: float) -> Stretch:
    """The run-up to the end of a planned leg (k + 1, 6), and so far past it [m].

    Straight, or as the run begins; where no such stretch keeps its clearance, the last of the planned leg itself. A
    run that begins at rest needs none if the ship can go sideways: she comes to a stop on the spot.
    """
    desired, sample_s = leg[-1], helm.vessel.sample_time_s
    moves = under_way(helm, desired)
    if not moves and helm.ship.keeps_station:
        return Stretch(states=np.stack([desired, desired]), arrival=1)
    samples = helm.ship.run_up_s(helm.vessel, float(np.hypot(*desired[3:5]))) / sample_s
    for share in SHORTER:
        count = max(2, round(share * samples))
        before = steady_states(helm, desired, np.arange(-count, 0)) if moves else slowing(helm, desired, count)
        if water.holds(np.concatenate([before, desired[None]])[:, :3]):
            break
    else:
        before = leg[max(0, len(leg) - 1 - round(samples)) : -1]
    more = steady_states(helm, desired, np.arange(1, _after(helm, desired, after_m) + 1))
    return Stretch(states=np.concatenate([before, desired[None], more]), arrival=len(before))


def under_way(helm: Helmsman, state: Array) -> bool:
    """Whether a state (6,) is more than a ship that keeps her place over ground."""
    ship = helm.ship
    return bool(np.hypot(*state[3:5]) > REST * ship.transit_speed_mps or abs(state[5]) > REST * ship.turn_rate_radps)


def steady_states(helm: Helmsman, state: Array, samples: np.ndarray) -> Array:
    """(k, 6) states some samples before or after a state (6,) that keeps its velocity through the mean current."""
    current, time_s = helm.environment.current_to, samples * helm.vessel.sample_time_s
    through = over_ground(state[None])[0] - current
    half = state[5] * time_s / 2
    moved = np.sinc(half / np.pi) * time_s  # the chord of an arc
    c, s = np.cos(half), np.sin(half)
    states: Array = np.tile(state, (len(samples), 1))
    states[:, 0] += moved * (through[0] * c - through[1] * s) + current[0] * time_s
    states[:, 1] += moved * (through[0] * s + through[1] * c) + current[1] * time_s
    states[:, 2] += state[5] * time_s
    c, s = np.cos(2 * half), np.sin(2 * half)
    north, east = through[0] * c - through[1] * s + current[0], through[0] * s + through[1] * c + current[1]
    c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
    states[:, 3], states[:, 4] = north * c + east * s, east * c - north * s
    return states


def slowing(helm: Helmsman, desired: Array, count: int) -> Array:
    """(count, 6) states on the way to a stop, straight ahead, gently."""
    ship, sample_s = helm.ship, helm.vessel.sample_time_s
    time_s = sample_s * np.arange(count, 0, -1)
    cruise = ship.transit_speed_mps / 2
    brake = ship.braking_mps2(cruise)
    slowed = np.minimum(time_s, cruise / brake)
    distance = brake * slowed**2 / 2 + cruise * (time_s - slowed)
    states: Array = np.tile(desired, (count, 1))
    states[:, :2] -= distance[:, None] * [np.cos(desired[2]), np.sin(desired[2])]
    states[:, 3] += brake * slowed
    return states


def _after(helm: Helmsman, state: Array, after_m: float) -> int:
    """Samples in which a ship under way goes some metres, at most a run-up; none for one that stands still."""
    if not under_way(helm, state):
        return 0
    speed, sample_s = float(np.hypot(*state[3:5])) + 1e-9, helm.vessel.sample_time_s
    longest_s = CONTROL.run_up_time_constants * CONTROL.track_lead * helm.answer_s
    return int(np.ceil(min(after_m / speed, longest_s) / sample_s)) if after_m else 0
