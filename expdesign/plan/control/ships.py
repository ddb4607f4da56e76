"""The kinds of ships, by what their actuators and models allow: what each can do on legs, and how it is steered.

`Capability` is what every kind has. The kind is decided once, in `expdesign.plan.control.capability.capability`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.control.controllers import Controller, ForceController, HelmController
from expdesign.plan.control.helm_capability import LATERAL_MPS2, SteadyTurn
from expdesign.plan.control.tuning import CONTROL
from expdesign.simulation import Approach
from expdesign.values import Array
from expdesign.vessel import Vessel

# of the time in which a vessel reaches its speed, or its actuators run up, that a change of motion takes besides
SETTLING_SHARE = 0.25
# hull lengths that paths of agile ships keep from the shore beyond clearance and half beam
AGILE_PATH_SPARES = (0.25, 0.1, 0.02)
LEAD_SHARE = 0.2  # share of their lag in which lagging actuators reach what is desired, by commanding more
HELM_RUN_UP_HULLS = 8.0  # hull lengths of the run-up of a helm-steered ship


@dataclass(frozen=True, kw_only=True)
class Capability(ABC):
    """Speeds and turns on repositioning legs."""

    top_speed_mps: float  # largest steady surge speed within the actuators' limits
    transit_speed_mps: float  # speed of repositioning legs through water
    turning_radius_m: float  # of repositioning legs
    yaw_rate_radps: float  # largest yaw rate used on legs under way
    acceleration_mps2: float  # mean surge acceleration between rest and transit speed
    lateral_mps2: float = LATERAL_MPS2  # largest surge speed times yaw rate on legs
    spot_rate_radps: float = 0.0  # yaw rate of turns at little speed; 0 for ships that do not turn there
    note: str = ""  # how it is steered on legs, where that is not what its thrusters suggest

    @property
    def turn_rate_radps(self) -> float:
        """Largest yaw rate, under way or on the spot."""
        return max(self.spot_rate_radps, self.yaw_rate_radps)

    @abstractmethod
    def path_spares_m(self, vessel: Vessel) -> tuple[float, ...]:
        """Distances beyond the clearance that centre lines of legs keep from the shore, from wide to narrow [m]."""

    @abstractmethod
    def controller(self, vessel: Vessel) -> Controller:
        """The controller that keeps such a ship on a reference."""

    @property
    @abstractmethod
    def keeps_station(self) -> bool:
        """Whether the ship can stop, wait and turn on the spot, and need not point where it goes."""

    @abstractmethod
    def run_up_s(self, vessel: Vessel, speed_mps: float) -> float:
        """Time of the straight run-up to a run that begins at a speed over ground [s]."""

    @abstractmethod
    def braking_mps2(self, speed_mps: float) -> float:
        """Gentle deceleration from a speed to a stop [m/s2]."""


@dataclass(frozen=True, kw_only=True)
class ForceSteered(Capability):
    """Ships that forces in every direction steer."""

    working_s: float  # in which the slowest actuator goes from nothing to full, or turns a quarter of a circle
    late_s: float  # until most of what an actuator is commanded is delivered

    @property
    def settle_s(self) -> float:
        """Time that a change of motion takes beyond what speeds and accelerations explain: a rule of thumb."""
        return self._settling_s + self.late_s

    @property
    def keeps_station(self) -> bool:
        """Yes."""
        return True

    def controller(self, vessel: Vessel) -> Controller:
        """Velocities by forces, by the inverse of the nominal model."""
        late_s = max(response.delay_s + LEAD_SHARE * response.lag_s for response in vessel.responses)
        answer_s = max(self._settling_s + late_s, 3.0 * vessel.sample_time_s)
        return ForceController(vessel=vessel, answer_s=answer_s, turn_rate_radps=self.turn_rate_radps)

    def run_up_s(self, vessel: Vessel, speed_mps: float) -> float:
        """Some time constants of the return to the track."""
        return CONTROL.run_up_time_constants * CONTROL.track_lead * self.controller(vessel).answer_s

    def braking_mps2(self, speed_mps: float) -> float:
        """A quarter of the acceleration."""
        return self.acceleration_mps2 / 4

    @property
    def _settling_s(self) -> float:
        return SETTLING_SHARE * max(self.transit_speed_mps / self.acceleration_mps2, self.working_s)


@dataclass(frozen=True, kw_only=True)
class AgileShip(ForceSteered):
    """Ships whose actuators push in every direction at once: they turn on the spot and go sideways."""

    @property
    def swing_radps(self) -> float:
        """Mean yaw rate of turns, on the spot or slowed down as far as the lateral limit asks."""
        return min(self.spot_rate_radps, 1.5 * self.lateral_mps2 / self.transit_speed_mps)

    def path_spares_m(self, vessel: Vessel) -> tuple[float, ...]:
        """Half the beam and some: more gives smoother paths, less leads through narrower water."""
        return tuple(vessel.beam_m / 2 + share * vessel.length_m for share in AGILE_PATH_SPARES)

    def turn_loss_s(self, first_rad: Array, second_rad: Array) -> Array:
        """Time that turns at both ends of a leg cost besides its path, from the courses there.

        A fit to optimised legs: about the time of half a turn on the spot for half a turn in all, less when it is
        shared between the ends.
        """
        half_turn_s = np.pi / self.swing_radps
        return np.asarray(2.0 * half_turn_s * (wrap_angle(first_rad) ** 2 + wrap_angle(second_rad) ** 2) / np.pi**2)

    def speed_loss_s(self, first_mps: Array, last_mps: Array) -> Array:
        """Time that accelerating and stopping cost besides the path at transit speed, and settling."""
        v = self.transit_speed_mps
        lost = [(v - np.clip(end, 0.0, v)) ** 2 / (2 * self.acceleration_mps2 * v) for end in (first_mps, last_mps)]
        return np.asarray(lost[0] + lost[1] + self.settle_s)

    def departure_m(self, turn_rad: float, hull_m: float) -> float:
        """Length of path on which the ship turns by an angle and reaches transit speed."""
        v = self.transit_speed_mps
        turning = v * abs(float(wrap_angle(turn_rad))) / self.swing_radps
        return turning + v**2 / (2 * self.acceleration_mps2) + 2 * v * self.settle_s + hull_m / 2


@dataclass(frozen=True, kw_only=True)
class DubinsShip(ForceSteered):
    """Force-steered ships that hardly turn at rest: they sail arcs of the turning radius."""

    def path_spares_m(self, vessel: Vessel) -> tuple[float, ...]:
        """What keeps the hull clear on arcs."""
        return (arc_spare_m(self, vessel),)


@dataclass(frozen=True, kw_only=True)
class HelmShip(Capability):
    """Ships that are steered by a helm."""

    approach: Approach  # straight ahead at transit speed
    turns: tuple[SteadyTurn, ...]  # steady turns with the engines at that order
    stopping_m: float  # distance in which the ship stops from there with the engines full astern
    run_up_m: float  # straight before each run: room to settle, and a steady approach

    @property
    def keeps_station(self) -> bool:
        """No: the rudder needs flow."""
        return False

    def path_spares_m(self, vessel: Vessel) -> tuple[float, ...]:
        """What keeps the hull clear on arcs."""
        return (arc_spare_m(self, vessel),)

    def controller(self, vessel: Vessel) -> Controller:
        """Courses by the helm, speeds by the engines."""
        return HelmController(
            vessel=vessel, approach=self.approach, turns=self.turns, transit_speed_mps=self.transit_speed_mps
        )

    def run_up_s(self, vessel: Vessel, speed_mps: float) -> float:
        """Some hull lengths."""
        return HELM_RUN_UP_HULLS * vessel.length_m / max(speed_mps, 0.5 * self.transit_speed_mps)

    def braking_mps2(self, speed_mps: float) -> float:
        """Deceleration with the engines full astern."""
        return speed_mps**2 / (2 * self.stopping_m)


def arc_spare_m(ship: Capability, vessel: Vessel) -> float:
    """Distance beyond the clearance of a centre line that keeps the hull clear on an arc of the turning radius [m]."""
    radius = ship.turning_radius_m
    return float(np.hypot(radius + vessel.beam_m / 2, vessel.length_m / 2)) - radius
