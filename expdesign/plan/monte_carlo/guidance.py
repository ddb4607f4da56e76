"""From wherever a run has ended to the beginning of the next: many ships at once, each at its own point of the way.

The procedure is that of `expdesign.plan.monte_carlo.procedure`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expdesign.plan.control import CONTROL, Helmsman, Reference
from expdesign.plan.legs import LegWater, nearest_turns
from expdesign.plan.monte_carlo.go_around import GoAroundPaths
from expdesign.plan.monte_carlo.procedure import (
    ABORT_CAUSES,
    AFTER,
    MOST_GO_AROUNDS,
    Tolerances,
    planned_stretch,
    run_up,
    under_way,
)
from expdesign.plan.monte_carlo.return_paths import PathFollowers, ReturnPaths, build_return_paths
from expdesign.plan.runs import Fleet
from expdesign.values import Array

ON_STRETCH, ON_WAY, BEGUN, ABORTED, OUT = range(5)
"""What a ship does: follows a reference, goes round, has come to the start, has given up, takes no part."""
PATIENCE = 3.0
"""Times what a stretch or a way takes that a ship may spend on it, besides `SPARE`."""
SPARE = 10.0
"""Time constants of the way back to a reference that a ship may spend besides."""
LEAST_STEP = 0.2
"""What a slow reference moves in a sample at least, in samples at transit speed."""
COARSE = 5
"""Samples between the points of a way back that is looked at beforehand."""
MADE_GOOD = 0.5
"""Share of a leg's time that a ship may need to come back to it."""
ARRIVED = 1.0
"""Hull lengths from the goal within which a trial has come to it."""
STEADY = 2.0
"""Hull lengths before the start in which ships with a helm steer the heading, not the track: there they drift."""
HELD = 0.5
"""Share of the tolerances within which a ship that stands still begins; all of them after half of `SPARE`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Approach:
    """How n ships came to the start of a run.

    Attributes:
        poses: (t, n, 3) at every sample; ships that had begun or given up stay where they were.
        begun: (n,) in place; the others among those that sailed gave up.
        go_arounds: (n,) times gone round.
        samples: (n,) that it took.
        abort_cause: (n,) number in `ABORT_CAUSES` of what those that gave up could not keep.
        unexplained: (n, 3) acceleration that each helmsman's model does not explain, as he believes in the end.
    """

    poses: Array
    begun: np.ndarray
    go_arounds: np.ndarray
    samples: np.ndarray
    abort_cause: np.ndarray
    unexplained: Array


class Pilot:
    """Steers a fleet along one planned leg, and round to its run-up where need be."""

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
            helm, water: who steers, and where ways lead.
            track: (k + 1, 6) the planned leg.
            within: what is in place at its end.
            sailing: (n,) ships that take part.
            inputs: (m,) commands with which the run begins: azimuths keep near their angles.
            last: the leg leads to the goal: coming there is enough.
        """
        after_m = 0.0 if last else max(AFTER * helm.vessel.length_m, within.position_m)
        n, planned, runs_up = len(sailing), planned_stretch(helm, track, after_m), run_up(helm, water, track, after_m)
        self._helm, self._water, self._inputs, self._last = helm, water, inputs, last
        self._desired, self._moves, self._within = track[-1], under_way(helm, track[-1]), within
        self._reference = Reference(states=np.concatenate([planned.states, runs_up.states]))
        self._first, self._arrival = len(planned.states), len(planned.states) + runs_up.arrival
        length_m = float(np.hypot(*(runs_up.states[0] - track[-1])[:2]))
        reach_m = np.clip(length_m / 5, self._within.position_m / 2, helm.vessel.length_m)
        self._convoy = PathFollowers(helm, runs_up.states[0], n, reach_m=float(reach_m))
        self.doing = np.where(sailing, ON_STRETCH, OUT)
        self._sample, self._end, self._most = np.zeros(n), np.full(n, planned.arrival), np.full(n, self._first - 1)
        self.go_arounds, self.samples = np.zeros(n, dtype=int), np.zeros(n, dtype=int)
        self._abort_cause = np.full(n, ABORT_CAUSES.index("time"))
        self._spent, self._limit = np.zeros(n), np.full(n, self._allowed(len(track)))

    def sail(self, fleet: Fleet, unexplained: Array) -> Approach:
        """Until every ship has begun or given up, with the accelerations unexplained so far (n, 3)."""
        poses = [fleet.states[:, :3]]
        self._rejoin(fleet.states)
        while (moving := self._looked(fleet)).any():
            before, desired = fleet.states, self._next(fleet.states)
            near = self._near(fleet.given)
            told = self._helm.commands(
                desired, before, fleet.given, unexplained=unexplained, near=near, delivered=fleet.delivered
            )
            fleet.advance(told, moving)
            learnt = self._helm.unexplained(unexplained, before, fleet.states, fleet.delivered)
            unexplained = np.where(moving[:, None], learnt, unexplained)
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

    def _looked(self, fleet: Fleet) -> np.ndarray:
        """Decide what every ship does from here; (n,) whether it sails on."""
        states, late = fleet.states, self._spent > self._limit
        self.doing[fleet.lost & (self.doing < BEGUN)] = ABORTED
        on = self.doing == ON_STRETCH
        passed, good = self._at_start(states)
        self.doing[on & passed & good] = BEGUN
        worst = 0 if self._last else self._within.used(states, self._desired).argmax(axis=1)
        self._abort_cause = np.where(on & passed, worst, np.where(late, ABORT_CAUSES.index("time"), self._abort_cause))
        self.doing[(self.doing == ON_WAY) & late] = ABORTED
        self._run_up((self.doing == ON_WAY) & self._convoy.arrived(states))
        self._go_around(on & (self.doing == ON_STRETCH) & (passed | late), states)
        return np.asarray(self.doing < BEGUN)

    def _at_start(self, states: Array) -> tuple[np.ndarray, np.ndarray]:
        """(n,) whether a ship is as near to the start as it will come this time, and whether it may begin then."""
        shares, at_end = self._within.used(states, self._desired), self._sample >= self._end
        used = shares.max(axis=1)
        if self._last:
            there = np.hypot(*(states[:, :2] - self._desired[:2]).T) <= ARRIVED * self._helm.vessel.length_m
            waits = self._helm.ship.keeps_station & (self._spent <= self._limit - self._spare / 2)
            return at_end & (there | ~waits), there
        if not self._moves:
            waited = self._spent > self._limit - self._spare / 2
            return at_end & ((used <= HELD) | ((used <= 1.0) & waited)), used <= 1.0
        gone_by = (self._sample >= self._most) | (shares[:, 0] > 1.0)
        return (self._sample >= self._end - 1.0) & ((used <= 1.0) | gone_by), used <= 1.0

    def _run_up(self, ships: np.ndarray) -> None:
        self.doing[ships] = ON_STRETCH
        self._sample[ships], self._end[ships] = self._first, self._arrival
        self._most[ships], self._spent[ships] = len(self._reference.states) - 1, 0
        self._limit[ships] = self._allowed(self._arrival - self._first)

    def _rejoin(self, states: Array) -> None:
        """Ships go round at once that are farther off than the leg's time makes good, or see no clear way back."""
        first, helm = self._reference.states[0, :2], self._helm
        off_m = np.hypot(*(states[:, :2] - first).T)
        leg_s = self._end[0] * helm.vessel.sample_time_s
        good_m = self._within.position_m + MADE_GOOD * CONTROL.catch_up * helm.ship.transit_speed_mps * leg_s
        strayed = (self.doing == ON_STRETCH) & (off_m > self._within.position_m)
        some = np.flatnonzero(strayed)
        if len(some):
            clear = np.array([self._tree.holds(self._way_back(states[ship, :2])) for ship in some])
            strayed[some] = ~clear | ((off_m[some] > good_m) & (not self._last))
            self._go_around(strayed, states)

    def _way_back(self, place: Array) -> Array:
        """(k, 2) about how a ship at a place comes back to the leg, while the leg goes on abeam of her."""
        track, helm = self._reference.states[: self._first, :2], self._helm
        off = place - track[0]
        back_s = float(np.hypot(*off)) / (CONTROL.catch_up * helm.ship.transit_speed_mps)
        thinned = np.unique(np.r_[np.arange(0, self._first, COARSE), self._first - 1])
        left = np.maximum(0.0, 1.0 - thinned * helm.vessel.sample_time_s / back_s)
        return np.asarray((track[thinned] + left[:, None] * off)[: int((left > 0.0).sum()) + 1])

    def _go_around(self, ships: np.ndarray, states: Array) -> None:
        """Set ships off to the run-up; those that went round often enough, or have no way, give up."""
        self.doing[ships] = ABORTED
        some = np.flatnonzero(ships & (self.go_arounds < MOST_GO_AROUNDS))
        if not len(some):
            return
        self.go_arounds[some] += 1
        sideways = self._helm.ship.keeps_station
        ways = self._tree.find(states[some, :2]) if sideways else [self._arcs.find(x) for x in states[some, :3]]
        for ship, way in zip(some.tolist(), ways, strict=True):
            if way is None:
                self._abort_cause[ship] = ABORT_CAUSES.index("no way round")
            else:
                self.doing[ship] = ON_WAY
                self._convoy.set_off(ship, way)
        sample_m = self._helm.ship.transit_speed_mps * self._helm.vessel.sample_time_s
        self._spent[some] = 0
        self._limit[some] = self._allowed(self._convoy.length_m[some] / sample_m)

    @cached_property
    def _arcs(self) -> GoAroundPaths:
        helm = self._helm
        return GoAroundPaths(
            goal=self._convoy.goal[:3],
            radius_m=helm.ship.turning_radius_m,
            spacing_m=helm.vessel.length_m,
            holds=self._tree.holds,
        )

    @cached_property
    def _tree(self) -> ReturnPaths:
        return build_return_paths(self._water.narrowest_graph, self._convoy.goal[:2])

    def _near(self, given: Array) -> Array:
        """(n, m) commands to whose angles azimuths keep: those of the run for ships that come to it under way."""
        ready = nearest_turns(self._helm.vessel, self._inputs, given)
        return np.where((self._moves & (self.doing == ON_STRETCH))[:, None], ready, given)

    def _next(self, states: Array) -> Array:
        """(n, 6) what is desired of each ship over the next sample; references move on."""
        on = self.doing == ON_STRETCH
        desired = np.zeros((len(on), 6))
        if (self.doing == ON_WAY).any():
            desired = self._convoy.desired(states)
        if not on.any():
            return desired
        pace = self._reference.abreast(self._sample, states, step_m=self._least_step_m)
        self._sample = np.where(on, np.minimum(self._sample + pace, self._most), self._sample)
        soon = np.minimum(self._sample + self._helm.answer_s / self._helm.vessel.sample_time_s, self._most)
        now = self._reference.at(self._sample)
        now[:, 3:] = self._reference.at(soon)[:, 3:]  # a ship answers late: her speed is asked for beforehand
        now[:, :2] = np.where(self._steadies()[:, None], states[:, :2], now[:, :2])
        return np.where(on[:, None], now, desired)

    def _steadies(self) -> np.ndarray:
        """(n,) whether a ship that an unknown current sets aside no longer points into it, to begin as planned."""
        helm = self._helm
        if self._last or helm.ship.keeps_station or not self._moves:
            return np.zeros(len(self._sample), dtype=bool)
        sample_m = float(np.hypot(*self._desired[3:5])) * helm.vessel.sample_time_s
        return np.asarray(self._end - self._sample <= STEADY * helm.vessel.length_m / sample_m)

    @property
    def _least_step_m(self) -> float:
        return LEAST_STEP * self._helm.ship.transit_speed_mps * self._helm.vessel.sample_time_s

    @property
    def _spare(self) -> float:
        return SPARE * CONTROL.track_lead * self._helm.answer_s / self._helm.vessel.sample_time_s

    def _allowed(self, samples: Array | float) -> Array | float:
        return PATIENCE * samples + self._spare


def open_loop(helm: Helmsman, fleet: Fleet, values: Array, sailing: np.ndarray) -> Array:
    """(k + 1, n, 3) poses of ships that are given commands (k, m), from those standing on, within the rates."""
    poses = [fleet.states[:, :3]]
    told = values + (nearest_turns(helm.vessel, values[0], fleet.given) - values[0])[:, None]
    reach = np.array([limit.rate for limit in helm.vessel.limits]) * helm.vessel.sample_time_s
    for row in told.swapaxes(0, 1):
        fleet.advance(np.clip(row, fleet.given - reach, fleet.given + reach), sailing)
        poses.append(fleet.states[:, :3])
    return np.array(poses)
