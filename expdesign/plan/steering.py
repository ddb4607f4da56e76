"""The helmsman of legs: keeps one ship, or many drawn ones at once, on a reference that waits for a ship that lags.

The reference gives a pose and a velocity for every sample. Where the ship is off it, a velocity towards it is wished
for; the acceleration that leads to the wished velocity within a few seconds is turned into forces by the nominal model,
and these into commands within limits and rates. The helmsman knows the forecast's mean current and the true state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.capability import Capability
from expdesign.simulation import Environment
from expdesign.values import Array, seal
from expdesign.vessel import Vessel, allocate, required_force

CATCH_UP = 0.3
"""Largest speed towards the reference, in transit speeds."""
LEAD = 4.0
"""Time constant of the way back to the reference, in those of the velocities."""


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
        wanted = self.at(sample)
        c, s = np.cos(wanted[:, 2]), np.sin(wanted[:, 2])
        along = (wanted[:, 3] * c - wanted[:, 4] * s, wanted[:, 3] * s + wanted[:, 4] * c)
        speed = np.hypot(*along) + 1e-9
        behind = ((wanted[:, 0] - states[:, 0]) * along[0] + (wanted[:, 1] - states[:, 1]) * along[1]) / speed
        return np.asarray(np.clip(1.5 - behind / reach_m, 0.0, 1.0))


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
        """Time constant wished for velocities [s]."""
        return max(self.ship.settle_s, 3.0 * self.vessel.sample_time_s)

    def commands(self, wanted: Array, states: Array, before: Array) -> Array:
        """(n, m) commands that bring states (n, 6) towards wanted ones (n, 6), rates counted from `before` (n, m)."""
        error = wanted[:, :2] - states[:, :2]
        c, s = np.cos(wanted[:, 2]), np.sin(wanted[:, 2])
        ground = np.stack([wanted[:, 3] * c - wanted[:, 4] * s, wanted[:, 3] * s + wanted[:, 4] * c], axis=1)
        back = error / (LEAD * self.answer_s)
        most = CATCH_UP * self.ship.transit_speed_mps
        back *= np.minimum(1.0, most / np.maximum(np.hypot(*back.T), 1e-12))[:, None]
        through = ground + back - self.environment.current_to
        through *= np.minimum(1.0, self.ship.transit_speed_mps / np.maximum(np.hypot(*through.T), 1e-12))[:, None]
        moving = self._in_body(np.column_stack([states[:, 3:5], states[:, 5]]), states[:, 2])
        turn = wrap_angle(wanted[:, 2] - states[:, 2]) / (2.0 * self.answer_s)
        fastest = max(self.ship.spot_rate_radps, self.ship.yaw_rate_radps)
        c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
        wish = np.column_stack(
            [
                through[:, 0] * c + through[:, 1] * s,
                through[:, 1] * c - through[:, 0] * s,
                np.clip(wanted[:, 5] + turn, -fastest, fastest),
            ]
        )
        force = required_force(self.vessel.model, moving, (wish - moving) / self.answer_s)
        actuators, sample_s = self.vessel.actuators, self.vessel.sample_time_s
        return np.asarray(allocate(actuators, force[:, None], sample_time_s=sample_s, before=before)[:, 0])

    def _in_body(self, velocity: Array, heading: Array) -> Array:
        """(n, 3) velocities through water from those over ground."""
        north, east = self.environment.current_to
        c, s = np.cos(heading), np.sin(heading)
        return np.asarray(velocity - np.column_stack([north * c + east * s, east * c - north * s, 0.0 * c]))
