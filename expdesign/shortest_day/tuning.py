"""The numbers of the shortest day that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Rounds and tolerances.

    Attributes:
        rounds: most days that are planned in search of the shortest.
        first_share: information from runs in the first day, as a share of what is needed; legs tell the rest.
        courses: on which runs are taken to be sailed.
        course_spread_rad: of these to both sides of the straight line, before a day has been planned.
        first_leg_s: time of repositioning for each run, before a day has been planned [s].
        nearest: days to the accuracy, from which the next is sought.
        other_runs: of each manoeuvre that it has more or fewer, at most.
        level_step, level_steps: margin that is asked for besides where the cheapest runs were tried already, at most so
            many times.
        least_level, level_halvings: least margin of a day of a given length, and steps in search of the largest.
        pruned: days, the shortest first, from which runs are left out in the end.
        left_out: runs that are tried to be left out of a day, one at a time, before none is.
        foreseen: shortfall of the margin that is expected of a day without a run, up to which it is tried.
        average_legs: legs to one manoeuvre that the average of all legs counts as, once days have been planned.
        least_leg_s: least of it once days have been planned [s].
        added_durations: durations of manoeuvres that are searched for, in that of the longest run of the dictionary.
        growth_share: information from runs, as a share of what is needed, for which manoeuvres are searched for.
        growth_rounds: searches for manoeuvres that are worth more than they cost.
        growth_gain: share of the cheapest runs' cost that a search must save for another to follow.
        draft_pool, draft_searches: candidates of every family, and searches, of a draft, at most.
        growth_families: searched in each of them, the most promising; the best of each may be added.
        added_speed: largest surge speed of a manoeuvre that is added, in transit speeds, which leaves some thrust for
            sway, and at which few of the drawn ships are unstable.
        used: least runs of a manoeuvre found, in the cheapest runs not made whole, for it to be added.
        curve_shares: information, in shares of what is needed, for which the day is estimated.
        cuts: most linear bounds on the accuracy in the choice of runs, not whole.
        tangents: most of them carried over to a like choice.
        halvings: of the way to inner runs, in search of the boundary.
        reached: shortfall of the accuracy's margin that counts as reached.
        choice_gap: relative gap at which the choice of runs ends.
        exchanged: most manoeuvres of which runs are left out, and put in, in the search for whole runs.
        most_runs: of one primitive.
    """

    rounds: int = 5
    first_share: float = 0.4
    courses: int = 4
    course_spread_rad: float = 0.5
    first_leg_s: float = 15.0
    nearest: int = 3
    other_runs: int = 1
    level_step: float = 0.05
    level_steps: int = 10
    least_level: float = -4.0
    level_halvings: int = 12
    pruned: int = 1
    left_out: int = 4
    foreseen: float = 0.1
    average_legs: float = 2.0
    least_leg_s: float = 5.0
    added_durations: tuple[float, ...] = (0.25, 0.5, 1.0)
    growth_share: float = 0.6
    growth_rounds: int = 8
    growth_gain: float = 0.02
    draft_pool: int = 8
    draft_searches: int = 1
    growth_families: int = 6
    added_speed: float = 0.93
    used: float = 0.1
    curve_shares: tuple[float, ...] = (0.4, 0.5, 0.65, 0.8, 1.0, 1.25, 1.6, 2.0)
    cuts: int = 200
    tangents: int = 60
    halvings: int = 12
    reached: float = 1e-9
    choice_gap: float = 1e-3
    exchanged: int = 24
    most_runs: int = 200


TUNING = Tuning()
