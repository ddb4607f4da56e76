"""The kinds of ships, by what their actuators and models allow: what each can do on legs, and how it is steered.

`Capability` is what every kind has. The kind is decided once, in `capability`, by the nominal model.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.dictionary.trim import drift, trim
from expdesign.errors import NoPlan
from expdesign.plan.control.controllers import Controller, ForceController, HelmController, HoverController
from expdesign.plan.control.helm_capability import (
    LATERAL_MPS2,
    SteadyTurn,
    leg_radius_m,
    side_by_side,
    simulated_acceleration,
    steady_turns,
    stopping_distance_m,
    why_not_ahead,
)
from expdesign.plan.values import PlanSettings
from expdesign.simulation import Approach, steady_ahead
from expdesign.values import Array
from expdesign.vessel import Limit, Vessel, pushed_everywhere

TRACK_LEAD = 4.0  # time constant of the return to the reference, in those of the velocities
RUN_UP_TIME_CONSTANTS = 3.0  # of the return to the track, that the run-up of a force-steered ship lasts
SETTLING_HULLS = 2.0  # hull lengths before that in which what is left of a turn dies out
APPROACH_HULLS = 1.0  # hull lengths that a helm-steered ship goes straight and steady before each run

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

    @property
    def hovers(self) -> bool:
        """Whether thrusters hold the ship's place and heading at rest, however it is steered under way."""
        return self.keeps_station

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
        return RUN_UP_TIME_CONSTANTS * TRACK_LEAD * self.controller(vessel).answer_s

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
    hovers: bool = False

    @property
    def keeps_station(self) -> bool:
        """No: the rudder needs flow."""
        return False

    def path_spares_m(self, vessel: Vessel) -> tuple[float, ...]:
        """What keeps the hull clear on arcs."""
        return (arc_spare_m(self, vessel),)

    def controller(self, vessel: Vessel) -> Controller:
        """Courses by the helm, speeds by the engines, places at rest by thrusters that can."""
        helm = HelmController(
            vessel=vessel, approach=self.approach, turns=self.turns, transit_speed_mps=self.transit_speed_mps
        )
        if not self.hovers:
            return helm
        hover = ForceController(vessel=vessel, answer_s=helm.answer_s, turn_rate_radps=self.turn_rate_radps)
        return HoverController(helm=helm, hover=hover)

    def run_up_s(self, vessel: Vessel, speed_mps: float) -> float:
        """Some hull lengths."""
        return HELM_RUN_UP_HULLS * vessel.length_m / max(speed_mps, 0.5 * self.transit_speed_mps)

    @property
    def sideways_mps(self) -> float:
        """Largest sway, on the way into the hardest turn from transit speed; by the rule of thumb for yaw rates."""
        return HELM_OVERSHOOT * max(abs(turn.sway_mps) for turn in self.turns)

    def braking_mps2(self, speed_mps: float) -> float:
        """Deceleration with the engines full astern."""
        return speed_mps**2 / (2 * self.stopping_m)


def arc_spare_m(ship: Capability, vessel: Vessel) -> float:
    """Distance beyond the clearance of a centre line that keeps the hull clear on an arc of the turning radius [m]."""
    radius = ship.turning_radius_m
    return float(np.hypot(radius + vessel.beam_m / 2, vessel.length_m / 2)) - radius


USABLE_SHARE = 0.9  # of the largest steady speed, and of the largest steady yaw rate, that repositioning counts on
# largest yaw rate on the way into a turn, in those of the steady one: a rule of thumb that bounds the search
HELM_OVERSHOOT = 1.3
# weakest push at rest, in the strongest, with which thrusters steer a ship on legs: a tunnel thruster beside two
# propellers does not
STEERING_PUSH = 0.1
# turning radius at transit speed without drift, in hull lengths, above which a ship is steered by a helm: thrusters
# that turn her on the spot do not hold her hull across the flow
WIDEST_WITHOUT_DRIFT = 10.0


