"""Guidance of many ships along a planned leg to the start of its run, by `expdesign.plan.monte_carlo.procedure`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expdesign.plan.control import CONTROL, Helmsman, Reference
from expdesign.plan.legs import LegWater, nearest_turns
from expdesign.plan.monte_carlo.go_around import GoAroundPaths
from expdesign.plan.monte_carlo.procedure import ABORT_CAUSES, Tolerances, planned_stretch, run_up, under_way
from expdesign.plan.monte_carlo.return_paths import PathFollowers, ReturnPaths, build_return_paths
from expdesign.plan.monte_carlo.tuning import MONTE_CARLO
from expdesign.plan.runs import Fleet
from expdesign.values import Array

TRACKING, RETURNING, BEGUN, ABORTED, OUT = range(5)
"""What a ship does: tracks a reference, follows a return path, has begun the run, has aborted, takes no part."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Approach:
    """How n ships reached the start of a run.

    Attributes:
        poses: (t, n, 3) at every sample; ships that have begun or aborted stay where they are.
        begun: (n,) within tolerance; the others that sailed aborted.
        go_arounds: (n,) of each ship.
        samples: (n,) that it took.
        abort_cause: (n,) index in `ABORT_CAUSES`, for ships that aborted.
        unexplained: (n, 3) estimate at the end of the acceleration that the nominal model does not explain.
    """

    poses: Array
    begun: np.ndarray
    go_arounds: np.ndarray
    samples: np.ndarray
    abort_cause: np.ndarray
    unexplained: Array


