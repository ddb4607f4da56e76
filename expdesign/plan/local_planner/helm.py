"""Local planner of helm-steered ships: arcs that the ship can turn on, in the time that changes of speed take.

Legs accelerate, go on and stop as the ship's own simulation does. Such a ship needs distance to change its speed: on a
leg too short for it, it has to go astern first, which takes long. It recovers from the run before, follows a Dubins
curve, and goes straight for the last hull length before a run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.plan.chart import polyline_length
from expdesign.plan.control import APPROACH_HULLS, HelmShip, full_ahead, stopped
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
    ways_on,
)
from expdesign.plan.local_planner.dubins import PATH_STRETCHES, dubins_m
from expdesign.plan.local_planner.protocol import (
    DRIFT_ROUNDS,
    LegEnds,
    Pair,
    PartialPlans,
    SearchSpace,
    Successors,
    TransitionTrials,
)
from expdesign.simulation import CALM
from expdesign.values import Array, readonly, sealed

# what a metre costs that a helm-steered leg is too short by, in metres at transit speed: the ship goes back for it,
# slowly
TOO_SHORT = 12.0
STOP_LEG_HULLS = 5.0  # least length of helm-steered legs to a stop: a ship off the track returns to it before
RUN_LEG_SPARE_HULLS = 0.8  # length of helm-steered legs to runs beyond what changes of speed need: the helm takes some
TABLED_SPEEDS = 60  # highest speeds of helm-steered legs that are tabulated
STOPPED_SHARE = 0.3  # of transit speed below which a ship has stopped or is about to: no run-up then


# A rule for the time of legs of helm-steered ships: accelerate, go on, stop, as the ship's own simulation does.


@sealed(speeding_up="g 3", stopping="s 3")
class HelmTimes:
    """What the rule needs."""

    # speed_mps, radius_m: of long legs, and of their turns
    speed_mps: float
    radius_m: float
    # run_up_m, steady_m: straight before each run, and the last of that, steady
    run_up_m: float
    steady_m: float
    at_rest_m: float  # of legs to a stop at least
    spare_m: float  # before a run besides the distance in which speeds change
    answer_s: float  # until a new engine order takes effect
    speeding_up: Array  # (k, 3) speed m/s, distance m and time s from rest with the engines full ahead
    stopping: Array  # (k, 3) the same until rest with the engines full astern, counted backwards

    def seconds(self, length_m: Array, exit_mps: float, entry_mps: float) -> Array:
        """(...,) time of legs of such lengths through water from one speed to another [s]."""
        path_m, time_s = _lengths_and_times(self, exit_mps, entry_mps)
        least_m = path_m[0] if entry_mps > STOPPED_SHARE * self.speed_mps else max(path_m[0], self.at_rest_m)
        return np.asarray(
            np.interp(length_m, path_m, time_s)
            + np.maximum(length_m - path_m[-1], 0.0) / self.speed_mps
            + TOO_SHORT * np.maximum(least_m - length_m, 0.0) / self.speed_mps
        )

    def lost_s(self, exit_mps: float, entry_mps: float, *, made_good: bool) -> float:
        """Least time of a leg, or where its displacement counts, least time lost against transit speed [s]."""
        length_m, time_s = _lengths_and_times(self, exit_mps, entry_mps)
        return float((time_s - made_good * length_m / self.speed_mps).min())

    def between_s(
        self, froms: Array, tos: Array, recovery: Array, exit_mps: float, entry_mps: float, *, current_to: Array
    ) -> Array:
        """(n,) time of legs in open water between poses (n, 3).

        Args:
            froms, tos: over ground.
            recovery: (4,) displacement and time before the first turn.
            exit_mps, entry_mps: speeds at the ends.
            current_to: of the water, with which a leg drifts.
        """
        straight_m = self.straight_m(entry_mps)
        begins, ends = moved(froms, recovery[None, :3]), moved(tos, np.array([[-straight_m, 0.0, 0.0]]))
        along_m = float(np.hypot(*recovery[:2])) + straight_m
        # legs are first guessed over ground: no turn all round
        over_ground_m = dubins_m(begins, ends, radius_m=self.radius_m)
        leg_s = self.seconds(over_ground_m + along_m, exit_mps, entry_mps)
        for _ in range(1, DRIFT_ROUNDS if current_to.any() else 1):
            through = np.column_stack([ends[:, :2] - leg_s[:, None] * current_to, ends[:, 2]])
            length_m = dubins_m(begins, through, radius_m=self.radius_m)
            length_m = np.where(over_ground_m > length_m + np.pi * self.radius_m, over_ground_m, length_m)
            leg_s = self.seconds(length_m + along_m, exit_mps, entry_mps)
        return leg_s

    def straight_m(self, entry_mps: float) -> float:
        """Straight before a run, with room to settle, or before a stop."""
        return self.run_up_m if entry_mps > STOPPED_SHARE * self.speed_mps else self.steady_m / 2


@lru_cache(maxsize=256)
def _lengths_and_times(times: HelmTimes, exit_mps: float, entry_mps: float) -> tuple[Array, Array]:
    """Lengths and times of legs with higher and higher peak speeds."""
    first, last = (float(np.clip(speed, 0.0, times.speed_mps)) for speed in (exit_mps, entry_mps))
    runs = last > STOPPED_SHARE * times.speed_mps
    before_s = times.answer_s if first else 0.0  # from rest the table has it
    steady_m = times.steady_m + times.spare_m if runs else 0.0
    after_s = steady_m / last if runs else times.answer_s
    peak = np.linspace(max(first, last), times.speed_mps, TABLED_SPEEDS)
    path_m, time_s = (_between(times.speeding_up, first, peak) + _between(times.stopping, last, peak)).T
    return path_m + steady_m + before_s * first, time_s + before_s + after_s


@lru_cache(maxsize=16)
def helm_times(ship: HelmShip) -> HelmTimes:
    """The rule for a ship that is steered by a helm."""
    approach = ship.approach
    return HelmTimes(
        speed_mps=ship.transit_speed_mps,
        radius_m=ship.turning_radius_m,
        run_up_m=ship.run_up_m,
        steady_m=APPROACH_HULLS * approach.helm.vessel.length_m,
        at_rest_m=STOP_LEG_HULLS * approach.helm.vessel.length_m,
        spare_m=RUN_LEG_SPARE_HULLS * approach.helm.vessel.length_m,
        answer_s=0.5 / approach.helm.drive_rate,
        speeding_up=_speeding_up(ship),
        stopping=_stopping(ship),
    )


def _between(table: Array, low: float, high: Array) -> Array:
    """(k, 2) distance and time between one speed and others."""
    path_m, time_s = (np.interp(np.r_[low, high], table[:, 0], column) for column in table[:, 1:].T)
    return np.stack([path_m[1:] - path_m[0], time_s[1:] - time_s[0]], axis=1)


def _speeding_up(ship: HelmShip) -> Array:
    """(k, 3) motion from rest to transit speed, full ahead as fast as the engines answer."""
    approach = ship.approach
    speed = np.hypot(*full_ahead(approach)[:, 3:5].T)
    return _table(speed, approach.helm.vessel.sample_time_s, ship.transit_speed_mps)


def _stopping(ship: HelmShip) -> Array:
    """(k, 3) motion from transit speed to rest, backwards in time."""
    approach = ship.approach
    vessel = approach.helm.vessel
    speed = np.hypot(*stopped(vessel, ship.transit_speed_mps).velocity[::-1, :2].T)
    return _table(speed, vessel.sample_time_s, ship.transit_speed_mps)


def _table(speed: Array, step_s: float, top_mps: float) -> Array:
    """(k, 3) speeds that grow to the top, distance and time until each, from speeds at even times."""
    count = int(np.argmax(speed >= 0.999 * top_mps)) + 1 if (speed >= 0.999 * top_mps).any() else len(speed)
    most = np.maximum.accumulate(speed[:count])
    path_m = np.r_[0.0, np.cumsum((speed[1:count] + speed[: count - 1]) / 2 * step_s)]
    most += 1e-9 * np.arange(count)  # strictly increasing, for interpolation
    return np.column_stack([most, path_m, step_s * np.arange(count)])


@dataclass(frozen=True, kw_only=True, eq=False)
class HelmPlanner:
    """Legs recover from the run before, turn on Dubins curves, and end with a straight run-up."""

    ship: HelmShip  # speeds, turns, stopping
    # by a run's name, as a space may have fewer runs: (4,) displacement by which the ship recovers from it before its
    # first turn: ahead m, to starboard m, course from the heading at the run's end rad, time s
    recoveries: Mapping[str, Array]

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
        points = path_points(space, departures.pose, PATH_STRETCHES)
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

    def ways_on(self, space: SearchSpace, primitive: np.ndarray, start: Array, end: Array) -> np.ndarray:
        """(n,) whether arcs lead to the run-ups of runs, and on from where the ship has recovered from them."""
        back_m = np.array([-self.times.straight_m(run.entry_mps) for run in space.footprints])[primitive]
        found = ways_on(space, moved(start, back_m[:, None] * (1.0, 0.0, 0.0)), backwards=True)
        steps = np.array([self.recoveries[run.name][:3] for run in space.footprints])
        found[found] = ways_on(space, moved(end[found], steps[primitive[found]]))
        return found

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
            return self.recoveries[space.footprints[last].name]
        return np.array([space.hull_m, 0.0, 0.0, space.hull_m / self.ship.transit_speed_mps])


def recoveries(ship: HelmShip, water: LegWater, runs: Sequence[Primitive]) -> dict[str, Array]:
    """(4,) displacement by which the ship recovers from each run, by its name, in calm water."""
    calm = replace(water, environment=CALM)
    scales = {"sample_time_s": water.vessel.sample_time_s, "hull_m": water.vessel.length_m}
    found = dict[str, Array]()
    for run in runs:
        checked = recover(last_state(run.trajectory), calm.remembered(run.commands.values), calm, ship)
        found[run.name] = readonly(displaced(checked, ship, **scales))
    return found
