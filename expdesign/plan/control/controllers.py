"""What every controller is asked and answers, and the controller of ships that forces in every direction steer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.values import Array
from expdesign.vessel import Allocator, Vessel, required_force


@dataclass(frozen=True, kw_only=True, eq=False)
class Demand:
    """What a controller is asked for n ships at once.

    Attributes:
        reference: (n, 6) desired pose and velocity over ground.
        reference_through: (n, 3) its velocity through water in its own b-frame.
        through: (n, 2) desired velocity through water to north and east, corrected towards the reference.
        states: (n, 6) pose and velocity over ground.
        moving: (n, 3) velocity through water in the b-frame.
        unexplained: (n, 3) acceleration that the nominal model does not explain.
        near: (n, m) commands to whose angles azimuths keep.
    """

    reference: Array
    reference_through: Array
    through: Array
    states: Array
    moving: Array
    unexplained: Array
    near: Array


class Controller(Protocol):
    """Desired motion to actuators."""

    @property
    def answer_s(self) -> float:
        """Time constant of velocities [s]."""

    def commands(self, demand: Demand) -> Array:
        """(n, m) desired actuator values, whatever stands before them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceController:
    """Desired accelerations become forces by the inverse of the nominal model, and forces become commands.

    Attributes:
        vessel: with the nominal model.
        answer_s: time constant of velocities [s].
        turn_rate_radps: largest yaw rate.
    """

    vessel: Vessel
    answer_s: float
    turn_rate_radps: float

    def commands(self, demand: Demand) -> Array:
        """(n, m) desired actuator values."""
        through, states, reference = demand.through, demand.states, demand.reference
        c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
        turn = wrap_angle(reference[:, 2] - states[:, 2]) / (2.0 * self.answer_s)
        fastest = self.turn_rate_radps
        desired = np.array(
            [
                through[:, 0] * c + through[:, 1] * s,
                through[:, 1] * c - through[:, 0] * s,
                np.minimum(np.maximum(reference[:, 5] + turn, -fastest), fastest),
            ]
        ).T
        acceleration = (desired - demand.moving) / self.answer_s - demand.unexplained
        force = required_force(self.vessel.model, demand.moving, acceleration)
        return self._allocator.commands(force, near=demand.near)

    @cached_property
    def _allocator(self) -> Allocator:
        return Allocator(self.vessel.actuators, sample_time_s=self.vessel.sample_time_s)
