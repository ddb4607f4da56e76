"""How a ship reaches the start of a run: run-ups on the planned heading, and tolerances of the start.

The procedure behind a plan's risk estimate, the same in run cards, report and drawn trials:

1. Each run is sailed open loop from the ship's true state.
2. After it the ship rejoins the planned leg from where it is and follows it in closed loop. Where the leg is too short
   for that, a ship that keeps station follows a parallel leg, as far beside it as `PARALLEL_SHARE` of the start
   tolerance of the position.
3. At the planned start of the next run it begins the run if position, heading, speed and yaw rate are within
   `Tolerances`. At a standstill, a ship whose thrusters hold it there comes nearer until it uses few of them. Another
   ship cannot: it stops straight ahead, and begins as soon as it is within them.
4. Otherwise it goes around, as it does where it cannot return to a leg: by the shortest path in safe water to the
   beginning of a run-up, then up to the start again, steady on the planned heading and speed; `GO_AROUNDS` times at
   most. Then the trial is aborted, as it is where this takes longer than the whole planned trial, and than twice what
   one attempt may take. A ship that sails arcs takes a longer run-up each time, up to the longest of `LONGER_RUN_UPS`,
   where there is room.
5. The goal is reached by a ship that comes within `GOAL_HULLS` of it; heading and speed do not count there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import radians

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.dictionary.trim import drift
from expdesign.plan.control import RUN_UP_TIME_CONSTANTS, TRACK_LEAD, Helmsman, over_ground
from expdesign.plan.legs import LegWater
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel

HEADING_RAD = radians(3.0)  # tolerance of a run's start heading

POSITION_HULLS = 0.2  # least tolerance of a run's start position, in hull lengths
# share of the room beyond the clearance that the position may use instead, and its limit in hull lengths
POSITION_ROOM, POSITION_MOST_HULLS = 0.5, 3.0
GOAL_HULLS = 1.5  # distance from the goal at which a trial has reached it, in hull lengths
SPEED_SHARE, YAW_RATE_SHARE = 0.1, 0.1  # tolerances of its velocity in transit speeds, of its yaw rate in the largest
# share of the position's tolerance by which another speed at the start may move the run instead, and its limit as a
# share of the speed through water that the run begins with
SPEED_MOVES, SPEED_MOST_SHARE = 0.5, 0.3
RUN_UP_SHARES = (
    1.0,
    0.75,
    0.5,
    0.35,
    0.25,
)  # of a run-up that are tried, where a whole one has no room or no way to it
LONGER_RUN_UPS = (2.0, 3.0)  # in run-ups, of ships that sail arcs and did not settle on the last one
# speed over ground in transit speeds, and yaw rate in the largest, up to which a run begins from a standstill
REST_SHARE = 0.05


ABORT_CAUSES = ("position", "heading", "speed", "yaw rate", "time", "no go-around path")
"""What can keep a ship from beginning a run: a tolerance, the time, or that no go-around path is found."""


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """Within which a run may begin."""

    position_m: float  # distance from the planned start
    # heading_rad, speed_mps, yaw_rate_radps: differences from the planned ones; speed as a vector over ground
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


def tolerances(water: LegWater, spare_m: float = 0.0, begins_mps: float = 0.0) -> Tolerances:
    """Of a run, by the vessel's length and its speeds on legs, by the room beyond the clearance, and its first speed.

    Information does not depend on where a run begins, and the next leg begins where the run ends. So where there is
    room, the position may use a share of it, at most some hull lengths. A speed that differs at the start soon decays
    to that of the run, and its information is nearly all told after that: so the speed may differ by what moves the
    run by a share of the position's tolerance, and by a share of itself. Heading, speed, yaw rate and the most room for
    the position are as many times wider as the plan's settings ask.
    """
    ship, length_m, wider = water.ship, water.vessel.length_m, water.start_tolerance
    position_m = float(
        np.clip(
            POSITION_ROOM * spare_m,
            POSITION_HULLS * length_m,
            wider * POSITION_MOST_HULLS * length_m,
        )
    )
    moved_mps = SPEED_MOVES * position_m / speed_decay_s(water.vessel, ship.transit_speed_mps)
    least_mps = wider * SPEED_SHARE * ship.transit_speed_mps
    return Tolerances(
        position_m=position_m,
        heading_rad=wider * HEADING_RAD,
        speed_mps=float(np.clip(moved_mps, least_mps, max(SPEED_MOST_SHARE * begins_mps, least_mps))),
        yaw_rate_radps=wider * YAW_RATE_SHARE * ship.turn_rate_radps,
    )


def goal_within_m(water: LegWater) -> float:
    """Distance from the goal at which a trial has reached it, wider as the plan's settings ask [m]."""
    return water.start_tolerance * GOAL_HULLS * water.vessel.length_m


