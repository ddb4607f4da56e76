"""How long legs of ships with a helm take, for the search: gather way, go on, shed way, by the ship's own simulation.

Such a ship needs way to change her speed: a leg too short for it is sailed by going astern first, which takes long. She
checks her swing, goes along a Dubins curve, and straight for the last hull length before a run.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from expdesign.plan.control import RUN_UP, Capability, full_ahead, stopped
from expdesign.plan.legs.dubins_length import dubins_m
from expdesign.values import Array, seal

TOO_SHORT = 12.0
"""What a metre costs that a leg is too short by, in metres at transit speed: it is fetched by going back, slowly."""
AT_REST = 5.0
"""Hull lengths that legs to a stop have at least: a ship that is off her track has to come back to it before."""
SPARE = 0.8
"""Hull lengths by which legs to runs are longer than speeds change in: the helm takes some."""
DRIFTS = 3
"""Rounds in which the time of a leg and the drift in that time are made to agree."""
PEAKS = 60
"""Highest speeds of legs that are tabulated."""
STOPPED = 0.3
"""Transit speeds below which a ship has stopped or is about to: no run-up then."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HelmTimes:
    """What the rule needs.

    Attributes:
        speed_mps, radius_m: of long legs, and of their turns.
        run_up_m, steady_m: straight before each run, and the last of that, steady.
        at_rest_m: of legs to a stop at least.
        spare_m: before a run besides the way in which speeds change.
        answer_s: until a new engine order is worth what it says.
        gathered: (k, 3) speed m/s, way m and time s from rest with the engines full ahead.
        shed: (k, 3) the same until rest with the engines full astern, counted backwards.
    """

    speed_mps: float
    radius_m: float
    run_up_m: float
    steady_m: float
    at_rest_m: float
    spare_m: float
    answer_s: float
    gathered: Array
    shed: Array

    def __post_init__(self) -> None:
        seal(self, gathered="g 3", shed="s 3")

    def seconds(self, length_m: Array, exit_mps: float, entry_mps: float) -> Array:
        """(...,) time of legs of such lengths through water from one speed to another [s]."""
        way_m, time_s = self._table(exit_mps, entry_mps)
        least_m = way_m[0] if entry_mps > STOPPED * self.speed_mps else max(way_m[0], self.at_rest_m)
        return np.asarray(
            np.interp(length_m, way_m, time_s)
            + np.maximum(length_m - way_m[-1], 0.0) / self.speed_mps
            + TOO_SHORT * np.maximum(least_m - length_m, 0.0) / self.speed_mps
        )

    def lost_s(self, exit_mps: float, entry_mps: float, *, carried: bool) -> float:
        """Least time of a leg, or if `carried`, as the way needs legs, least time lost against transit speed [s]."""
        way_m, time_s = self._table(exit_mps, entry_mps)
        return float((time_s - carried * way_m / self.speed_mps).min())

    def between_s(
        self, froms: Array, tos: Array, off: Array, exit_mps: float, entry_mps: float, *, current_to: Array
    ) -> Array:
        """(n,) time of legs in open water between poses (n, 3).

        Args:
            froms, tos: over ground.
            off: what comes before the first turn, as `SearchSpace.off` tells.
            exit_mps, entry_mps: speeds at the ends.
            current_to: of the water, with which a leg drifts.
        """
        straight_m = self._straight_m(entry_mps)
        begins, ends = moved(froms, off[None, :3]), moved(tos, np.array([[-straight_m, 0.0, 0.0]]))
        along_m, leg_s = float(np.hypot(*off[:2])) + straight_m, np.zeros(len(tos))
        over_ground_m = dubins_m(
            begins, ends, radius_m=self.radius_m
        )  # legs are first guessed there: no turn all round
        for _ in range(DRIFTS if current_to.any() else 1):
            through = np.column_stack([ends[:, :2] - leg_s[:, None] * current_to, ends[:, 2]])
            length_m = dubins_m(begins, through, radius_m=self.radius_m)
            rounds_m = np.where(over_ground_m > length_m + np.pi * self.radius_m, over_ground_m, length_m)
            leg_s = self.seconds(rounds_m + along_m, exit_mps, entry_mps)
        return leg_s

    def _straight_m(self, entry_mps: float) -> float:
        """Straight before a run, with room to settle, or before a stop."""
        return self.run_up_m if entry_mps > STOPPED * self.speed_mps else self.steady_m / 2

    def _table(self, exit_mps: float, entry_mps: float) -> tuple[Array, Array]:
        """Ways and times of legs with higher and higher speeds."""
        first, last = (float(np.clip(speed, 0.0, self.speed_mps)) for speed in (exit_mps, entry_mps))
        runs = last > STOPPED * self.speed_mps
        before_s = self.answer_s if first else 0.0  # from rest the table has it
        steady_m = self.steady_m + self.spare_m if runs else 0.0
        after_s = steady_m / last if runs else self.answer_s
        peak = np.linspace(max(first, last), self.speed_mps, PEAKS)
        way_m, time_s = (_between(self.gathered, first, peak) + _between(self.shed, last, peak)).T
        return way_m + steady_m + before_s * first, time_s + before_s + after_s


