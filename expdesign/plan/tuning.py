"""The numbers of the planner's own modules that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Work budgets, replanning and warnings.

    Attributes:
        most_runs: runs in one plan.
        finer_grid: how many times finer the clearance grid is where the usual one is too coarse for a passage or a
            place.
        first_places, first_headings: places and headings at which a run is tried first, before boxes round them are
            halved.
        first_tries: poses drawn among these and tried before all others: in wide water one of them has room.
        boxes: of places and headings at most; with more of them it stays open whether the run has a place.
        least_slack_cells: slack in cells of the clearance grid at which that stays open, too.
        fastest_start: a plan may begin so many times faster than the ship's top speed, and turn so much faster.
        stop_hulls, stop_bends_rad: distances in hull lengths, and bearings off the course, at which a ship that starts
            under way is tried to stop.
        lookups: clearances looked up at a time.
        least_confidence: below which none is named as a remedy.
        clearance_shares: of the largest clearance with which every run has a place, tried as remedies.
        sailed_shares: of the clearance asked for, tried as remedies where legs fail.
        most_searches: narrow searches for places, each with a quarter of the partial plans, to check remedies.
        most_plans: plans made to check remedies.
        remedy_budget: share of the time budget that such a plan may spend on failures.
        remedy_work: counted work of looking for remedies where drawn trials fail, in that of the refused plan; half of
            planning is not counted, and is remembered.
        promise: share of the limits below which failures in the rest of a refused plan must be for a plan without its
            worst run to be made.
        lower_confidences: tried as remedies of a refusal, the highest first.
        most_left_out: designs tried as remedies, each without the runs that had no place in the one before.
        turns_deg: from the heading asked for at start and goal, tried as remedies to both sides [deg].
        tighter: turning radii tried as remedies, in that of legs.
        faster: repositioning speeds tried as remedies, in the mean current.
        trials_stream: random stream of the drawn trials, apart from other draws of the same seed.
        lateness_stream, lateness_trials: random stream, and number, of the trials whose time decides which of several
            days is expected to be the shortest.
        replans: plans made after the first one, each with more room where drawn trials of the one before left the
            water.
        widening: factor on a run's room then; legs get the same share of a hull length more clearance.
        replan_budgets: time budgets of counted work within which a replan must be expected to end.
        wider_reach: factor on the part of the chart that is planned in where the one before had no room.
        transition_beam: partial plans kept in the searches that choose the transitions to optimise.
        transitions_s: work budget of optimising transitions; the others keep the rule for leg times [s].
        fewer_trials: time that trying the transitions of a plan takes, beside that of the plan before.
        failure_s: least cost of a failed placement [s].
        leg_s: work budget of one leg [s].
        clock_budgets: time budgets by the clock after which a search that is stuck ends, whatever its counted work.
        bound_reach: share of the distance that the plan's time allows at top speed, beyond start and goal, from which
            a plan cannot return in that time; half, and some for speeds that legs begin and end with.
        iteration_s: one iteration of the optimiser for each sample of a leg, on a machine of 2020 [s].
        sample_s: one sample of some hundred drawn ships there [s].
        work: how long phases take beside each other, on average of the examples on two cores: measuring the water,
            trying transitions, placing runs, sailing them, verifying and sailing drawn trials.
    """

    most_runs: int = 1000
    finer_grid: float = 4.0
    first_places: int = 2000
    first_headings: int = 24
    first_tries: int = 500
    boxes: int = 400_000
    least_slack_cells: float = 3.0
    fastest_start: float = 1.5
    stop_hulls: tuple[float, ...] = (16.0, 8.0, 4.0, 2.0)
    stop_bends_rad: tuple[float, ...] = (0.0, 0.6, -0.6, 1.2, -1.2)
    lookups: int = 200_000
    least_confidence: float = 0.5
    clearance_shares: tuple[float, ...] = (1.0, 0.75, 0.5, 0.0)
    sailed_shares: tuple[float, ...] = (0.5, 0.0)
    most_searches: int = 8
    most_plans: int = 2
    remedy_budget: float = 0.1
    remedy_work: float = 1.75
    promise: float = 0.8
    lower_confidences: tuple[float, ...] = (0.9999, 0.9995, 0.999, 0.995, 0.99, 0.98, 0.95, 0.9, 0.8)
    most_left_out: int = 8
    turns_deg: tuple[float, ...] = tuple(15.0 * count for count in range(1, 13))
    tighter: tuple[float, ...] = (0.9, 0.8, 0.7, 0.6, 0.5)
    faster: tuple[float, ...] = (1.05, 1.2, 1.5)
    trials_stream: int = 1
    lateness_stream: int = 2
    lateness_trials: int = 60
    replans: int = 2
    widening: float = 1.4
    replan_budgets: float = 2.0
    wider_reach: float = 4.0
    transition_beam: int = 100
    transitions_s: float = 30.0
    fewer_trials: float = 0.4
    failure_s: float = 2.0
    leg_s: float = 40.0
    clock_budgets: float = 5.0
    bound_reach: float = 0.6
    iteration_s: float = 2e-4
    sample_s: float = 2.5e-3
    work: tuple[float, float, float, float, float] = (1.0, 3.0, 1.0, 2.5, 4.0)


PLAN = Tuning()
