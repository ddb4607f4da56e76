"""The helmsman of ships that are steered by a helm: helm and engine orders, for many ships at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.control.capability import Capability
from expdesign.simulation import Approach
from expdesign.values import Array
from expdesign.vessel import Vessel

QUICK = 1.2
"""Natural frequency wished for in courses, in that of a hull length at transit speed."""
DAMPED = 0.9
"""Damping wished for in courses."""
SLOWEST = 0.3
"""Speed, in transit speeds, below which the helm is not taken to bite less."""
FARTHEST_RAD = 1.0
"""Change of course that the helmsman answers to at most."""
ORDERS = np.linspace(-1.0, 1.0, 9)
"""Engine orders looked at."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HelmOrders:
    """Helm and engine orders for wished courses and speeds.

    Attributes:
        vessel: with the nominal model.
        ship: its approach and steady turns.
    """

    vessel: Vessel
    ship: Capability

    def commands(self, wish: Array, moving: Array, felt: Array) -> Array:
        """(n, m) commands, whatever stands before them.

        Args:
            wish: (n, 3) surge speed through water, change of heading, yaw rate.
            moving: (n, 3) velocity through water.
            felt: (n, 3) acceleration that the model does not explain.
        """
        angle = self._helm(wish, moving, felt)
        return np.asarray(self._approach.helm.rows(self._drive(wish[:, 0], moving, angle, felt[:, 0]), angle))

    @property
    def pace_s(self) -> float:
        """Time of a hull length at transit speed [s]."""
        return self.vessel.length_m / self.ship.transit_speed_mps

    def _helm(self, wish: Array, moving: Array, felt: Array) -> Array:
        """(n,) helm angles: those of steady turns, and more or less by what is missing in heading and yaw rate."""
        approach = self._approach
        quick = QUICK / self.pace_s
        turn = np.clip(wrap_angle(wish[:, 1]), -FARTHEST_RAD, FARTHEST_RAD)
        damping = 2 * DAMPED * quick - self._own_damping
        missing = quick**2 * turn + damping * (wish[:, 2] - moving[:, 2]) - felt[:, 2]
        bite = self._bite * np.maximum(moving[:, 0] / self.ship.transit_speed_mps, SLOWEST) ** 2
        change = np.interp(wish[:, 2], *self._turns) + missing / bite
        return np.asarray(approach.angle_rad + approach.starboard * np.clip(change, -self._hardest, self._hardest))

    def _drive(self, speed: Array, moving: Array, angle: Array, felt: Array) -> Array:
        """(n,) engine orders by which the nominal model comes to the wished speed in the time of a hull length."""
        given = self._approach.helm.rows(ORDERS[:, None], angle)  # (o, n, m)
        motion = tuple(np.broadcast_to(column, given.shape[:2]) for column in moving.T)
        told = self.vessel.model.accelerations(motion, motion[:2], tuple(np.moveaxis(given, -1, 0)))[0]
        gains = np.maximum.accumulate(np.broadcast_to(told, given.shape[:2]), axis=0)
        wanted = (speed - moving[:, 0]) / self.pace_s - felt
        above = np.clip((gains < wanted).sum(axis=0), 1, len(ORDERS) - 1)
        ships = np.arange(len(angle))
        low, high = gains[above - 1, ships], gains[above, ships]
        share = np.clip((wanted - low) / np.maximum(high - low, 1e-12), 0.0, 1.0)
        return np.asarray(ORDERS[above - 1] + share * (ORDERS[above] - ORDERS[above - 1]))

    @property
    def _approach(self) -> Approach:
        assert self.ship.approach is not None
        return self.ship.approach

    @cached_property
    def _hardest(self) -> float:
        approach = self._approach
        return float(approach.helm.hardest(approach.drive) - abs(approach.angle_rad))

    @cached_property
    def _bite(self) -> float:
        """Yaw acceleration per helm angle on the straight approach [1/s2]."""
        approach, tilt = self._approach, 1e-3
        motion = tuple(approach.velocity.tolist())
        sides = [
            approach.helm.acceleration(motion, approach.drive, approach.angle_rad + side * approach.starboard * tilt)[2]
            for side in (1, -1)
        ]
        return max(float(sides[0] - sides[1]) / (2 * tilt), 1e-12)

    @cached_property
    def _own_damping(self) -> float:
        """What the ship herself damps yaw rates by, sway following [1/s]; negative for course-unstable ones."""
        rates, angles = self._turns
        nearest = int(np.abs(rates[rates != 0.0]).argmin())
        return float(self._bite * angles[rates != 0.0][nearest] / rates[rates != 0.0][nearest])

    @cached_property
    def _turns(self) -> tuple[Array, Array]:
        """Yaw rates of steady turns, and changes of helm that hold them."""
        rows = sorted([(turn.yaw_rate_radps, turn.helm_rad) for turn in self.ship.turns] + [(0.0, 0.0)])
        rates, angles = np.array(rows).T
        return rates, angles
