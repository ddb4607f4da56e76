"""What every controller is asked and answers, and the controller of ships that forces in every direction steer."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy

from expdesign.conventions import OUTPUTS, whole_turns, wrap_angle
from expdesign.plan.control.helm_capability import SteadyTurn
from expdesign.simulation import Approach
from expdesign.values import Array
from expdesign.vessel import Allocator, Vessel, required_push

COURSE_FREQUENCY = 1.2  # in that of a hull length at transit speed; a heading error and its square are worth as much
COARSE = 1e-2  # acceleration that commands may miss, in those of full thrust: the next sample makes it good
HELM_SLOWEST = 0.3  # speed, in transit speeds, below which the helm is not taken to have less effect
HELM_TILT_RAD = 0.1  # to both sides, by which the effect of thrust that is turned is measured
HELM_FARTHEST_RAD = 1.0  # change of course that the helm answers to at most
HOVER_SHARE = 0.3  # of the transit speed, up to which thrusters take over from the helm where a ship is to stop
ROUND_FROM = 0.5  # engine order from which thrusters that do not reverse are turned round
STOPPED_ASTERN = 1e-6  # engine order of stopped engines whose thrusters stand astern
KICK_RAD = 0.1  # heading error from which, or from as much yaw rate and sway, steering comes before speed


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

    def part(self, ships: np.ndarray) -> Demand:
        """The demand of some ships (k,)."""
        return Demand(**{item.name: getattr(self, item.name)[ships] for item in fields(self)})


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


ORDERS = np.linspace(-1.0, 1.0, 9)  # engine orders compared
KICKS = np.linspace(0.0, 1.0, 9)  # engine orders ahead compared where the helm needs thrust


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
        rate, moving, unexplained = demand.reference[:, 5], demand.moving, demand.unexplained
        missing = self._missing(course - demand.states[:, 2], rate, moving) - unexplained[:, 2]
        angle = self._helm(rate, missing, moving, demand.standing)
        drive = self._drive(speed, moving, angle, unexplained[:, 0])
        if self.approach.helm.turns_thrust:
            drive = self._kicked(drive, np.where(speed > 0.0, np.abs(missing), 0.0), moving)
        helm = self.approach.helm
        rows = helm.rows(self._as_thrusters_stand(drive, demand.standing), angle)
        rows += whole_turns(demand.standing - rows) * self.vessel.turns_freely  # by the shortest turn
        return helm.idle_in_turns(rows, demand.standing)

    def _as_thrusters_stand(self, drive: Array, standing: Array) -> Array:
        """(n,) engine orders that let thrusters stand as they are where little would be gained by turning them round.

        They turn for a good part of full power only; until then the engines stop.
        """
        if not self.approach.helm.turning_round:
            return drive
        astern = self.approach.helm.stands_astern(standing)
        stay = np.where(astern, drive < ROUND_FROM, drive > -ROUND_FROM)
        stopped = np.where(astern, np.minimum(drive, -STOPPED_ASTERN), np.maximum(drive, 0.0))
        return np.asarray(np.where(stay, stopped, drive))

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

    def _missing(self, turn: Array, rate: Array, moving: Array) -> Array:
        """(n,) yaw accelerations that heading, sway and yaw rate ask for [rad/s2].

        Args:
            turn: (n,) from the heading to the desired one [rad].
            rate: (n,) desired yaw rates [rad/s].
            moving: (n, 3) velocities through water.
        """
        rates, sways, _ = self._turns
        by_heading, by_sway, by_rate = self._gains
        turn = np.clip(wrap_angle(turn), -HELM_FARTHEST_RAD, HELM_FARTHEST_RAD)
        sway = np.interp(rate, rates, sways)
        return np.asarray(by_heading * turn + by_sway * (sway - moving[:, 1]) + by_rate * (rate - moving[:, 2]))

    def _helm(self, rate: Array, missing: Array, moving: Array, standing: Array) -> Array:
        """(n,) helm angles: those of steady turns at yaw rates (n,), and more or less for what is missing (n,)."""
        approach = self.approach
        rates, _, angles = self._turns
        effect = self._helm_effect * np.maximum(moving[:, 0] / self.transit_speed_mps, HELM_SLOWEST) ** 2
        change = np.interp(rate, rates, angles) + missing / effect
        if approach.helm.turns_thrust:
            found = self._effects_of_thrust(approach.helm.drives(standing), moving)
            least = HELM_SLOWEST**2 * self._helm_effect
            change *= effect / np.where(found < 0.0, np.minimum(found, -least), np.maximum(found, least))
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

    def _kicked(self, drive: Array, missing: Array, moving: Array) -> Array:
        """(n,) engine orders at which the helm, hard over, gives yaw accelerations (n,) that a course far off asks for.

        Thrust that is turned steers by its size: a mate does not slow down, or go astern, out of a turn that he must
        stop, but kicks ahead.
        """
        ships = np.flatnonzero(missing > self._gains[0] * KICK_RAD)
        if not len(ships):
            return drive
        given = self._effects_of_thrust(np.repeat(KICKS[:, None], len(ships), axis=1), moving[ships])
        weak = (given * self._hardest < missing[ships]).sum(axis=0)
        kicked = drive.copy()
        kicked[ships] = np.maximum(drive[ships], KICKS[np.minimum(weak, len(KICKS) - 1)])
        return kicked

    @cached_property
    def _hardest(self) -> float:
        approach = self.approach
        return float(approach.helm.hardest(approach.drive) - abs(approach.angle_rad))

    def _effects_of_thrust(self, order: Array, moving: Array) -> Array:
        """(..., n) yaw acceleration per helm angle of thrust that is turned: none at idle, the other way round astern.

        Args:
            order: (..., n) engine orders.
            moving: (n, 3) velocities through water.
        """
        helm, tilt, motion = self.approach.helm, HELM_TILT_RAD, tuple(moving.T)
        sides = [
            self.vessel.model.accelerations(
                motion, motion[:2], tuple(np.moveaxis(helm.rows(order, self.approach.angle_rad + angle), -1, 0))
            )[2]
            for angle in self.approach.starboard * np.array([tilt, -tilt])
        ]
        return np.asarray((sides[0] - sides[1]) / (2 * tilt))

    @cached_property
    def _gains(self) -> Array:
        """(3,) yaw acceleration by heading error [1/s2], by that of sway [rad/(m s)] and by that of yaw rate [1/s].

        Those of the linear quadratic regulator of the straight approach, which holds ships that are unstable on their
        course as well: a yaw acceleration of the square of the course's frequency costs as much as a radian of heading.
        Source: B. D. O. Anderson and J. B. Moore, Optimal Control: Linear Quadratic Methods (1990), section 3.2.
        """
        used = [0, *(OUTPUTS.index(name) for name in self.vessel.model.outputs if name != "u")]
        rates = np.zeros((3, 3))
        rates[0, 2] = 1.0
        rates[1:, 1:], push = self._sway_and_yaw
        by_yaw = np.r_[0.0, push[0] / self._helm_effect, 1.0][used, None]
        worth = np.diag([1.0] + [0.0] * (len(used) - 1))
        dear = np.array([[(self._pace_s / COURSE_FREQUENCY) ** 4]])
        cost = scipy.linalg.solve_continuous_are(rates[np.ix_(used, used)], by_yaw, worth, dear)
        gains = np.zeros(3)
        gains[used] = (by_yaw.T @ cost / dear)[0]
        return gains

    @cached_property
    def _sway_and_yaw(self) -> tuple[Array, Array]:
        """(2, 2) derivatives of the accelerations of sway and yaw by these velocities, (2,) by helm, straight ahead."""
        approach = self.approach
        velocity, straight = np.array(approach.velocity), approach.angle_rad
        steps = 1e-3 * approach.speed_mps * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0 / self.vessel.length_m]])
        tilt = 1e-3 * approach.starboard

        def pushed(motion: Array, angle_rad: float) -> Array:
            return np.array(approach.helm.acceleration(tuple(motion.tolist()), approach.drive, angle_rad))[1:]

        by_motion = [
            (pushed(velocity + step, straight) - pushed(velocity - step, straight)) / (2 * step.sum()) for step in steps
        ]
        by_helm = (pushed(velocity, straight + tilt) - pushed(velocity, straight - tilt)) / 2e-3
        return np.array(by_motion).T, by_helm

    @cached_property
    def _helm_effect(self) -> float:
        """Yaw acceleration per helm angle on the straight approach [1/s2]."""
        return max(float(self._sway_and_yaw[1][1]), 1e-12)

    @cached_property
    def _turns(self) -> tuple[Array, Array, Array]:
        """Yaw rates of steady turns, their sway, and changes of helm that hold them."""
        rows = sorted([(turn.yaw_rate_radps, turn.sway_mps, turn.helm_rad) for turn in self.turns] + [(0.0, 0.0, 0.0)])
        rates, sways, angles = np.array(rows).T
        return rates, sways, angles


@dataclass(frozen=True, kw_only=True, eq=False)
class HoverController:
    """A helm under way; at rest, thrusters that hold place and heading.

    So a ship that stops beside a place, or off its heading, comes there on the spot instead of by another approach.
    """

    helm: HelmController
    hover: ForceController

    @property
    def answer_s(self) -> float:
        """That of the helm [s]."""
        return self.helm.answer_s

    def commands(self, demand: Demand) -> Array:
        """(n, m) desired actuator values: by thrusters for ships whose reference is slow, so that they stop first."""
        speed = np.hypot(demand.reference_through[:, 0], demand.reference_through[:, 1])
        slow = speed <= HOVER_SHARE * self.helm.transit_speed_mps
        if not slow.any():
            return self.helm.commands(demand)
        rows = np.empty_like(demand.standing)
        for ships, controller in ((np.flatnonzero(slow), self.hover), (np.flatnonzero(~slow), self.helm)):
            if len(ships):
                rows[ships] = controller.commands(demand.part(ships))
        return rows
