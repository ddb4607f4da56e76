"""Guidance of many ships along a planned leg to the start of its run, by `expdesign.plan.monte_carlo.procedure`."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from expdesign.conventions import whole_turns
from expdesign.plan.control import CATCH_UP, TRACK_LEAD, Helmsman, Reference, lengths
from expdesign.plan.legs import LegWater
from expdesign.plan.monte_carlo.procedure import (
    ABORT_CAUSES,
    Approach,
    Tolerances,
    at_rest,
    goal_within_m,
    planned_stretch,
    run_up,
)
from expdesign.plan.monte_carlo.return_paths import (
    GoAroundPaths,
    PathFollowers,
    ReturnPaths,
    build_go_arounds,
    build_return_paths,
)
from expdesign.plan.runs import Fleet
from expdesign.values import Array

GO_AROUNDS = 4  # for one run at most; then the trial is aborted
PAST_START_HULLS = 1.0  # hull lengths past the start over which a reference continues steadily
# a ship may take so many times as long as planned for a reference or a path, and so many time constants of the return
# to a reference besides
PATIENCE, WAITING_TIME_CONSTANTS = 3.0, 10.0
LONGEST_ATTEMPTS = 2.0  # times that a first attempt may take, which a leg may take in any case
LEAST_STEP = 0.2  # movement of a slow reference per sample, in that at transit speed
PARALLEL_SHARE = 0.5  # of the tolerance of a run's start position, by which a ship may sail beside the leg before it
REJOIN_SAMPLES = 5  # samples between the points at which a return to the leg is checked against the shore
REJOIN_SHARE = 0.5  # of a leg's time within which a ship must be able to return to it
LAST_WAY = 2.0  # way that is left, in the distance from which the goal is reached, on which a ship may reach it
# distance from the start within which helm-steered ships keep the heading, not the track: there they drift; longer
# where starts are less exact, as far as so many tolerances of the position
STEADY_HULLS, STEADY_ROOM = 2.0, 2.0
# of the tolerances within which a ship at a standstill begins; the whole ones after half of the waiting time
STANDSTILL_SHARE = 0.5
SIDEWAYS_SHARE = 0.5  # of an azimuth's thrust ahead or astern, below which it counts as to the side


STRAIGHT = 2  # points of a path without bends
TRACKING, RETURNING, BEGUN, ABORTED, OUT = range(5)
"""What a ship does: tracks a reference, follows a return path, has begun the run, has aborted, takes no part."""


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
        longest: float = np.inf,
    ) -> None:
        """Ships stand wherever they are.

        Args:
            helm, water: the controller, and the water that paths keep to.
            track: (k + 1, 6) the planned leg.
            within: tolerances at its end.
            sailing: (n,) ships that take part.
            inputs: (m,) commands with which the run begins: azimuths keep near their angles.
            last: whether the leg leads to the goal, where the position alone counts.
            longest: samples on it after which a trial is aborted, if so many are more than some attempts may take.
        """
        after_m = 0.0 if last else max(PAST_START_HULLS * helm.vessel.length_m, within.position_m)
        n, planned, runs_up = len(sailing), planned_stretch(helm, track, after_m), run_up(helm, water, track, after_m)
        self._helm, self._water, self._inputs, self._last = helm, water, inputs, last
        self._arrived, self._arrived_m = np.zeros(n, dtype=bool), goal_within_m(water)
        self._free = np.array(helm.vessel.turns_freely, dtype=float)
        self._desired, self._moves, self._within = track[-1], not at_rest(helm, track[-1]), within
        self._reference = Reference(states=np.concatenate([planned.states, runs_up.states]))
        self._first, self._arrival = len(planned.states), len(planned.states) + runs_up.arrival
        self._run_ups = {share: self._first + row for share, row in runs_up.begins.items()}
        self._usual = next(row for share, row in self._run_ups.items() if share <= 1.0)
        self._begins = np.full(n, self._usual)
        steps_m = lengths(np.diff(self._reference.states[:, :2], axis=0))
        self._way_m = np.r_[0.0, np.cumsum(steps_m)]
        begin = self._reference.states[self._usual]
        length_m = float(np.hypot(*(begin - track[-1])[:2]))
        reach_m = np.clip(length_m / 5, self._within.position_m / 2, helm.vessel.length_m)
        self._arcs_to: dict[int, tuple[GoAroundPaths, ...]] = {}
        self._followers = PathFollowers(helm, begin, n, reach_m=float(reach_m))
        self.doing = np.where(sailing, TRACKING, OUT)
        self._shift: Array = np.zeros((n, 2))
        leg_s = planned.arrival * helm.vessel.sample_time_s
        self._caught_up_m = REJOIN_SHARE * CATCH_UP * helm.ship.transit_speed_mps * leg_s
        self._at, self._end, self._most = np.zeros(n), np.full(n, planned.arrival), np.full(n, self._first - 1)
        self.go_arounds, self.samples, self._sample = np.zeros(n, dtype=int), np.zeros(n, dtype=int), 0
        self._abort_cause = np.full(n, ABORT_CAUSES.index("time"))
        self._deadline = np.full(n, self._allowed(len(track)))
        self.longest = max(longest, LONGEST_ATTEMPTS * self._allowed(len(track)))

    def sail(self, fleet: Fleet, unexplained: Array) -> Approach:
        """Until every ship has begun or aborted, from the estimates of unexplained acceleration so far (n, 3)."""
        poses, unexplained = [fleet.states[:, :3]], unexplained.copy()
        ships = np.arange(len(self.doing))
        part, estimate = fleet, unexplained
        if self._helm.ship.keeps_station and not self._last:
            self._shift = self._parallel(fleet.states)
        self._rejoin(ships, fleet.states)
        while True:
            self._decide(ships, part)
            sails = self.doing[ships] < BEGUN
            if not sails.all():
                fleet.rejoin(part, ships)
                self.samples[ships[~sails]] = self._sample
                unexplained[ships] = estimate
                ships = ships[sails]
                part, estimate = fleet.part(ships), unexplained[ships]
            if not len(ships):
                break
            before = part.states
            desired, near = self._next(ships, before), self._near(ships, part.given)
            part.advance(
                self._helm.commands(
                    desired, before, part.given, unexplained=estimate, near=near, delivered=part.delivered
                )
            )
            estimate = self._helm.unexplained(estimate, before, part.states, part.delivered)
            self._sample += 1
            poses.append(poses[-1].copy())
            poses[-1][ships] = part.states[:, :3]
        return Approach(
            poses=np.array(poses),
            begun=self.doing == BEGUN,
            go_arounds=self.go_arounds,
            samples=self.samples,
            abort_cause=self._abort_cause,
            unexplained=unexplained,
        )

    def _decide(self, ships: np.ndarray, part: Fleet) -> None:
        """Decide what ships under way (k,) do next."""
        states, late = part.states, self._sample > self._deadline[ships]
        self.doing[ships[part.lost]] = ABORTED
        if self._last:
            self._reach(ships, states)
        on = self.doing[ships] == TRACKING
        passed = self._passed(ships, states, on)
        self._abort_cause[ships[late]] = ABORT_CAUSES.index("time")
        if not on.all():
            back = self.doing[ships] == RETURNING
            self.doing[ships[back & late]] = ABORTED
            back &= ~late
            self._run_up(ships[back][self._followers.arrived(ships[back], states[back])])
        over = on & (passed | late)
        if over.any():
            over &= self.doing[ships] == TRACKING
            self._go_around(ships[over], states[over])
        if self._sample > self.longest:
            sails = ships[self.doing[ships] < BEGUN]
            self.doing[sails], self._abort_cause[sails] = ABORTED, ABORT_CAUSES.index("time")

    def _passed(self, ships: np.ndarray, states: Array, on: np.ndarray) -> np.ndarray:
        """(k,) whether ships on a reference are as near to the start as this time; those in tolerance begin."""
        if self._stops:
            passed = on & self._stopping(ships)
        else:
            early = 1.0 if self._moves and not self._last else 0.0
            passed = on & (self._at[ships] >= self._end[ships] - early)
        if passed.any():
            some = ships[passed]
            shares = self._within.used(states[passed], self._desired)
            there, good = self._at_start(some, states[passed], shares)
            self.doing[some[there & good]] = BEGUN
            self._abort_cause[some[there]] = 0 if self._last else shares.argmax(axis=1)[there]
            passed[passed] = there
        return np.asarray(passed)

    def _at_start(self, ships: np.ndarray, states: Array, shares: Array) -> tuple[np.ndarray, np.ndarray]:
        """(k,) whether a ship gets no nearer to the start this time, and whether it may begin there.

        Args:
            ships: (k,) whose reference is there.
            states: (k, 6) of these.
            shares: (k, 4) of the tolerances that they use up.
        """
        used, waited = shares.max(axis=1), self._sample > self._deadline[ships] - self._waiting / 2
        if self._last:
            reached = self._arrived[ships]
            return reached | waited | (not self._helm.ship.keeps_station), reached
        if self._stops:  # she begins while she may: at rest she cannot turn to the heading, nor come nearer
            stopped = at_rest(self._helm, states) & (self._ahead_m(ships, states) <= 0.0)
            return (used <= 1.0) | (stopped & (self._at[ships] >= self._end[ships])), used <= 1.0
        if not self._moves:
            return (used <= STANDSTILL_SHARE) | ((used <= 1.0) & waited), used <= 1.0
        gone_by = (self._at[ships] >= self._most[ships]) | (shares[:, 0] > 1.0)
        return (used <= 1.0) | gone_by, used <= 1.0

    def _reach(self, ships: np.ndarray, states: Array) -> None:
        """Note which of ships (k,) at states (k, 6) have reached the goal: their place alone counts, at any time.

        One that returns need not go on. One that follows the leg does, to its end: a ship without thrusters to the side
        passes the goal while she slows down. Where the leg leads past the goal before, it does not count.
        """
        near = lengths(states[:, :2] - self._desired[:2]) <= self._arrived_m
        left_m = self._way_m[self._end[ships].astype(int)] - self._way_m[self._at[ships].astype(int)]
        back = self.doing[ships] == RETURNING
        self._arrived[ships] |= near & (back | (left_m <= LAST_WAY * self._arrived_m))
        self.doing[ships[near & back]] = BEGUN

    def _run_up(self, ships: np.ndarray) -> None:
        self.doing[ships], self._shift[ships] = TRACKING, 0.0
        self._at[ships], self._end[ships] = self._begins[ships], self._arrival
        self._most[ships] = len(self._reference.states) - 1
        self._deadline[ships] = self._sample + self._allowed(self._arrival - self._begins[ships])

    def _parallel(self, states: Array) -> Array:
        """(n, 2) by how much the leg is moved towards ships (n, 6) that would not return to it within its time.

        The run may begin beside its planned place. A leg that would leave safe water stays where it is planned.
        """
        off, result = states[:, :2] - self._reference.states[0, :2], np.zeros((len(states), 2))
        off_m = lengths(off)
        most_m = PARALLEL_SHARE * self._within.position_m
        if not self._moves:
            most_m *= STANDSTILL_SHARE
        ships = np.flatnonzero((self.doing == TRACKING) & (off_m > self._caught_up_m))
        needed_m = np.minimum(off_m[ships] - self._caught_up_m, most_m)
        shift = off[ships] * (needed_m / off_m[ships])[:, None]
        points = (self._leg + shift[:, None]).reshape(-1, 2)
        clear = self._tree.hold(points, np.repeat(np.arange(len(ships)), len(self._leg)))
        result[ships[clear]] = shift[clear]
        return result

    @cached_property
    def _leg(self) -> Array:
        """(k, 2) places of the planned leg, thinned."""
        return self._reference.states[self._thinned, :2]

    @cached_property
    def _thinned(self) -> np.ndarray:
        return np.unique([*range(0, self._first, REJOIN_SAMPLES), self._first - 1])

    def _rejoin(self, ships: np.ndarray, states: Array) -> None:
        """Ships too far off to return within the leg's time, or without a clear return to it, go around at once."""
        first, helm = self._reference.states[0, :2] + self._shift, self._helm
        off_m = np.hypot(*(states[:, :2] - first).T)
        good_m = self._within.position_m + self._caught_up_m
        off = (self.doing == TRACKING) & (off_m > self._within.position_m)
        if self._last and helm.ship.keeps_station:
            self._straight_to_goal(np.flatnonzero(off & (off_m > good_m)), states)
            off &= self.doing == TRACKING
        some = np.flatnonzero(off)
        if len(some):
            clear = self._tree.hold(*self._returns_to_leg(some, states[some, :2]))
            late = clear & (off_m[some] > good_m) & (not self._last)
            self._go_around(some[~clear], states[some[~clear]])
            self._go_around(some[late], states[some[late]], otherwise=TRACKING)

    def _straight_to_goal(self, ships: np.ndarray, states: Array) -> None:
        """Ships (k,) with a straight way to the goal in safe water take it: its place alone counts, not the heading.

        `states` (n, 6) are those of all ships.
        """
        for ship, path in zip(ships.tolist(), self._tree.find(states[ships, :2]), strict=True):
            if path is not None and len(path) == STRAIGHT:
                self.doing[ship] = RETURNING
                self._followers.start(ship, path)
        self._await(ships[self.doing[ships] == RETURNING])

    def _await(self, ships: np.ndarray) -> None:
        """Ships (k,) that have begun a path have until this sample to arrive."""
        sample_m = self._helm.ship.transit_speed_mps * self._helm.vessel.sample_time_s
        self._deadline[ships] = self._sample + self._allowed(self._followers.length_m[ships] / sample_m)

    def _returns_to_leg(self, ships: np.ndarray, places: Array) -> tuple[Array, np.ndarray]:
        """Approximate tracks of ships (k,) from places (k, 2) back to their legs, while the reference stays abeam.

        Returns:
            (j, 2) points of all tracks, one track after the other, and (j,) the ship of each.
        """
        track, helm, thinned = self._leg + self._shift[ships, None], self._helm, self._thinned
        off = places - track[:, 0]
        return_s = lengths(off) / (CATCH_UP * helm.ship.transit_speed_mps)
        left = np.maximum(0.0, 1.0 - thinned * helm.vessel.sample_time_s / return_s[:, None])  # (k, samples)
        points = track + left[..., None] * off[:, None]
        which, samples = np.nonzero(np.arange(len(thinned)) <= (left > 0.0).sum(axis=1)[:, None])
        return points[which, samples], which

    def _go_around(self, ships: np.ndarray, states: Array, *, otherwise: int = ABORTED) -> None:
        """Start ships (k,) on return paths to the run-up; what those without a path, or go-arounds left, do otherwise.

        A ship that is only too far off may still come near enough by the leg, or find a path at its end.
        """
        self.doing[ships] = otherwise
        again = self.go_arounds[ships] < GO_AROUNDS
        ships, states = ships[again], states[again]
        if not len(ships):
            return
        sideways = self._helm.ship.keeps_station
        if sideways:
            paths = self._tree.find(states[:, :2])
        else:
            paths = [self._round(ship, pose) for ship, pose in zip(ships.tolist(), states[:, :3], strict=True)]
        for ship, path in zip(ships.tolist(), paths, strict=True):
            if path is None:
                self._abort_cause[ship] = ABORT_CAUSES.index("no go-around path")
            else:
                self.doing[ship] = RETURNING
                self.go_arounds[ship] += 1
                self._followers.start(ship, path)
        self._await(ships[self.doing[ships] == RETURNING])

    def _round(self, ship: int, pose: Array) -> Array | None:
        """A path of arcs (k, 2) from a ship's pose (3,) to a run-up, off the shore where there is room; None for none.

        To a longer run-up than the last one, on which she did not settle, or else to the longest that has a way to it.
        """
        for share, begin in self._run_ups.items():
            for arcs in self._arcs(begin) if share <= 1.0 + self.go_arounds[ship] else ():
                path = arcs.find(pose)
                if path is not None:
                    self._begins[ship], self._followers.goals[ship] = begin, self._reference.states[begin]
                    return path
        return None

    def _arcs(self, begin: int) -> tuple[GoAroundPaths, ...]:
        """Paths to the run-up that begins in this row of the reference."""
        if begin not in self._arcs_to:
            ship, length_m = self._helm.ship, self._helm.vessel.length_m
            goal, water = self._reference.states[begin, :3], self._water.narrowest_graph.water
            self._arcs_to[begin] = build_go_arounds(water, goal, radius_m=ship.turning_radius_m, spacing_m=length_m)
        return self._arcs_to[begin]

    @cached_property
    def _tree(self) -> ReturnPaths:
        return build_return_paths(self._water.narrowest_graph, self._reference.states[self._usual, :2])

    def _near(self, ships: np.ndarray, given: Array) -> Array:
        """(k, m) commands to whose angles azimuths keep: those of the run for ships on their last stretch to it."""
        if not self._moves:
            return given
        ready = self._inputs + whole_turns(given - self._inputs) * self._free
        left = np.where(self.doing[ships] == TRACKING, self._end[ships] - self._at[ships], np.inf)
        return np.where(left[:, None] <= self._ready, ready, given)

    @cached_property
    def _ready(self) -> Array:
        """(m,) samples before the start from which on azimuths keep near their angles at it.

        Those of half a turn, and those of a run-up too, unless the run begins with thrust to the side: near such an
        angle they would push ahead one sample and astern the next.
        """
        vessel = self._helm.vessel
        slowest = float(vessel.rates[vessel.turns_freely].min(initial=np.inf))
        half_turn = np.pi / slowest / vessel.sample_time_s
        sideways = np.abs(np.cos(self._inputs)) < SIDEWAYS_SHARE
        return half_turn + np.where(sideways, 0.0, self._arrival - self._usual)

    def _next(self, ships: np.ndarray, states: Array) -> Array:
        """(k, 6) desired states of ships (k,) over the next sample; references advance."""
        on = self.doing[ships] == TRACKING
        if on.all():
            return self._tracked(ships, states)
        back = ~on
        desired = np.empty((6, len(ships))).T
        desired[on] = self._tracked(ships[on], states[on])
        desired[back] = self._followers.desired(ships[back], states[back])
        return desired

    def _tracked(self, ships: np.ndarray, states: Array) -> Array:
        """(k, 6) states that ships on the reference desire; it advances."""
        most, shift = self._most[ships], self._shift[ships]
        beside = np.column_stack([states[:, :2] - shift, states[:, 2:]])
        pace = self._reference.abreast(self._at[ships], beside, step_m=self._least_step_m)
        self._at[ships] = at = np.minimum(self._at[ships] + pace, most)
        soon = np.minimum(at + self._helm.answer_s / self._helm.vessel.sample_time_s, most)
        now = self._reference.at(at)
        now[:, :2] += shift
        now[:, 3:] = self._reference.velocity_at(soon)  # velocities respond with a lag: they are demanded ahead of time
        if self._stops:
            some = self._stopping(ships)
            course = now[:, 2]
            ahead = np.stack([np.cos(course), np.sin(course)], axis=1) * self._ahead_m(ships, states)[:, None]
            now[:, :2] = np.where(some[:, None], states[:, :2] + ahead, now[:, :2])
        elif self._steadies:
            now[:, :2] = np.where(self._steadying(ships)[:, None], states[:, :2], now[:, :2])
        return now

    @property
    def _steadies(self) -> bool:
        """Whether ships keep their heading near the start and drift with an unknown current there."""
        return self._moves and not self._last and not self._helm.ship.keeps_station

    @property
    def _stops(self) -> bool:
        """Whether ships stop straight ahead to begin at rest.

        A ship that cannot turn on the spot would circle round a place that she has missed by a little.
        """
        return not self._moves and not self._last and not self._helm.ship.hovers

    def _steadying(self, ships: np.ndarray) -> np.ndarray:
        """(k,) whether ships (k,) are so near a start under way that they keep the planned heading."""
        helm = self._helm
        sample_m = float(np.hypot(*self._desired[3:5])) * helm.vessel.sample_time_s
        least_m, most_m = STEADY_HULLS * helm.vessel.length_m, STEADY_ROOM * self._within.position_m
        near = np.clip(most_m, least_m, self._water.start_tolerance * least_m) / sample_m
        return np.asarray(self._end[ships] - self._at[ships] <= near)

    def _stopping(self, ships: np.ndarray) -> np.ndarray:
        """(k,) whether ships (k,) are about to stop at the start, by their reference."""
        left_m = lengths(self._reference.at(self._at[ships])[:, :2] - self._desired[:2])
        return np.asarray(left_m <= STEADY_HULLS * self._helm.vessel.length_m)

    def _ahead_m(self, ships: np.ndarray, states: Array) -> Array:
        """(k,) how far the reference is ahead of ships (k,) at states (k, 6) that are not yet within its tolerance [m].

        Along the heading; nothing where it is astern.
        """
        reference = self._reference.at(self._at[ships])
        off = reference[:, :2] - states[:, :2]
        ahead = off[:, 0] * np.cos(reference[:, 2]) + off[:, 1] * np.sin(reference[:, 2])
        return np.asarray(np.where(lengths(off) <= self._within.position_m, 0.0, np.maximum(ahead, 0.0)))

    @property
    def _least_step_m(self) -> float:
        return LEAST_STEP * self._helm.ship.transit_speed_mps * self._helm.vessel.sample_time_s

    @property
    def _waiting(self) -> float:
        """Samples that a ship may take beyond what is planned."""
        time_constants = WAITING_TIME_CONSTANTS * TRACK_LEAD
        return time_constants * self._helm.answer_s / self._helm.vessel.sample_time_s

    def _allowed(self, samples: Array | float) -> Array | float:
        return PATIENCE * samples + self._waiting