class Guidance:
    """Steers a fleet along one planned leg, and back to its run-up where needed."""

    def __init__(
        self,
        helm: Helmsman,
        water: LegWater,
        track: Array,
        *,
        within: Tolerances,
        sailing: np.ndarray,
        inputs: Array,
        last: bool,
    ) -> None:
        """Ships stand wherever they are.

        Args:
            helm, water: the controller, and the water that paths keep to.
            track: (k + 1, 6) the planned leg.
            within: tolerances at its end.
            sailing: (n,) ships that take part.
            inputs: (m,) commands with which the run begins: azimuths keep near their angles.
            last: whether the leg leads to the goal, where the position alone counts.
        """
        after_m = 0.0 if last else max(MONTE_CARLO.past_start_hulls * helm.vessel.length_m, within.position_m)
        n, planned, runs_up = len(sailing), planned_stretch(helm, track, after_m), run_up(helm, water, track, after_m)
        self._helm, self._water, self._inputs, self._last = helm, water, inputs, last
        self._desired, self._moves, self._within = track[-1], under_way(helm, track[-1]), within
        self._reference = Reference(states=np.concatenate([planned.states, runs_up.states]))
        self._first, self._arrival = len(planned.states), len(planned.states) + runs_up.arrival
        length_m = float(np.hypot(*(runs_up.states[0] - track[-1])[:2]))
        reach_m = np.clip(length_m / 5, self._within.position_m / 2, helm.vessel.length_m)
        self._followers = PathFollowers(helm, runs_up.states[0], n, reach_m=float(reach_m))
        self.doing = np.where(sailing, TRACKING, OUT)
        self._sample, self._end, self._most = np.zeros(n), np.full(n, planned.arrival), np.full(n, self._first - 1)
        self.go_arounds, self.samples = np.zeros(n, dtype=int), np.zeros(n, dtype=int)
        self._abort_cause = np.full(n, ABORT_CAUSES.index("time"))
        self._spent, self._limit = np.zeros(n), np.full(n, self._allowed(len(track)))

    def sail(self, fleet: Fleet, unexplained: Array) -> Approach:
        """Until every ship has begun or aborted, from the estimates of unexplained acceleration so far (n, 3)."""
        poses = [fleet.states[:, :3]]
        self._rejoin(fleet.states)
        while (moving := self._decided(fleet)).any():
            before, desired = fleet.states, self._next(fleet.states)
            near = self._near(fleet.given)
            commands = self._helm.commands(
                desired, before, fleet.given, unexplained=unexplained, near=near, delivered=fleet.delivered
            )
            fleet.advance(commands, moving)
            estimate = self._helm.unexplained(unexplained, before, fleet.states, fleet.delivered)
            unexplained = np.where(moving[:, None], estimate, unexplained)
            self.samples += moving
            self._spent += moving
            poses.append(fleet.states[:, :3])
        return Approach(
            poses=np.array(poses),
            begun=self.doing == BEGUN,
            go_arounds=self.go_arounds,
            samples=self.samples,
            abort_cause=self._abort_cause,
            unexplained=unexplained,
        )

    def _decided(self, fleet: Fleet) -> np.ndarray:
        """Decide what every ship does next; (n,) whether it sails on."""
        states, late = fleet.states, self._spent > self._limit
        self.doing[fleet.lost & (self.doing < BEGUN)] = ABORTED
        on = self.doing == TRACKING
        passed, good = self._at_start(states)
        self.doing[on & passed & good] = BEGUN
        worst = 0 if self._last else self._within.used(states, self._desired).argmax(axis=1)
        self._abort_cause = np.where(on & passed, worst, np.where(late, ABORT_CAUSES.index("time"), self._abort_cause))
        self.doing[(self.doing == RETURNING) & late] = ABORTED
        self._run_up((self.doing == RETURNING) & self._followers.arrived(states))
        self._go_around(on & (self.doing == TRACKING) & (passed | late), states)
        return np.asarray(self.doing < BEGUN)

    def _at_start(self, states: Array) -> tuple[np.ndarray, np.ndarray]:
        """(n,) whether a ship is as near to the start as it will get this time, and whether it may begin there."""
        shares, at_end = self._within.used(states, self._desired), self._sample >= self._end
        used = shares.max(axis=1)
        if self._last:
            there = (
                np.hypot(*(states[:, :2] - self._desired[:2]).T)
                <= MONTE_CARLO.arrived_hulls * self._helm.vessel.length_m
            )
            waits = self._helm.ship.keeps_station & (self._spent <= self._limit - self._waiting / 2)
            return at_end & (there | ~waits), there
        if not self._moves:
            waited = self._spent > self._limit - self._waiting / 2
            return at_end & ((used <= MONTE_CARLO.standstill_share) | ((used <= 1.0) & waited)), used <= 1.0
        gone_by = (self._sample >= self._most) | (shares[:, 0] > 1.0)
        return (self._sample >= self._end - 1.0) & ((used <= 1.0) | gone_by), used <= 1.0

    def _run_up(self, ships: np.ndarray) -> None:
        self.doing[ships] = TRACKING
        self._sample[ships], self._end[ships] = self._first, self._arrival
        self._most[ships], self._spent[ships] = len(self._reference.states) - 1, 0
        self._limit[ships] = self._allowed(self._arrival - self._first)

    def _rejoin(self, states: Array) -> None:
        """Ships too far off to return within the leg's time, or without a clear return to it, go around at once."""
        first, helm = self._reference.states[0, :2], self._helm
        off_m = np.hypot(*(states[:, :2] - first).T)
        leg_s = self._end[0] * helm.vessel.sample_time_s
        good_m = (
            self._within.position_m + MONTE_CARLO.rejoin_share * CONTROL.catch_up * helm.ship.transit_speed_mps * leg_s
        )
        off = (self.doing == TRACKING) & (off_m > self._within.position_m)
        some = np.flatnonzero(off)
        if len(some):
            clear = np.array([self._tree.holds(self._return_to_leg(states[ship, :2])) for ship in some])
            off[some] = ~clear | ((off_m[some] > good_m) & (not self._last))
            self._go_around(off, states)

    def _return_to_leg(self, place: Array) -> Array:
        """(k, 2) approximate track of a ship from a place back to the leg, while the reference stays abeam."""
        track, helm = self._reference.states[: self._first, :2], self._helm
        off = place - track[0]
        return_s = float(np.hypot(*off)) / (CONTROL.catch_up * helm.ship.transit_speed_mps)
        thinned = np.unique(np.r_[np.arange(0, self._first, MONTE_CARLO.rejoin_samples), self._first - 1])
        left = np.maximum(0.0, 1.0 - thinned * helm.vessel.sample_time_s / return_s)
        return np.asarray((track[thinned] + left[:, None] * off)[: int((left > 0.0).sum()) + 1])

    def _go_around(self, ships: np.ndarray, states: Array) -> None:
        """Start ships on return paths to the run-up; those without a path, or go-arounds left, abort."""
        self.doing[ships] = ABORTED
        some = np.flatnonzero(ships & (self.go_arounds < MONTE_CARLO.go_arounds))
        if not len(some):
            return
        self.go_arounds[some] += 1
        sideways = self._helm.ship.keeps_station
        paths = self._tree.find(states[some, :2]) if sideways else [self._arcs.find(x) for x in states[some, :3]]
        for ship, path in zip(some.tolist(), paths, strict=True):
            if path is None:
                self._abort_cause[ship] = ABORT_CAUSES.index("no go-around path")
            else:
                self.doing[ship] = RETURNING
                self._followers.start(ship, path)
        sample_m = self._helm.ship.transit_speed_mps * self._helm.vessel.sample_time_s
        self._spent[some] = 0
        self._limit[some] = self._allowed(self._followers.length_m[some] / sample_m)

    @cached_property
    def _arcs(self) -> GoAroundPaths:
        helm = self._helm
        return GoAroundPaths(
            goal=self._followers.goal[:3],
            radius_m=helm.ship.turning_radius_m,
            spacing_m=helm.vessel.length_m,
            holds=self._tree.holds,
        )

    @cached_property
    def _tree(self) -> ReturnPaths:
        return build_return_paths(self._water.narrowest_graph, self._followers.goal[:2])

    def _near(self, given: Array) -> Array:
        """(n, m) commands to whose angles azimuths keep: those of the run for ships that approach it under way."""
        ready = nearest_turns(self._helm.vessel, self._inputs, given)
        return np.where((self._moves & (self.doing == TRACKING))[:, None], ready, given)

    def _next(self, states: Array) -> Array:
        """(n, 6) desired state of each ship over the next sample; references advance."""
        on = self.doing == TRACKING
        desired = np.zeros((len(on), 6))
        if (self.doing == RETURNING).any():
            desired = self._followers.desired(states)
        if not on.any():
            return desired
        pace = self._reference.abreast(self._sample, states, step_m=self._least_step_m)
        self._sample = np.where(on, np.minimum(self._sample + pace, self._most), self._sample)
        soon = np.minimum(self._sample + self._helm.answer_s / self._helm.vessel.sample_time_s, self._most)
        now = self._reference.at(self._sample)
        now[:, 3:] = self._reference.at(soon)[:, 3:]  # velocities respond with a lag: they are demanded ahead of time
        now[:, :2] = np.where(self._steadying()[:, None], states[:, :2], now[:, :2])
        return np.where(on[:, None], now, desired)

    def _steadying(self) -> np.ndarray:
        """(n,) whether a ship keeps its heading and drifts with an unknown current, to begin on the planned heading."""
        helm = self._helm
        if self._last or helm.ship.keeps_station or not self._moves:
            return np.zeros(len(self._sample), dtype=bool)
        sample_m = float(np.hypot(*self._desired[3:5])) * helm.vessel.sample_time_s
        return np.asarray(self._end - self._sample <= MONTE_CARLO.steady_hulls * helm.vessel.length_m / sample_m)

    @property
    def _least_step_m(self) -> float:
        return MONTE_CARLO.least_step * self._helm.ship.transit_speed_mps * self._helm.vessel.sample_time_s

    @property
    def _waiting(self) -> float:
        """Samples that a ship may take beyond what is planned."""
        time_constants = MONTE_CARLO.waiting_time_constants * CONTROL.track_lead
        return time_constants * self._helm.answer_s / self._helm.vessel.sample_time_s

    def _allowed(self, samples: Array | float) -> Array | float:
        return MONTE_CARLO.patience * samples + self._waiting


def open_loop(helm: Helmsman, fleet: Fleet, values: Array, sailing: np.ndarray) -> Array:
    """(k + 1, n, 3) poses of ships under commands (k, m), limited by the rates from the standing ones on."""
    poses = [fleet.states[:, :3]]
    commands = values + (nearest_turns(helm.vessel, values[0], fleet.given) - values[0])[:, None]
    reach = np.array([limit.rate for limit in helm.vessel.limits]) * helm.vessel.sample_time_s
    for row in commands.swapaxes(0, 1):
        fleet.advance(np.clip(row, fleet.given - reach, fleet.given + reach), sailing)
        poses.append(fleet.states[:, :3])
    return np.array(poses)