def capability(vessel: Vessel, settings: PlanSettings, *, current_mps: float = 0.0) -> Capability:
    """Repositioning speeds and turns: what the user asks for, or what the nominal model gives in calm air.

    Raises:
        NoPlan: the vessel cannot make headway, not even against the mean current, cannot reach the speed or the
            radius asked for, or cannot turn while moving.
    """
    for output, motion in (("u", "move ahead"), ("r", "turn")):
        if output not in vessel.model.outputs:
            raise NoPlan(
                f"the model of vessel {vessel.name!r} has no {output} equation and cannot {motion}: its primitives "
                "can be scored and given durations, but a plan needs a model that can be steered"
            )
    if needs_helm(vessel):
        return _helm_ship(vessel, settings, current_mps)
    top = _largest(lambda u: _holds(vessel, (u, 0.0, 0.0)), start=1e-3 * vessel.length_m)
    if top is None:
        raise NoPlan(f"vessel {vessel.name!r} cannot hold any speed ahead with its actuators and nominal model")
    transit = _transit_speed(vessel, settings, top, current_mps)
    yaw, no_helm = _largest(lambda r: _holds(vessel, (transit, 0.0, r)), start=1e-4 * transit / vessel.length_m), ""
    if yaw is None or transit / yaw > WIDEST_WITHOUT_DRIFT * vessel.length_m:
        try:
            return _helm_ship(vessel, settings, current_mps)
        except NoPlan as error:  # without a helm she turns as wide as she does, or where she is
            no_helm = str(error)
    if yaw is None:
        raise NoPlan(
            f"vessel {vessel.name!r} cannot turn at {transit:.3g} m/s with its actuators and nominal model, and no "
            f"helm was found: {no_helm}"
        )
    yaw = min(yaw, LATERAL_MPS2 / transit / USABLE_SHARE)
    if settings.turning_radius_m is not None and settings.turning_radius_m < transit / yaw:
        raise NoPlan(
            f"plan.turning_radius_m is {settings.turning_radius_m:g}, at {transit:.3g} m/s vessel {vessel.name!r} "
            f"needs {transit / yaw:.4g} m or more" + (f"; no helm for legs was found ({no_helm})" if no_helm else ""),
            what="radius",
        )
    spot = _spot_rate_radps(vessel, transit)
    agile = pushed_everywhere(vessel.model) and _turns_on_the_spot(vessel, transit, spot)
    radius = settings.turning_radius_m or max(transit / (USABLE_SHARE * yaw), 1.5 * vessel.length_m)
    rate = min(USABLE_SHARE * yaw, 2.0 * transit / radius)
    turns = "on the spot and sideways" if agile else f"in arcs of {radius:.3g} m"
    note = f"no helm for legs was found ({no_helm}), so she is planned to turn {turns}" if no_helm else ""
    return (AgileShip if agile else DubinsShip)(
        note=note,
        top_speed_mps=top,
        transit_speed_mps=transit,
        turning_radius_m=radius,
        yaw_rate_radps=rate,
        acceleration_mps2=_acceleration(vessel, transit),
        spot_rate_radps=USABLE_SHARE * spot,
        lateral_mps2=max(LATERAL_MPS2, 1.01 * transit * rate),
        working_s=max(_reach(limit) / rate for limit, rate in zip(vessel.limits, vessel.rates.tolist(), strict=True)),
        late_s=max(response.lag_s + response.delay_s for response in vessel.responses),
    )


def _reach(limit: Limit) -> float:
    """Largest size of a command; a quarter turn of angles without limits."""
    far = max(abs(limit.low), abs(limit.high))
    return far if np.isfinite(far) else np.pi / 2


def needs_helm(vessel: Vessel) -> bool:
    """Whether no inverse model steers it: its actuators do not push in every direction at rest."""
    return not pushed_everywhere(vessel.model, STEERING_PUSH)


