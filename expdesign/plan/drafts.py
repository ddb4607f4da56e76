"""Trials drafted: runs placed and sailed without the checks, and the same with a run left out or put in.

Where one run is left out or put in, the others stay where they are, and only the legs beside it are planned.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from expdesign.plan.assembly import PlanRoom, roomy_water
from expdesign.plan.control import Capability
from expdesign.plan.legs import LegWater
from expdesign.plan.legs_ahead import KnownLegs
from expdesign.plan.local_planner import Departure, SearchSpace
from expdesign.plan.sailing import know_legs, sail_all, sail_placed
from expdesign.plan.search import measured_s, with_another
from expdesign.plan.values import Placement, PlanProblem, SailedTrial, WorkBudget
from expdesign.progress import Progress
from expdesign.sea_area import SeaArea
from expdesign.values import Array, sealed

REPLAN_BUDGETS = 2.0  # time budgets of counted work within which a replan must be expected to end


def budget_of(problem: PlanProblem) -> WorkBudget:
    """Counted work within which a trial is planned, and made anew where drawn trials leave the water."""
    return WorkBudget(most_s=REPLAN_BUDGETS * problem.settings.time_budget_s)


@sealed(made_good_m="legs", late_s="legs")
class Draft:
    """A trial as sailed by the planner, before verification, risk and bound."""

    area: SeaArea  # part of the chart that it is planned in
    # water, room: what legs and runs keep to, as stated and as planned with
    water: LegWater
    room: PlanRoom
    spent_s: float  # counted work
    sailed: SailedTrial  # commands, motion and legs
    direct_s: float  # time of the shortest path from start to goal at transit speed [s]
    transit_mps: float  # that speed [m/s]
    made_good_m: Array  # (legs,) by how much each run or leg shortens the way to the goal
    # (legs,) by how much longer than planned drawn trials take on each, on average, go-arounds included [s]; zero where
    # it is not known
    late_s: Array
    known: KnownLegs  # legs found for it, which a like trial need not seek again

    @property
    def runs_beyond_s(self) -> float:
        """Time of the runs beyond what the distance that they make good takes at transit speed [s]."""
        runs = [leg.kind == "primitive" for leg in self.sailed.legs]
        return self.sailed.seconds("primitive") - float(self.made_good_m[runs].sum()) / self.transit_mps


def drafted(
    whole: PlanProblem, area: SeaArea, ship: Capability, progress: Progress, like: Draft | None = None
) -> Draft:
    """The trial in a part of the water; transitions that were tried for a like one are not tried again."""
    progress("measuring the water", 0.0)
    problem = replace(whole, area=area)
    water, room = roomy_water(problem, ship, progress, None if like is None else like.room)
    budget, known = budget_of(problem), KnownLegs()
    sailed = sail_all(problem, room, progress, stated=water, budget=budget, known=known)
    return _measured(area, water, room, sailed, budget.spent_s, known)


def redrafted(problem: PlanProblem, draft: Draft, placements: Sequence[Placement]) -> Draft | None:
    """The draft of a trial with other runs at given places, in this order; None where a leg or a run is not found.

    Legs that are known from the draft are not sought again, and those found become known.

    Args:
        problem: the trial; its runs are among those of the draft.
        draft: of the same trial with other runs; its water is used.
        placements: of all runs.
    """
    problem, budget, used = replace(problem, area=draft.area), budget_of(problem), {run.name for run in problem.used}
    runs = tuple(run for run in draft.room.space.footprints if run.name in used)
    room = replace(draft.room, space=replace(draft.room.space, footprints=runs))
    sailed = sail_placed(problem, room, placements, stated=draft.water, budget=budget, known=draft.known)
    return None if sailed is None else _measured(draft.area, draft.water, room, sailed, budget.spent_s, draft.known)


def find_legs(problem: PlanProblem, draft: Draft, choices: Iterable[Sequence[Placement]]) -> None:
    """Make the legs known, beside each other, that `redrafted` would seek for each of several choices of placements.

    Args:
        problem: the trial with all runs of the draft.
        draft: as of `redrafted`.
        choices: of placements.
    """
    know_legs(replace(problem, area=draft.area), draft.room, choices, stated=draft.water, known=draft.known)


def another_in_leg(problem: PlanProblem, draft: Draft, leg: int, run: int) -> tuple[Placement, float] | None:
    """Another run within a leg of a draft, and by how much longer the trial is with it, without go-arounds [s].

    None where the leg has no room for it.

    Args:
        problem: the trial with the runs of the draft.
        draft: of it.
        leg: number of the leg between two runs; that of the last leads to the goal.
        run: index of the run's footprint in the draft's room.
    """
    space, footprint = draft.room.space, draft.room.space.footprints[run]
    begun, runs, poses, departure, before_s = _by_rule(problem, draft)
    grown = with_another(space, departure, runs, poses, leg=leg, run=run)
    if grown is None:
        return None
    legs_s = measured_s(begun, [*runs[:leg], run, *runs[leg:]], grown, departure) - before_s
    return Placement(primitive=footprint.name, pose=grown[leg]), legs_s + footprint.duration_s


@lru_cache(maxsize=1)
def _by_rule(problem: PlanProblem, draft: Draft) -> tuple[SearchSpace, list[int], Array, Departure, float]:
    """A draft as it was placed: its space without go-arounds, its runs, their poses, its start, and its legs' time."""
    names, placed, begin = [item.name for item in draft.room.space.footprints], draft.sailed.placements, problem.begin
    runs, poses = [names.index(item.primitive) for item in placed], np.array([item.pose for item in placed])
    begun = replace(draft.room.space, go_around=None)  # each run begins at the first attempt
    chain = runs, poses.reshape(-1, 3), Departure(pose=begin[:3], exit_mps=float(begin[3]), last=-1)
    return begun, *chain, measured_s(begun, *chain)


def _measured(
    area: SeaArea, water: LegWater, room: PlanRoom, sailed: SailedTrial, spent_s: float, known: KnownLegs
) -> Draft:
    """A draft and what it makes good."""
    ends = [0, *(leg.last for leg in sailed.legs)]
    left_m = room.space.goal_distance.to_goal(sailed.trajectory.pose[ends, :2])
    speed = water.ship.transit_speed_mps
    return Draft(
        area=area,
        water=water,
        room=room,
        spent_s=spent_s,
        sailed=sailed,
        direct_s=float(left_m[0]) / speed,
        transit_mps=speed,
        made_good_m=-np.diff(left_m),
        late_s=np.zeros(len(sailed.legs)),
        known=known,
    )
