"""A rule for the time of legs of helm-steered ships: accelerate, go on, stop, as the ship's own simulation does.

Such a ship needs distance to change its speed: on a leg too short for it, it has to go astern first, which takes long.
It recovers from the run before, follows a Dubins curve, and goes straight for the last hull length before a run.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from expdesign.plan.control import CONTROL, HelmShip, full_ahead, stopped
from expdesign.plan.local_planner.arcs import moved
from expdesign.plan.local_planner.dubins_length import dubins_m
from expdesign.plan.local_planner.tuning import LOCAL
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class HelmTimes:
    """What the rule needs.

    Attributes:
        speed_mps, radius_m: of long legs, and of their turns.
        run_up_m, steady_m: straight before each run, and the last of that, steady.
        at_rest_m: of legs to a stop at least.
        spare_m: before a run besides the distance in which speeds change.
        answer_s: until a new engine order takes effect.
        speeding_up: (k, 3) speed m/s, distance m and time s from rest with the engines full ahead.
        stopping: (k, 3) the same until rest with the engines full astern, counted backwards.
    """

    speed_mps: float
    radius_m: float
    run_up_m: float
    steady_m: float
    at_rest_m: float
    spare_m: float
    answer_s: float
    speeding_up: Array
    stopping: Array

    def __post_init__(self) -> None:
        seal(self, speeding_up="g 3", stopping="s 3")

    def seconds(self, length_m: Array, exit_mps: float, entry_mps: float) -> Array:
        """(...,) time of legs of such lengths through water from one speed to another [s]."""
        path_m, time_s = self._table(exit_mps, entry_mps)
        least_m = path_m[0] if entry_mps > LOCAL.stopped_share * self.speed_mps else max(path_m[0], self.at_rest_m)
        return np.asarray(
            np.interp(length_m, path_m, time_s)
            + np.maximum(length_m - path_m[-1], 0.0) / self.speed_mps
            + LOCAL.too_short * np.maximum(least_m - length_m, 0.0) / self.speed_mps
        )

    def lost_s(self, exit_mps: float, entry_mps: float, *, made_good: bool) -> float:
        """Least time of a leg, or where its displacement counts, least time lost against transit speed [s]."""
        length_m, time_s = self._table(exit_mps, entry_mps)
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
        straight_m = self._straight_m(entry_mps)
        begins, ends = moved(froms, recovery[None, :3]), moved(tos, np.array([[-straight_m, 0.0, 0.0]]))
        along_m, leg_s = float(np.hypot(*recovery[:2])) + straight_m, np.zeros(len(tos))
        # legs are first guessed over ground: no turn all round
        over_ground_m = dubins_m(begins, ends, radius_m=self.radius_m)
        for _ in range(LOCAL.drift_rounds if current_to.any() else 1):
            through = np.column_stack([ends[:, :2] - leg_s[:, None] * current_to, ends[:, 2]])
            length_m = dubins_m(begins, through, radius_m=self.radius_m)
            length_m = np.where(over_ground_m > length_m + np.pi * self.radius_m, over_ground_m, length_m)
            leg_s = self.seconds(length_m + along_m, exit_mps, entry_mps)
        return leg_s

    def _straight_m(self, entry_mps: float) -> float:
        """Straight before a run, with room to settle, or before a stop."""
        return self.run_up_m if entry_mps > LOCAL.stopped_share * self.speed_mps else self.steady_m / 2

    def _table(self, exit_mps: float, entry_mps: float) -> tuple[Array, Array]:
        """Lengths and times of legs with higher and higher peak speeds."""
        first, last = (float(np.clip(speed, 0.0, self.speed_mps)) for speed in (exit_mps, entry_mps))
        runs = last > LOCAL.stopped_share * self.speed_mps
        before_s = self.answer_s if first else 0.0  # from rest the table has it
        steady_m = self.steady_m + self.spare_m if runs else 0.0
        after_s = steady_m / last if runs else self.answer_s
        peak = np.linspace(max(first, last), self.speed_mps, LOCAL.tabled_speeds)
        path_m, time_s = (_between(self.speeding_up, first, peak) + _between(self.stopping, last, peak)).T
        return path_m + steady_m + before_s * first, time_s + before_s + after_s


@lru_cache(maxsize=16)
def helm_times(ship: HelmShip) -> HelmTimes:
    """The rule for a ship that is steered by a helm."""
    approach = ship.approach
    return HelmTimes(
        speed_mps=ship.transit_speed_mps,
        radius_m=ship.turning_radius_m,
        run_up_m=ship.run_up_m,
        steady_m=CONTROL.approach_hulls * approach.helm.vessel.length_m,
        at_rest_m=LOCAL.stop_leg_hulls * approach.helm.vessel.length_m,
        spare_m=LOCAL.run_leg_spare_hulls * approach.helm.vessel.length_m,
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
