"""Numbers that steer what is foreseen."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Numbers of this room.

    Attributes:
        outcome_share: change of an outcome of the standard trials that matters, as a share of it.
        least_angle_rad: smallest change of an overshoot that matters: trials are read no finer.
        fit_points: loss of simulated fit that matters, mean over the outputs [points].
        size_rounds: of the search for the size of an effect that is not proportional to its number.
        size_reach: sizes stay within this factor of the default.
        beyond_std: a parameter matters from so many of its stated standard deviations on.
        wanted_power: of a cause that counts as revealed.
        told_apart: probability below which two causes count as not told apart.
        draws: of score vectors, for the probability that one cause comes before another.
        least_power: of a test, below which held-out runs are not asked, as the effect is hardly ever found.
        records: of a trial with nothing hidden, from which the errors of held-out runs are drawn.
        held_out_draws: of trials, for the share in which held-out runs show what the test accepts.
        most_added_s: longest time of added runs [s].
        most_added_runs: of one manoeuvre.
        headings: of every manoeuvre that may be added.
    """

    outcome_share: float = 0.05
    least_angle_rad: float = 0.00873
    fit_points: float = 5.0
    size_rounds: int = 4
    size_reach: float = 100.0
    beyond_std: float = 3.0
    wanted_power: float = 0.9
    told_apart: float = 0.5
    draws: int = 2000
    least_power: float = 0.01
    records: int = 12
    held_out_draws: int = 60
    most_added_s: float = 14400.0
    most_added_runs: int = 200
    headings: int = 2


TUNING = Tuning()
