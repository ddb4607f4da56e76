"""Local planner of helm-steered ships: arcs that the ship can turn on, in the time that changes of speed take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.plan.chart import polyline_length
from expdesign.plan.control import HelmShip
from expdesign.plan.legs import (
    FoundLeg,
    LegTask,
    LegWater,
    check_ends,
    displaced,
    dubins_curve,
    helm_leg,
    last_state,
    recover,
)
from expdesign.plan.local_planner.arcs import (
    Departures,
    PathPoints,
    arc_successors,
    between,
    moved,
    path_points,
    path_successors,
)
from expdesign.plan.local_planner.helm_times import HelmTimes, helm_times
from expdesign.plan.local_planner.protocol import (
    LegEnds,
    Pair,
    PartialPlans,
    SearchSpace,
    Successors,
    TransitionTrials,
)
from expdesign.plan.local_planner.tuning import LOCAL
from expdesign.simulation import CALM
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class HelmPlanner:
    """Legs recover from the run before, turn on Dubins curves, and end with a straight run-up.

    Attributes:
        ship: speeds, turns, stopping.
        recoveries: (q, 4) displacement by which the ship recovers from each run before its first turn: ahead m, to
            starboard m, course from the heading at the run's end rad, time s.
    """

    ship: HelmShip
    recoveries: Array

    def __post_init__(self) -> None:
        seal(self, recoveries="q 4")

    @cached_property
    def times(self) -> HelmTimes:
        """The rule for leg times."""
        return helm_times(self.ship)

    @property
    def transition_trials(self) -> int:
        """None: run-ups settle what the run before leaves."""
        return 0

    def check_ends(self, start: Array, goal: Array, water: LegWater) -> None:
        """Raise NoPlan where arcs do not lead away from the start, or up to the goal."""
        check_ends(start, goal, water)

    def leg(self, task: LegTask, water: LegWater) -> FoundLeg | None:
        """Along arcs, the run-up to a run included, or None."""
        return None if water.parted(task.start[:2], task.end[:2]) else helm_leg(task, water, self.ship)

    def with_transitions(self, space: SearchSpace, pairs: Sequence[Pair], trials: TransitionTrials) -> SearchSpace:
        """The space itself."""
        return space

    def successors(self, space: SearchSpace, plans: PartialPlans) -> list[Successors]:
        """Arcs and stretches of the path to the goal, in the time that changes of speed and turns take."""
        departures = self._departures(space, plans)
        points = path_points(space, departures.pose, LOCAL.path_stretches)
        return [self._to_run(space, plans, q, departures, points) for q in plans.wanted]

    def _to_run(
        self, space: SearchSpace, plans: PartialPlans, q: int, departures: Departures, points: PathPoints
    ) -> Successors:
        able = plans.able(q)
        more_m = np.array([space.more_run_up_m(int(last), q) for last in plans.last[able]])
        run_up_m = max(space.hull_m, self.ship.run_up_m) + more_m
        arcs = arc_successors(space, departures, able, q, run_up_m)
        paths = path_successors(space, departures, able, q, points, turning_radius_m=0.0)  # `between_s` has the turns
        found = Successors.joined([arcs, paths])
        paths_m, leg_s = found.leg_s * self.times.speed_mps, np.zeros(len(found.leg_s))
        entry_mps = space.footprints[q].entry_mps
        for (last, exit_mps), where in plans.alike(found.parent).items():
            open_s = self._open_s(
                space, last, (exit_mps, entry_mps), plans.pose[found.parent[where]], found.start[where]
            )
            on_path_s = self.times.seconds(paths_m[where], exit_mps, entry_mps)
            leg_s[where] = np.maximum(open_s, np.where(np.isnan(found.turn[where]), on_path_s, 0.0))
        return replace(found, leg_s=leg_s)

    def leg_s(self, space: SearchSpace, ends: LegEnds, froms: Array, tos: Array, bends: Array) -> Array:
        """(n,) time of legs in open water, or along the path with bends where that takes longer [s]."""
        froms, tos = np.broadcast_arrays(froms, tos)
        speeds = ends.exit_mps, ends.entry_mps
        leg_s = self._open_s(space, ends.before, speeds, froms, tos)
        if not len(bends):
            return leg_s
        ahead, behind = bends[0] - froms[:, :2], tos[:, :2] - bends[-1]
        length_m = np.hypot(*ahead.T) + polyline_length(bends) + np.hypot(*behind.T)
        return np.maximum(leg_s, self.times.seconds(length_m, *speeds))

    def leg_path(self, space: SearchSpace, before: int, start: Array, end: Array) -> Array:
        """(k, 2) places along the recovery, the Dubins curve and the run-up."""
        recovered = moved(start[None], self._recovery(space, before)[None, :3])[0]
        run_up = moved(end[None], np.array([[-self.times.run_up_m, 0.0, 0.0]]))[0]
        spacing_m = space.field.cell_m
        curve = dubins_curve(recovered, run_up, radius_m=self.times.radius_m, spacing_m=spacing_m)
        return np.concatenate([between(start, recovered, spacing_m), curve[:, :2], between(run_up, end, spacing_m)])

    def to_goal_s(self, space: SearchSpace, plans: PartialPlans) -> Array:
        """(b,) time of the last leg to a stop [s]."""
        distance, found = space.goal_distance.to_goal(plans.pose[:, :2]), np.zeros(len(plans.pose))
        for (last, exit_mps), where in plans.alike(np.arange(len(plans.pose))).items():
            goals = np.tile(space.goal, (len(where), 1))
            open_s = self._open_s(space, last, (exit_mps, 0.0), plans.pose[where], goals)
            found[where] = np.maximum(open_s, self.times.seconds(distance[where], exit_mps, 0.0))
        return found

    def least_m(self, space: SearchSpace, pair: Pair) -> float:
        """None: the rule holds for short legs, too."""
        return 0.0

    def losses_s(self, space: SearchSpace, *, made_good: bool) -> tuple[Array, Array]:
        """Changes of speed."""
        runs = space.footprints
        pairs = [[self.times.lost_s(a.exit_mps, b.entry_mps, made_good=made_good) for b in runs] for a in runs]
        home = [self.times.lost_s(a.exit_mps, 0.0, made_good=made_good) for a in runs]
        return np.array(pairs), np.array(home)

    def _open_s(self, space: SearchSpace, last: int, speeds: tuple[float, float], froms: Array, tos: Array) -> Array:
        """(n,) time of legs in open water after a run [s]."""
        return self.times.between_s(froms, tos, self._recovery(space, last), *speeds, current_to=space.current_to)

    def _departures(self, space: SearchSpace, plans: PartialPlans) -> Departures:
        """Where ships have recovered from the run before."""
        steps = np.array([self._recovery(space, int(last)) for last in plans.last])
        return Departures(pose=moved(plans.pose, steps[:, :3]), wait_s=steps[:, 3])

    def _recovery(self, space: SearchSpace, last: int) -> Array:
        """(4,) recovery from a run, or from the start (-1): one hull length straight ahead."""
        if last >= 0:
            return np.asarray(self.recoveries[last])
        return np.array([space.hull_m, 0.0, 0.0, space.hull_m / self.ship.transit_speed_mps])


def recoveries(ship: HelmShip, water: LegWater, runs: Sequence[Primitive]) -> Array:
    """(q, 4) displacement by which the ship recovers from each run, in calm water."""
    calm = replace(water, environment=CALM)
    scales = {"sample_time_s": water.vessel.sample_time_s, "hull_m": water.vessel.length_m}
    found = []
    for run in runs:
        checked = recover(last_state(run.trajectory), calm.remembered(run.commands.values), calm, ship)
        found.append(displaced(checked, ship, **scales))
    return np.array(found).reshape(-1, 4)
