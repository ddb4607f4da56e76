"""What every controller is asked and answers, and the controller of ships that forces in every direction steer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.control.helm_capability import SteadyTurn
from expdesign.simulation import Approach
from expdesign.values import Array
from expdesign.vessel import Allocator, Vessel, required_push

# natural frequency of courses in that of a hull length at transit speed, and their damping
COURSE_FREQUENCY, COURSE_DAMPING = 1.2, 0.9
COARSE = 1e-2  # acceleration that commands may miss, in those of full thrust: the next sample makes it good
HELM_SLOWEST = 0.3  # speed, in transit speeds, below which the helm is not taken to have less effect
HELM_TILT_RAD = 0.1  # to both sides, by which the effect of thrust that is turned is measured
HELM_FARTHEST_RAD = 1.0  # change of course that the helm answers to at most


@dataclass(frozen=True, kw_only=True, eq=False)
class Demand:
    """What a controller is asked for n ships at once."""

    reference: Array  # (n, 6) desired pose and velocity over ground
    reference_through: Array  # (n, 3) its velocity through water in its own b-frame
    through: Array  # (n, 2) desired velocity through water to north and east, corrected towards the reference
    states: Array  # (n, 6) pose and velocity over ground
    moving: Array  # (n, 3) velocity through water in the b-frame
    unexplained: Array  # (n, 3) acceleration that the nominal model does not explain
    near: Array  # (n, m) commands to whose angles azimuths keep
    standing: Array  # (n, m) commands that stand


class Controller(Protocol):
    """Desired motion to actuators."""

    @property
    def answer_s(self) -> float:
        """Time constant of velocities [s]."""

    def commands(self, demand: Demand) -> Array:
        """(n, m) desired actuator values, whatever stands before them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceController:
    """Desired accelerations become forces by the inverse of the nominal model, and forces become commands."""

    vessel: Vessel  # with the nominal model
    answer_s: float  # time constant of velocities [s]
    turn_rate_radps: float  # largest yaw rate

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
        push = required_push(self.vessel.model, demand.moving, acceleration, near=demand.near, tolerance=COARSE)
        return self._allocator.commands(push, near=demand.near)

    @cached_property
    def _allocator(self) -> Allocator:
        return Allocator(self.vessel.model, sample_time_s=self.vessel.sample_time_s)


# The controller of helm-steered ships: helm and engine orders, for many ships at once.