def moved(pose: Array, step: Array) -> Array:
    """(n, 3) poses moved ahead [m], to starboard [m] and turned [rad]."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    north = pose[:, 0] + c * step[:, 0] - s * step[:, 1]
    east = pose[:, 1] + s * step[:, 0] + c * step[:, 1]
    return np.stack([north, east, pose[:, 2] + step[:, 2]], axis=1)


@lru_cache(maxsize=16)
def helm_times(ship: Capability) -> HelmTimes:
    """The rule for a ship that is steered by a helm."""
    approach = ship.approach
    assert approach is not None
    return HelmTimes(
        speed_mps=ship.transit_speed_mps,
        radius_m=ship.turning_radius_m,
        run_up_m=ship.run_up_m,
        steady_m=RUN_UP * approach.helm.vessel.length_m,
        at_rest_m=AT_REST * approach.helm.vessel.length_m,
        spare_m=SPARE * approach.helm.vessel.length_m,
        answer_s=0.5 / approach.helm.drive_rate,
        gathered=_gathered(ship),
        shed=_shed(ship),
    )


def _between(table: Array, low: float, high: Array) -> Array:
    """(k, 2) way and time between one speed and others."""
    way_m, time_s = (np.interp(np.r_[low, high], table[:, 0], column) for column in table[:, 1:].T)
    return np.stack([way_m[1:] - way_m[0], time_s[1:] - time_s[0]], axis=1)


def _gathered(ship: Capability) -> Array:
    """(k, 3) from rest to transit speed, full ahead as fast as the engines answer."""
    approach = ship.approach
    assert approach is not None
    speed = np.hypot(*full_ahead(approach)[:, 3:5].T)
    return _table(speed, approach.helm.vessel.sample_time_s, ship.transit_speed_mps)


def _shed(ship: Capability) -> Array:
    """(k, 3) from transit speed to rest, looked at backwards."""
    approach = ship.approach
    assert approach is not None
    vessel = approach.helm.vessel
    speed = np.hypot(*stopped(vessel, ship.transit_speed_mps).velocity[::-1, :2].T)
    return _table(speed, vessel.sample_time_s, ship.transit_speed_mps)


def _table(speed: Array, step_s: float, top_mps: float) -> Array:
    """(k, 3) speeds that grow to the top, way and time until each, of speeds at even times."""
    count = int(np.argmax(speed >= 0.999 * top_mps)) + 1 if (speed >= 0.999 * top_mps).any() else len(speed)
    most = np.maximum.accumulate(speed[:count])
    way_m = np.r_[0.0, np.cumsum((speed[1:count] + speed[: count - 1]) / 2 * step_s)]
    most += 1e-9 * np.arange(count)  # that every speed has its place
    return np.column_stack([most, way_m, step_s * np.arange(count)])
