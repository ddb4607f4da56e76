"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Simulated trials, go-arounds and the chance constraint.

    Attributes:
        trials, most_trials: drawn of a plan at least and at most.
        expected_cases: trials are so many that this number may leave allowed water.
        upper_share: percentile of times that is reported, and confidence of the upper limit of a probability.
        no_plan_aborted: share of aborted trials from which a plan is rejected.
        go_arounds: for one run at most; then the trial is aborted.
        position_hulls: least tolerance of a run's start position, in hull lengths.
        position_room, position_most_hulls: share of the room beyond the clearance that the position may use instead,
            and its limit in hull lengths.
        heading_rad: tolerance of a run's start heading.
        speed_share, yaw_rate_share: tolerances of its velocity in transit speeds, of its yaw rate in the largest.
        speed_moves, speed_most_share: share of the position's tolerance by which another speed at the start may move
            the run instead, and its limit in transit speeds.
        run_up_shares: of a run-up that are tried, where a whole one has no room.
        past_start_hulls: hull lengths past the start over which a reference continues steadily.
        rest_share: speed over ground in transit speeds, and yaw rate in the largest, up to which a run begins from
            a standstill.
        patience, waiting_time_constants: a ship may take so many times as long as planned for a reference or a path,
            and so many time constants of the return to a reference besides.
        least_step: movement of a slow reference per sample, in that at transit speed.
        parallel_share: of the tolerance of a run's start position, by which a ship may sail beside the leg before it.
        rejoin_samples: samples between the points at which a return to the leg is checked against the shore.
        rejoin_share: of a leg's time within which a ship must be able to return to it.
        arrived_hulls: distance from the goal at which a trial has reached it.
        steady_hulls: distance from the start within which helm-steered ships keep the heading, not the track: there
            they drift.
        standstill_share: of the tolerances within which a ship at a standstill begins; the whole ones after half of
            the waiting time.
        turn_hulls: distance from the end of a return path within which ships that keep station turn to its heading.
        turned_rad: heading error there up to which they have turned.
        bend_speed: least speed at bends and while the bow points elsewhere, in transit speeds.
        braking: share of the mean acceleration that is used for slowing down on return paths.
        sideways_speed: sideways and astern, in transit speeds.
        sideways_share: of an azimuth's thrust ahead or astern, below which it counts as to the side.
        look_ahead_hulls: of helm-steered ships on return paths (line of sight guidance).
        bend_hulls: distance from a bend at which a ship has reached it.
        nodes_radii: distances from the goal of the poses through which go-arounds lead, in turning radii.
        node_bearings, node_courses: bearings of these poses at each distance, and courses at each of them.
        first_tries, next_tries: such poses tried for a ship, and for a go-around from another pose.
        curves: Dubins curves that a go-around from such a pose consists of at most.
        trials_at_once: trials sailed together, so that memory does not grow with their number.
        collision_samples, collision_chunk: samples of all ships, and hulls near the shore, checked at a time.
    """

    trials: int = 500
    most_trials: int = 2000
    expected_cases: float = 2.0
    upper_share: float = 0.95
    no_plan_aborted: float = 0.5
    go_arounds: int = 4
    position_hulls: float = 0.2
    position_room: float = 0.5
    position_most_hulls: float = 3.0
    heading_rad: float = radians(3.0)
    speed_share: float = 0.1
    speed_moves: float = 0.5
    speed_most_share: float = 0.3
    yaw_rate_share: float = 0.1
    run_up_shares: tuple[float, ...] = (1.0, 0.75, 0.5, 0.35, 0.25)
    past_start_hulls: float = 1.0
    rest_share: float = 0.05
    patience: float = 3.0
    waiting_time_constants: float = 10.0
    least_step: float = 0.2
    parallel_share: float = 0.5
    rejoin_samples: int = 5
    rejoin_share: float = 0.5
    arrived_hulls: float = 1.5
    steady_hulls: float = 2.0
    standstill_share: float = 0.5
    turn_hulls: float = 2.0
    turned_rad: float = 0.15
    bend_speed: float = 0.25
    braking: float = 0.5
    sideways_speed: float = 0.5
    sideways_share: float = 0.5
    look_ahead_hulls: float = 1.5
    bend_hulls: float = 0.4
    nodes_radii: tuple[float, ...] = (2.0, 4.0, 7.0, 11.0)
    node_bearings: int = 12
    node_courses: int = 8
    first_tries: int = 60
    next_tries: int = 6
    curves: int = 3
    trials_at_once: int = 1000
    collision_samples: int = 250_000
    collision_chunk: int = 20_000


MONTE_CARLO = Tuning()
