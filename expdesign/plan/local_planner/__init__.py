"""Local planners: how each kind of ship gets from one state to another."""

from expdesign.plan.local_planner.arcs import arc_end, moved, run_ends
from expdesign.plan.local_planner.factory import local_planner
from expdesign.plan.local_planner.protocol import (
    Departure,
    GoAroundTime,
    LegEnds,
    LocalPlanner,
    Pair,
    PartialPlans,
    RunSpace,
    SearchSpace,
    Successors,
    TransitionTrials,
    TriedTransition,
)
from expdesign.plan.local_planner.transitions import pairs_of