ORDERS = np.linspace(-1.0, 1.0, 9)
"""Engine orders compared."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HelmController:
    """Helm and engine orders for desired courses and speeds."""

    vessel: Vessel  # with the nominal model
    approach: Approach  # straight ahead at transit speed
    turns: tuple[SteadyTurn, ...]  # steady turns from there
    transit_speed_mps: float  # of legs

    @property
    def answer_s(self) -> float:
        """Time of a hull length at transit speed, at least three samples [s]."""
        return max(self._pace_s, 3.0 * self.vessel.sample_time_s)

    def commands(self, demand: Demand) -> Array:
        """(n, m) desired actuator values."""
        speed, course = self._pointed(demand)
        desired = np.column_stack([speed, course - demand.states[:, 2], demand.reference[:, 5]])
        angle = self._helm(desired, demand.moving, demand.unexplained, demand.standing)
        drive = self._drive(desired[:, 0], demand.moving, angle, demand.unexplained[:, 0])
        return np.asarray(self.approach.helm.rows(drive, angle))

    def _pointed(self, demand: Demand) -> tuple[Array, Array]:
        """(n,) surge speeds and headings of ships that go where they point.

        Ships that hardly move keep the reference's heading. So do those that are to go astern, as after a crash stop:
        their helm does not lead them anywhere.
        """
        desired, through = demand.reference, demand.through
        speed = np.hypot(*through.T)
        moves = speed > 0.05 * self.transit_speed_mps
        ahead = np.cos(desired[:, 2]) * through[:, 0] + np.sin(desired[:, 2]) * through[:, 1]
        astern = moves & (demand.reference_through[:, 0] < 0.0)
        pointing = np.where(moves & ~astern, np.arctan2(through[:, 1], through[:, 0]), desired[:, 2])
        return np.where(astern, np.minimum(ahead, 0.0), speed), pointing

    @property
    def _pace_s(self) -> float:
        """Time of a hull length at transit speed [s]."""
        return self.vessel.length_m / self.transit_speed_mps

    def _helm(self, desired: Array, moving: Array, unexplained: Array, standing: Array) -> Array:
        """(n,) helm angles: those of steady turns, and more or less by what is missing in heading and yaw rate."""
        approach = self.approach
        quick = COURSE_FREQUENCY / self._pace_s
        turn = np.clip(wrap_angle(desired[:, 1]), -HELM_FARTHEST_RAD, HELM_FARTHEST_RAD)
        damping = 2 * COURSE_DAMPING * quick - self._own_damping
        missing = quick**2 * turn + damping * (desired[:, 2] - moving[:, 2]) - unexplained[:, 2]
        effect = self._helm_effect * np.maximum(moving[:, 0] / self.transit_speed_mps, HELM_SLOWEST) ** 2
        change = np.interp(desired[:, 2], *self._turns) + missing / effect
        if self.approach.helm.turns_thrust:
            change *= effect / self._effects_of_thrust(moving, standing)
        return np.asarray(approach.angle_rad + approach.starboard * np.clip(change, -self._hardest, self._hardest))

    def _drive(self, speed: Array, moving: Array, angle: Array, unexplained: Array) -> Array:
        """(n,) engine orders by which the nominal model comes to the desired speed in the time of a hull length."""
        given = self.approach.helm.rows(ORDERS[:, None], angle)  # (o, n, m)
        motion = tuple(moving.T)
        predicted = self.vessel.model.accelerations(motion, motion[:2], tuple(np.moveaxis(given, -1, 0)))[0]
        gains = np.maximum.accumulate(np.broadcast_to(predicted, given.shape[:2]), axis=0)
        desired = (speed - moving[:, 0]) / self._pace_s - unexplained
        above = np.clip((gains < desired).sum(axis=0), 1, len(ORDERS) - 1)
        ships = np.arange(len(angle))
        low, high = gains[above - 1, ships], gains[above, ships]
        share = np.clip((desired - low) / np.maximum(high - low, 1e-12), 0.0, 1.0)
        return np.asarray(ORDERS[above - 1] + share * (ORDERS[above] - ORDERS[above - 1]))

    @cached_property
    def _hardest(self) -> float:
        approach = self.approach
        return float(approach.helm.hardest(approach.drive) - abs(approach.angle_rad))

    @cached_property
    def _helm_effect(self) -> float:
        """Yaw acceleration per helm angle on the straight approach [1/s2]."""
        approach, tilt = self.approach, 1e-3
        motion = tuple(approach.velocity.tolist())
        sides = [
            approach.helm.acceleration(motion, approach.drive, approach.angle_rad + side * approach.starboard * tilt)[2]
            for side in (1, -1)
        ]
        return max(float(sides[0] - sides[1]) / (2 * tilt), 1e-12)

    def _effects_of_thrust(self, moving: Array, standing: Array) -> Array:
        """(n,) yaw acceleration per helm angle of thrust that is turned: none at idle, the other way round astern."""
        helm, tilt = self.approach.helm, HELM_TILT_RAD
        order, motion = helm.drives(standing), tuple(moving.T)
        sides = [
            self.vessel.model.accelerations(
                motion, motion[:2], tuple(np.moveaxis(helm.rows(order, self.approach.angle_rad + angle), -1, 0))
            )[2]
            for angle in self.approach.starboard * np.array([[tilt], [-tilt]])
        ]
        found = (sides[0] - sides[1]) / (2 * tilt)
        least = HELM_SLOWEST**2 * self._helm_effect
        return np.asarray(np.where(found < 0.0, np.minimum(found, -least), np.maximum(found, least)))

    @cached_property
    def _own_damping(self) -> float:
        """What the ship herself damps yaw rates by, sway following [1/s]; negative for course-unstable ones."""
        rates, angles = self._turns
        nearest = int(np.abs(rates[rates != 0.0]).argmin())
        return float(self._helm_effect * angles[rates != 0.0][nearest] / rates[rates != 0.0][nearest])

    @cached_property
    def _turns(self) -> tuple[Array, Array]:
        """Yaw rates of steady turns, and changes of helm that hold them."""
        rows = sorted([(turn.yaw_rate_radps, turn.helm_rad) for turn in self.turns] + [(0.0, 0.0)])
        rates, angles = np.array(rows).T
        return rates, angles
