"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Local planners.

    Attributes:
        arc_turns_deg, arc_straights: turns of arcs, and the straight after them beyond the run-up in hull lengths.
        path_stretches: of the shortest path to the goal, in hull lengths; the whole path is always tried too.
        path_headings_deg: headings of runs on it, from its direction.
        agile_path_stretches, agile_straights: the same of agile ships, and lengths of their straight legs besides the
            best transitions, beyond the run-up.
        agile_courses, agile_headings: courses of those legs to a full turn, from the heading that the run before ends
            with, and headings of runs, from that heading or from the direction of the path.
        near_path_hulls: hull lengths along the path within which it is taken for a straight line.
        far_hulls: hull lengths that are enough for any leg.
        acceleration_share, yaw_rate_share: of the mean largest acceleration and of the yaw rate on the spot, that agile
            legs make use of. This and the next two are fitted to 540 optimised legs of three vessels, 20 m, 30 m and a
            model, between random places, headings and speeds: half of the ships' legs agree within three seconds, half
            of the model's within 0.4 s.
        time_power: exponent of the mean of the times of path and turn.
        settling_share: time to settle, in that of the actuators from nothing to full.
        near_hulls: hull lengths that an agile leg needs to suit any place, heading and speed at its ends; shorter ones
            are optimised in advance.
        go_around_run_ups: expected time of go-arounds before a run that follows another at once, in run-ups, and
        settled_run_ups: length of leg, in run-ups, on which it falls to 1/e; of drawn trials with legs of 5 to 270 s.
        drift_rounds: rounds in which the time of a leg and the drift in that time are made to agree.
        transition_trials: plans whose transitions are tried before the search proper.
        transition_guess_hulls: length of the leg with which the optimiser begins.
        open_water_hulls: of open water to every side of a transition that is tried.
        too_short: what a metre costs that a helm-steered leg is too short by, in metres at transit speed: the ship
            goes back for it, slowly.
        stop_leg_hulls: least length of helm-steered legs to a stop: a ship off the track returns to it before.
        run_leg_spare_hulls: length of helm-steered legs to runs beyond what changes of speed need: the helm takes some.
        tabled_speeds: highest speeds of helm-steered legs that are tabulated.
        stopped_share: of transit speed below which a ship has stopped or is about to: no run-up then.
    """

    arc_turns_deg: tuple[float, ...] = (0, 15, -15, 30, -30, 50, -50, 75, -75, 105, -105, 140, -140, 180, -180)
    arc_straights: tuple[float, ...] = (0.0, 1.0, 2.0, 3.0, 4.5, 6.0)
    path_stretches: tuple[float, ...] = (5.0, 12.0, 25.0, 50.0, 100.0)
    path_headings_deg: tuple[float, ...] = (0, 30, -30, 60, -60, 90, -90, 135, -135, 180)
    agile_path_stretches: tuple[float, ...] = (1.5, 2.5, 4.0, 7.0, 12.0, 25.0, 50.0, 100.0)
    agile_straights: tuple[float, ...] = (1.5, 2.5, 6.0)
    agile_courses: int = 6
    agile_headings: int = 16
    near_path_hulls: float = 10.0
    acceleration_share: float = 1.1
    yaw_rate_share: float = 0.7
    time_power: float = 2.0
    settling_share: float = 1.2
    near_hulls: float = 1.5
    far_hulls: float = 4.0
    go_around_run_ups: float = 3.0
    settled_run_ups: float = 2.0
    drift_rounds: int = 3
    transition_trials: int = 4
    transition_guess_hulls: float = 0.5
    open_water_hulls: float = 25.0
    too_short: float = 12.0
    stop_leg_hulls: float = 5.0
    run_leg_spare_hulls: float = 0.8
    tabled_speeds: int = 60
    stopped_share: float = 0.3


LOCAL = Tuning()
