"""The helmsman: keeps one ship, or many drawn ones at once, on a reference that waits for a ship that lags.

The reference gives a pose and a velocity for every sample. Where the ship is off it, a velocity towards it is desired.
The ship's controller turns that into actuator values, which become commands within limits and rates. The helmsman knows
the forecast's mean current and the true state, and may estimate the acceleration that the nominal model does not
explain: weather, and parameters that are not the nominal ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from expdesign.plan.control.controllers import Controller, Demand
from expdesign.plan.control.ships import LEAD_SHARE, TRACK_LEAD, Capability
from expdesign.simulation import Environment
from expdesign.values import Array, sealed
from expdesign.vessel import Allocator, Vessel, VesselModel

CATCH_UP = 0.3  # largest speed towards the reference, in transit speeds

PACE_LEAST, PACE_MOST = 0.2, 3.0  # of a reference that stays abeam of a ship, in samples
LEARNING = 3.0  # time constant in which an unexplained acceleration is estimated, in those of the velocities


@sealed(states="k 6")
class Reference:
    """What is to be followed."""

    states: Array  # (k + 1, 6) pose and velocity over ground at every sample

    def at(self, sample: Array) -> Array:
        """(n, 6) reference at fractional samples (n,)."""
        return self._between(self._rows, sample)

    def velocity_at(self, sample: Array) -> Array:
        """(n, 3) velocity over ground at fractional samples (n,)."""
        return self._between(self._rows[3:], sample)

    @cached_property
    def _rows(self) -> Array:
        """(6, k + 1) states."""
        return np.ascontiguousarray(self.states.T)

    def _between(self, rows: Array, sample: Array) -> Array:
        """(n, ...) values of rows (..., k + 1) at fractional samples (n,)."""
        first = np.minimum(np.maximum(np.floor(sample), 0.0), len(self.states) - 2.0)
        share, index = np.minimum(np.maximum(sample - first, 0.0), 1.0), first.astype(int)
        before, after = rows.take(index, axis=1), rows.take(index + 1, axis=1)
        before *= 1.0 - share
        after *= share
        before += after
        return before.T

    @cached_property
    def _steps_m(self) -> Array:
        """(k,) distances from sample to sample."""
        return lengths(np.diff(self.states[:, :2], axis=0))

    def pace(self, sample: Array, states: Array, reach_m: float) -> Array:
        """(n,) samples to move on by: one, less where a ship (n, 6) has fallen behind by some of `reach_m`."""
        return np.asarray(np.clip(1.5 - self._behind_m(sample, states) / reach_m, 0.0, 1.0))

    def abreast(self, sample: Array, states: Array, *, step_m: float) -> Array:
        """(n,) samples to move on by so that the reference stays abeam of each ship (n, 6), and does not stand still.

        Args:
            sample: (n,) where references are.
            states: where ships are.
            step_m: least distance that counts as one sample's, for references that hardly move.
        """
        step = np.maximum(self._steps_m.take(sample.astype(int), mode="clip"), step_m)
        pace = -self._behind_m(sample, states) / step
        return np.asarray(np.minimum(np.maximum(pace, PACE_LEAST), PACE_MOST))

    def _behind_m(self, sample: Array, states: Array) -> Array:
        """(n,) how far ships (n, 6) are behind the reference at samples (n,), along its course [m]."""
        desired = self.at(sample)
        along, off = over_ground(desired), desired[:, :2] - states[:, :2]
        return np.asarray((off[:, 0] * along[:, 0] + off[:, 1] * along[:, 1]) / (lengths(along) + 1e-9))


def over_ground(states: Array) -> Array:
    """(n, 2) velocities to north and east of states (n, 6)."""
    c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
    return np.array([states[:, 3] * c - states[:, 4] * s, states[:, 3] * s + states[:, 4] * c]).T


def lengths(vectors: Array) -> Array:
    """(n,) lengths of vectors (n, 2)."""
    north, east = vectors.T
    return np.asarray(np.sqrt(north * north + east * east))


@dataclass(frozen=True, kw_only=True, eq=False)
class Helmsman:
    """Deviations become commands."""

    vessel: Vessel  # with the nominal model
    environment: Environment  # the forecast
    ship: Capability  # speeds

    @cached_property
    def controller(self) -> Controller:
        """The controller for the ship's kind."""
        return self.ship.controller(self.vessel)

    @property
    def answer_s(self) -> float:
        """Time constant of velocities [s]."""
        return self.controller.answer_s

    def commands(
        self,
        desired: Array,
        states: Array,
        before: Array,
        *,
        unexplained: Array | None = None,
        near: Array | None = None,
        delivered: Array | None = None,
    ) -> Array:
        """(n, m) commands that bring states (n, 6) towards desired ones (n, 6).

        Args:
            desired, states: pose and velocity over ground.
            before: (n, m) commands standing, from which rates count.
            unexplained: (n, 3) estimated acceleration that the model does not explain; None for none.
            near: (n, m) commands to whose angles azimuths keep; None for those standing.
            delivered: (n, m) what the actuators deliver; None where they deliver what is commanded.
        """
        demand = Demand(
            reference=desired,
            reference_through=self._in_body(desired),
            through=self._velocity_through_water(desired, states),
            states=states,
            moving=self._in_body(states),
            unexplained=np.zeros((len(states), 3)) if unexplained is None else unexplained,
            near=before if near is None else near,
            standing=before,
        )
        return self._commanded(self.controller.commands(demand), before, delivered)

    def _commanded(self, rows: Array, before: Array, delivered: Array | None) -> Array:
        """(n, m) commands within limits and rates for desired values (n, m); lagging actuators are commanded more."""
        if delivered is not None and self._lags:
            delay_s, lag_s, offset, gain = self._lead
            stay = np.exp(-delay_s / np.maximum(lag_s, 1e-9))
            due = before + (delivered - offset - before) * stay  # when what is commanded now begins to count
            rows = np.where(lag_s > 0, due + gain * (rows - due), rows)
        return self._allocator.within_limits(rows, before=before)

    @cached_property
    def _allocator(self) -> Allocator:
        return Allocator(self.vessel.model, sample_time_s=self.vessel.sample_time_s)

    @cached_property
    def _lags(self) -> bool:
        return any(response.lag_s > 0 for response in self.vessel.responses)

    @cached_property
    def _lead(self) -> tuple[Array, Array, Array, Array]:
        """(m,) delays, lags, offsets, and gains that reach the desired value in a share of the lag."""
        given = self.vessel.responses
        delay_s, lag_s, offset = (
            np.array([getattr(x, name) for x in given]) for name in ("delay_s", "lag_s", "offset")
        )
        soon = np.maximum(LEAD_SHARE, self.vessel.sample_time_s / np.maximum(lag_s, 1e-9))
        return delay_s, lag_s, offset, 1.0 / -np.expm1(-soon)

    def unexplained(self, estimate: Array, before: Array, states: Array, delivered: Array) -> Array:
        """(n, 3) acceleration beyond what the nominal model predicts from the actuators, low-pass filtered.

        Args:
            estimate: (n, 3) so far.
            before, states: (n, 6) one sample ago and now.
            delivered: (n, m) of the actuators in between.
        """
        old, new = self._in_body(before), self._in_body(states)
        moving = tuple(((old + new) / 2).T)
        predicted = self._model.accelerations(moving, moving[:2], tuple(delivered.T))
        known = np.empty((3, len(estimate))).T
        for column, part in enumerate(predicted):
            known[:, column] = part
        share = min(1.0, self.vessel.sample_time_s / (LEARNING * self.answer_s))
        return np.asarray(estimate + share * ((new - old) / self.vessel.sample_time_s - known - estimate))

    @cached_property
    def _model(self) -> VesselModel:
        """The nominal model without the terms that do nothing."""
        model, acting = self.vessel.model, self.vessel.model.parameters != 0.0
        return replace(
            model,
            terms=tuple(term for term, acts in zip(model.terms, acting, strict=True) if acts),
            parameters=model.parameters[acting],
            parameter_std=model.parameter_std[acting],
        )

    def _velocity_through_water(self, desired: Array, states: Array) -> Array:
        """(n, 2) desired velocity through water to north and east: the reference's, and some towards it."""
        back = (desired[:, :2] - states[:, :2]) / (TRACK_LEAD * self.answer_s)
        most = CATCH_UP * self.ship.transit_speed_mps
        back *= np.minimum(1.0, most / np.maximum(lengths(back), 1e-12))[:, None]
        steady = over_ground(desired)
        if self._current:
            steady -= self.environment.current_to
        fastest, speed = self.ship.transit_speed_mps, lengths(steady)
        limit = np.where(speed > 1.001 * fastest, 1.02 * speed, fastest)
        through = steady + back
        return np.asarray(through * np.minimum(1.0, limit / np.maximum(lengths(through), 1e-12))[:, None])

    def _in_body(self, states: Array) -> Array:
        """(n, 3) velocities through water from those over ground."""
        if not self._current:
            return states[:, 3:]
        north, east = self.environment.current_to
        c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
        return np.asarray(states[:, 3:] - np.array([north * c + east * s, east * c - north * s, 0.0 * c]).T)

    @cached_property
    def _current(self) -> bool:
        """Whether the forecast has a mean current."""
        return bool(self.environment.current_to.any())