def _transit_speed(vessel: Vessel, settings: PlanSettings, top: float, current_mps: float) -> float:
    transit = settings.transit_speed_mps or USABLE_SHARE * top
    if transit > top:
        raise NoPlan(
            f"plan.transit_speed_mps is {transit:g}, vessel {vessel.name!r} reaches {top:.3g} m/s", what="speed"
        )
    if current_mps >= transit:
        raise NoPlan(
            f"the mean current of {current_mps:.3g} m/s is not slower than repositioning at {transit:.3g} m/s, vessel "
            f"{vessel.name!r} reaches {top:.3g} m/s",
            what="speed",
        )
    return transit


def _helm_ship(vessel: Vessel, settings: PlanSettings, current_mps: float) -> HelmShip:
    """Capability of a ship that is steered by a helm, by simulating it."""
    slowest = 1e-3 * vessel.length_m
    top = _largest(lambda speed: not why_not_ahead(vessel, speed), start=slowest)
    if top is None:
        raise NoPlan(
            f"vessel {vessel.name!r} cannot hold any speed ahead on a straight course with its actuators: "
            f"{why_not_ahead(vessel, slowest)}"
        )
    transit = _transit_speed(vessel, settings, top, current_mps)
    approach = steady_ahead(vessel, transit)
    turns = steady_turns(approach)
    pairs = side_by_side(turns)
    if not pairs:
        raise NoPlan(
            f"vessel {vessel.name!r} has no steady turn to both sides at {transit:.3g} m/s: its helm is "
            f"{approach.helm.description}"
        )
    radius = leg_radius_m(approach, settings, pairs)
    fastest = max(abs(turn.yaw_rate_radps) for turn in turns)
    return HelmShip(
        top_speed_mps=top,
        transit_speed_mps=transit,
        turning_radius_m=radius,
        yaw_rate_radps=HELM_OVERSHOOT * max(fastest, transit / radius),
        acceleration_mps2=simulated_acceleration(approach),
        lateral_mps2=max(LATERAL_MPS2, HELM_OVERSHOOT * transit**2 / radius),
        approach=approach,
        turns=turns,
        stopping_m=stopping_distance_m(vessel, transit),
        run_up_m=(SETTLING_HULLS + APPROACH_HULLS) * vessel.length_m,
        hovers=not needs_helm(vessel) and _turns_on_the_spot(vessel, transit, _spot_rate_radps(vessel, transit)),
    )


def _spot_rate_radps(vessel: Vessel, transit_mps: float) -> float:
    """Largest steady yaw rate on the spot; 0 where there is none."""
    return _largest(lambda r: _holds(vessel, (0.0, 0.0, r)), start=1e-4 * transit_mps / vessel.length_m) or 0.0


def _turns_on_the_spot(vessel: Vessel, transit_mps: float, spot_radps: float) -> bool:
    """Whether a yaw rate on the spot is not small beside that of a hull length at transit speed."""
    return spot_radps > transit_mps / vessel.length_m / 10


def _holds(vessel: Vessel, velocity: tuple[float, float, float]) -> bool:
    """Whether the actuators keep a velocity up: what they leave over is under a hundredth of it per time constant."""
    nu = np.array(velocity)
    left = drift(vessel, nu, trim(vessel, nu))
    free = drift(vessel, nu, np.zeros(len(vessel.limits)))
    return bool(np.abs(left).max() <= 1e-6 + 0.01 * np.abs(free).max())


def _largest(holds: Callable[[float], bool], *, start: float) -> float | None:
    """The largest value for which a monotone condition holds, by doubling and bisection."""
    if not holds(start):
        return None
    low = start
    while holds(2 * low) and low < 1e3:
        low *= 2
    high = 2 * low
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _acceleration(vessel: Vessel, speed: float) -> float:
    """Surge acceleration that full ahead leaves at half the transit speed."""
    nu = np.array([speed / 2, 0.0, 0.0])
    steady = trim(vessel, np.array([speed, 0.0, 0.0]))
    return max(float(drift(vessel, nu, steady)[0]), 1e-6 * speed)