def speed_decay_s(vessel: Vessel, speed_mps: float) -> float:
    """Larger time constant of a difference in surge and in sway at a speed ahead, by the nominal model; inf for none.

    A ship that is faster by dv at first is dv times this farther in the end [s].
    """
    ahead, step = np.array([speed_mps, 0.0, 0.0]), 1e-3 * speed_mps
    idle = np.zeros(len(vessel.limits))
    away = [drift(vessel, ahead + side * step * np.eye(3), idle) for side in (1.0, -1.0)]
    damping = -float(np.diag((away[0] - away[1]) / (2 * step))[:2].max())
    return 1.0 / damping if damping > 0 else np.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class Approach:
    """How n ships reached the start of a run."""

    poses: Array  # (t, n, 3) at every sample; ships that have begun or aborted stay where they are
    begun: np.ndarray  # (n,) within tolerance; the others that sailed aborted
    go_arounds: np.ndarray  # (n,) of each ship
    samples: np.ndarray  # (n,) that it took
    abort_cause: np.ndarray  # (n,) index in `ABORT_CAUSES`, for ships that aborted
    unexplained: Array  # (n, 3) estimate at the end of the acceleration that the nominal model does not explain


@sealed(states="k 6")
class Stretch:
    """A reference that leads to the start of a run, and a little past it."""

    states: Array  # (k + 1, 6) sample by sample
    arrival: int  # row of the planned start
    # row in which a run-up of a share begins, the longest first
    begins: dict[float, int] = field(default_factory=lambda: {1.0: 0})


def planned_stretch(helm: Helmsman, track: Array, after_m: float) -> Stretch:
    """A planned leg (k + 1, 6), continued steadily past its end where a run begins there under way."""
    after = _after(helm, track[-1], after_m)
    more = steady_states(helm, track[-1], np.arange(1, after + 1))
    return Stretch(states=np.concatenate([track, more]), arrival=len(track) - 1)


def run_up(helm: Helmsman, water: LegWater, leg: Array, after_m: float) -> Stretch:
    """The run-up to the end of a planned leg (k + 1, 6), continued so far past it [m].

    Steady as the run begins; where no such stretch keeps its clearance, the last part of the planned leg itself. A run
    that begins at rest needs none if the ship keeps station: it stops on the spot. Ships that sail
    arcs may begin on a longer one, too.
    """
    desired, sample_s = leg[-1], helm.vessel.sample_time_s
    moves = not at_rest(helm, desired)
    if not moves and helm.ship.keeps_station:
        return Stretch(states=np.stack([desired, desired]), arrival=1)
    samples = helm.ship.run_up_s(helm.vessel, float(np.hypot(*desired[3:5]))) / sample_s
    arcs = moves and not helm.ship.keeps_station
    counts = {share: max(2, round(share * samples)) for share in (*RUN_UP_SHARES, *(LONGER_RUN_UPS if arcs else ()))}
    longest = max(counts.values())
    before = steady_states(helm, desired, np.arange(-longest, 0)) if moves else slowing(helm, desired, longest)
    held = {s: n for s, n in counts.items() if water.holds(np.vstack([before[longest - n :], desired])[:, :3])}
    if not held:
        before = leg[max(0, len(leg) - 1 - round(samples)) : -1]
        held = {1.0: len(before)}
    before = before[len(before) - max(held.values()) :]
    more = steady_states(helm, desired, np.arange(1, _after(helm, desired, after_m) + 1))
    return Stretch(
        states=np.concatenate([before, desired[None], more]),
        arrival=len(before),
        begins={share: len(before) - count for share, count in sorted(held.items(), reverse=True)},
    )


def at_rest(helm: Helmsman, states: Array) -> np.ndarray:
    """(...,) whether ships at states (..., 6) hardly move over ground."""
    ship, speed_mps = helm.ship, np.hypot(states[..., 3], states[..., 4])
    still = speed_mps <= REST_SHARE * ship.transit_speed_mps
    return np.asarray(still & (np.abs(states[..., 5]) <= REST_SHARE * ship.turn_rate_radps))


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
    """(count, 6) states of a gentle stop straight ahead."""
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
    if at_rest(helm, state):
        return 0
    speed, sample_s = float(np.hypot(*state[3:5])) + 1e-9, helm.vessel.sample_time_s
    longest_s = RUN_UP_TIME_CONSTANTS * TRACK_LEAD * helm.answer_s
    return int(np.ceil(min(after_m / speed, longest_s) / sample_s)) if after_m else 0
