"""The helmsman: keeps one ship, or many drawn ones at once, on a reference that waits for a ship that lags.

The reference gives a pose and a velocity for every sample. Where the ship is off it, a velocity towards it is desired.
The ship's controller turns that into actuator values, which become commands within limits and rates. The helmsman knows
the forecast's mean current and the true state, and may estimate the acceleration that the nominal model does not
explain: weather, and parameters that are not the nominal ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expdesign.plan.control.controllers import Controller, Demand
from expdesign.plan.control.ships import Capability
from expdesign.plan.control.tuning import CONTROL
from expdesign.simulation import Environment
from expdesign.values import Array, seal
from expdesign.vessel import Vessel, within_limits


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """What is to be followed.

    Attributes:
        states: (k + 1, 6) pose and velocity over ground at every sample.
    """

    states: Array

    def __post_init__(self) -> None:
        seal(self, states="k 6")

    def at(self, sample: Array) -> Array:
        """(n, 6) at fractional samples (n,)."""
        first = np.clip(np.floor(sample).astype(int), 0, len(self.states) - 2)
        share = np.clip(sample - first, 0.0, 1.0)[:, None]
        return np.asarray(self.states[first] * (1 - share) + self.states[first + 1] * share)

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
        row = np.clip(sample.astype(int), 0, len(self.states) - 2)
        step = np.maximum(np.hypot(*(self.states[row + 1, :2] - self.states[row, :2]).T), step_m)
        return np.asarray(np.clip(-self._behind_m(sample, states) / step, CONTROL.pace_least, CONTROL.pace_most))

    def _behind_m(self, sample: Array, states: Array) -> Array:
        """(n,) how far ships (n, 6) are behind the reference at samples (n,), along its course [m]."""
        desired = self.at(sample)
        along = over_ground(desired)
        speed = np.hypot(*along.T) + 1e-9
        return np.asarray(((desired[:, :2] - states[:, :2]) * along).sum(axis=1) / speed)


def over_ground(states: Array) -> Array:
    """(n, 2) velocities to north and east of states (n, 6)."""
    c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
    return np.stack([states[:, 3] * c - states[:, 4] * s, states[:, 3] * s + states[:, 4] * c], axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Helmsman:
    """Deviations become commands.

    Attributes:
        vessel: with the nominal model.
        environment: the forecast.
        ship: speeds.
    """

    vessel: Vessel
    environment: Environment
    ship: Capability

    @cached_property
    def controller(self) -> Controller:
        """Of the ship's kind."""
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
            unexplained=(0.0 if unexplained is None else unexplained) - self._turning_current(states),
            near=before if near is None else near,
        )
        return self._commanded(self.controller.commands(demand), before, delivered)

    def _commanded(self, rows: Array, before: Array, delivered: Array | None) -> Array:
        """(n, m) commands within limits and rates for desired values (n, m); lagging actuators are commanded more."""
        if delivered is not None:
            delay_s, lag_s, offset, gain = self._lead
            stay = np.exp(-delay_s / np.maximum(lag_s, 1e-9))
            due = before + (delivered - offset - before) * stay  # when what is commanded now begins to count
            rows = np.where(lag_s > 0, due + gain * (rows - due), rows)
        actuators, sample_s = self.vessel.actuators, self.vessel.sample_time_s
        return np.asarray(within_limits(actuators, rows[:, None], sample_time_s=sample_s, before=before)[:, 0])

    @cached_property
    def _lead(self) -> tuple[Array, Array, Array, Array]:
        """(m,) delays, lags, offsets, and gains that reach the desired value in a share of the lag."""
        given = self.vessel.responses
        delay_s, lag_s, offset = (
            np.array([getattr(x, name) for x in given]) for name in ("delay_s", "lag_s", "offset")
        )
        soon = np.maximum(CONTROL.lead_share, self.vessel.sample_time_s / np.maximum(lag_s, 1e-9))
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
        predicted = self.vessel.model.accelerations(moving, moving[:2], tuple(delivered.T))
        known = np.column_stack([np.broadcast_to(part, len(estimate)) for part in predicted])
        known -= self._turning_current((before + states) / 2)
        share = min(1.0, self.vessel.sample_time_s / (CONTROL.learning * self.answer_s))
        return np.asarray(estimate + share * ((new - old) / self.vessel.sample_time_s - known - estimate))

    def _velocity_through_water(self, desired: Array, states: Array) -> Array:
        """(n, 2) desired velocity through water to north and east: the reference's, and some towards it."""
        back = (desired[:, :2] - states[:, :2]) / (CONTROL.track_lead * self.answer_s)
        most = CONTROL.catch_up * self.ship.transit_speed_mps
        back *= np.minimum(1.0, most / np.maximum(np.hypot(*back.T), 1e-12))[:, None]
        steady = over_ground(desired) - self.environment.current_to
        fastest, speed = self.ship.transit_speed_mps, np.hypot(*steady.T)
        limit = np.where(speed > 1.001 * fastest, 1.02 * speed, fastest)
        through = steady + back
        return np.asarray(through * np.minimum(1.0, limit / np.maximum(np.hypot(*through.T), 1e-12))[:, None])

    def _turning_current(self, states: Array) -> Array:
        """(n, 3) rate at which the mean current changes in the b-frames of turning ships (n, 6) [m/s2].

        The model gives the rate of the velocity over ground: that through water has the opposite of this more.
        """
        if not self.environment.current_to.any():
            return np.zeros((len(states), 3))
        u_c, v_c, _ = (states[:, 3:] - self._in_body(states)).T
        return np.column_stack([states[:, 5] * v_c, -states[:, 5] * u_c, 0.0 * u_c])

    def _in_body(self, states: Array) -> Array:
        """(n, 3) velocities through water from those over ground."""
        north, east = self.environment.current_to
        if not (north or east):
            return states[:, 3:]
        c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
        return np.asarray(states[:, 3:] - np.column_stack([north * c + east * s, east * c - north * s, 0.0 * c]))
