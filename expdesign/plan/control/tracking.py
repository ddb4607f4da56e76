"""The helmsman: keeps one ship, or many drawn ones at once, on a reference that waits for a ship that lags.

The reference gives a pose and a velocity for every sample. Where the ship is off it, a velocity towards it is wished
for; the acceleration that leads to the wished velocity within a few seconds is turned into forces by the nominal model,
and these into commands within limits and rates. The helmsman knows the forecast's mean current and the true state, and,
where told to, the acceleration that his model does not explain: weather, and parameters that are not the nominal ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.control.capability import Capability
from expdesign.plan.control.helm_controller import HelmOrders
from expdesign.simulation import Environment
from expdesign.values import Array, seal
from expdesign.vessel import Vessel, allocate, required_force, within_limits

CATCH_UP = 0.3
"""Largest speed towards the reference, in transit speeds."""
LEAD = 4.0
"""Time constant of the way back to the reference, in those of the velocities."""
SLOWEST, FASTEST = 0.2, 3.0
"""Pace of a reference that stays abeam of a ship, in samples."""
SOONER = 0.2
"""Share of their lag in which lagging actuators are brought to what is wanted of them, by telling them more."""
LEARN = 3.0
"""Time constant in which an unexplained force is believed, in those of the velocities."""


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
        return np.asarray(np.clip(-self._behind_m(sample, states) / step, SLOWEST, FASTEST))

    def _behind_m(self, sample: Array, states: Array) -> Array:
        """(n,) how far ships (n, 6) are behind the reference at samples (n,), along its course [m]."""
        wanted = self.at(sample)
        along = over_ground(wanted)
        speed = np.hypot(*along.T) + 1e-9
        return np.asarray(((wanted[:, :2] - states[:, :2]) * along).sum(axis=1) / speed)


def over_ground(states: Array) -> Array:
    """(n, 2) velocities to north and east of states (n, 6)."""
    c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
    return np.stack([states[:, 3] * c - states[:, 4] * s, states[:, 3] * s + states[:, 4] * c], axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Helmsman:
    """How errors become commands.

    Attributes:
        vessel: with the nominal model.
        environment: the forecast.
        ship: speeds.
    """

    vessel: Vessel
    environment: Environment
    ship: Capability

    @property
    def answer_s(self) -> float:
        """Time constant wished for velocities [s]; of ships with a helm the time of a hull length at transit speed."""
        if not self.sideways:
            return max(self.vessel.length_m / self.ship.transit_speed_mps, 3.0 * self.vessel.sample_time_s)
        late_s = max(response.delay_s + SOONER * response.lag_s for response in self.vessel.responses)
        return max(self.ship.settle_s - self.ship.late_s + late_s, 3.0 * self.vessel.sample_time_s)

    @property
    def sideways(self) -> bool:
        """Whether forces in every direction steer it, so that a ship need not point where it goes."""
        return self.ship.approach is None

    def commands(
        self,
        wanted: Array,
        states: Array,
        before: Array,
        *,
        felt: Array | None = None,
        near: Array | None = None,
        delivered: Array | None = None,
    ) -> Array:
        """(n, m) commands that bring states (n, 6) towards wanted ones (n, 6).

        Args:
            wanted, states: pose and velocity over ground.
            before: (n, m) commands standing, from which rates count.
            felt: (n, 3) acceleration that the model does not explain, by `unexplained`; None for none.
            near: (n, m) commands to whose angles azimuths keep; None for those standing.
            delivered: (n, m) what the actuators give; None where they give what they are told.
        """
        through = self._velocity_through_water(wanted, states)
        moving = self._in_body(states)
        felt = (0.0 if felt is None else felt) - self._turning_current(states)
        if not self.sideways:
            speed, pointing = self._pointed(wanted, through)
            wish = np.column_stack([speed, pointing - states[:, 2], wanted[:, 5]])
            return self._told(self._orders.commands(wish, moving, felt), before, delivered)
        c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
        ahead, abeam = through[:, 0] * c + through[:, 1] * s, through[:, 1] * c - through[:, 0] * s
        turn = wrap_angle(wanted[:, 2] - states[:, 2]) / (2.0 * self.answer_s)
        fastest = max(self.ship.spot_rate_radps, self.ship.yaw_rate_radps)
        wish = np.column_stack([ahead, abeam, np.clip(wanted[:, 5] + turn, -fastest, fastest)])
        force = required_force(self.vessel.model, moving, (wish - moving) / self.answer_s - felt)
        actuators, sample_s = self.vessel.actuators, self.vessel.sample_time_s
        rows = allocate(actuators, force[:, None], sample_time_s=sample_s, near=before if near is None else near)
        return self._told(rows[:, 0], before, delivered)

    def _told(self, rows: Array, before: Array, delivered: Array | None) -> Array:
        """(n, m) commands within limits and rates for wished actuators (n, m): lagging ones are told more than that."""
        if delivered is not None:
            delay_s, lag_s, offset, gain = self._lead
            stay = np.exp(-delay_s / np.maximum(lag_s, 1e-9))
            due = before + (delivered - offset - before) * stay  # when what is told now begins to count
            rows = np.where(lag_s > 0, due + gain * (rows - due), rows)
        actuators, sample_s = self.vessel.actuators, self.vessel.sample_time_s
        return np.asarray(within_limits(actuators, rows[:, None], sample_time_s=sample_s, before=before)[:, 0])

    @cached_property
    def _lead(self) -> tuple[Array, Array, Array, Array]:
        """(m,) delays, lags, offsets, and how much more than wanted is told, to be there in a share of the lag."""
        given = self.vessel.responses
        delay_s, lag_s, offset = (
            np.array([getattr(x, name) for x in given]) for name in ("delay_s", "lag_s", "offset")
        )
        soon = np.maximum(SOONER, self.vessel.sample_time_s / np.maximum(lag_s, 1e-9))
        return delay_s, lag_s, offset, 1.0 / -np.expm1(-soon)

    def unexplained(self, felt: Array, before: Array, states: Array, delivered: Array) -> Array:
        """(n, 3) acceleration beyond what the nominal model says of the actuators, believed little by little.

        Args:
            felt: (n, 3) as believed so far.
            before, states: (n, 6) one sample ago and now.
            delivered: (n, m) of the actuators in between.
        """
        old, new = self._in_body(before), self._in_body(states)
        moving = tuple(((old + new) / 2).T)
        told = self.vessel.model.accelerations(moving, moving[:2], tuple(delivered.T))
        known = np.column_stack([np.broadcast_to(part, len(felt)) for part in told])
        known -= self._turning_current((before + states) / 2)
        share = min(1.0, self.vessel.sample_time_s / (LEARN * self.answer_s))
        return np.asarray(felt + share * ((new - old) / self.vessel.sample_time_s - known - felt))

    def _velocity_through_water(self, wanted: Array, states: Array) -> Array:
        """(n, 2) wished velocity through water to north and east: the reference's, and some towards it."""
        back = (wanted[:, :2] - states[:, :2]) / (LEAD * self.answer_s)
        most = CATCH_UP * self.ship.transit_speed_mps
        back *= np.minimum(1.0, most / np.maximum(np.hypot(*back.T), 1e-12))[:, None]
        steady = over_ground(wanted) - self.environment.current_to
        fastest, speed = self.ship.transit_speed_mps, np.hypot(*steady.T)
        limit = np.where(speed > 1.001 * fastest, 1.02 * speed, fastest)
        through = steady + back
        return np.asarray(through * np.minimum(1.0, limit / np.maximum(np.hypot(*through.T), 1e-12))[:, None])

    def _pointed(self, wanted: Array, through: Array) -> tuple[Array, Array]:
        """(n,) surge speeds and headings of ships that go where they point; those that hardly move keep the wanted one.

        So do those that are wanted to go astern, as after a crash stop: their helm does not lead them anywhere.
        """
        speed = np.hypot(*through.T)
        moves = speed > 0.05 * self.ship.transit_speed_mps
        ahead = np.cos(wanted[:, 2]) * through[:, 0] + np.sin(wanted[:, 2]) * through[:, 1]
        astern = moves & (self._in_body(wanted)[:, 0] < 0.0)
        pointing = np.where(moves & ~astern, np.arctan2(through[:, 1], through[:, 0]), wanted[:, 2])
        return np.where(astern, np.minimum(ahead, 0.0), speed), pointing

    def _turning_current(self, states: Array) -> Array:
        """(n, 3) rate at which the mean current changes in the b-frames of turning ships (n, 6) [m/s2].

        The model gives the rate of the velocity over ground: that through water has the opposite of this more.
        """
        if not self.environment.current_to.any():
            return np.zeros((len(states), 3))
        u_c, v_c, _ = (states[:, 3:] - self._in_body(states)).T
        return np.column_stack([states[:, 5] * v_c, -states[:, 5] * u_c, 0.0 * u_c])

    @cached_property
    def _orders(self) -> HelmOrders:
        return HelmOrders(vessel=self.vessel, ship=self.ship)

    def _in_body(self, states: Array) -> Array:
        """(n, 3) velocities through water from those over ground."""
        north, east = self.environment.current_to
        if not (north or east):
            return states[:, 3:]
        c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
        return np.asarray(states[:, 3:] - np.column_stack([north * c + east * s, east * c - north * s, 0.0 * c]))
