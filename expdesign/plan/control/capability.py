"""What the vessel can do on repositioning legs, by its nominal model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.dictionary.build import drift, trim
from expdesign.errors import NoPlan
from expdesign.plan.control.helm_capability import (
    LATERAL_MPS2,
    leg_radius_m,
    simulated_acceleration,
    stopping_way_m,
    why_not_ahead,
)
from expdesign.plan.control.steady_turns import SteadyTurn, side_by_side, steady_turns
from expdesign.plan.values import PlanSettings
from expdesign.simulation import Approach, steady_ahead
from expdesign.values import Array
from expdesign.vessel import Limit, Vessel, direct_terms, force_matrix

USABLE = 0.9
"""Share of the largest steady speed, and of the largest steady yaw rate, that repositioning counts on."""

RUN_UP = 1.0
"""Hull lengths that a ship with a helm goes straight and steady, helm as it holds the course, before each run."""

SETTLE = 2.0
"""Hull lengths before that in which what is left of a turn dies out under the helmsman's hand."""

SETTLING = 0.25
"""Share of the time in which a vessel gathers way, or its actuators run up, that a change of motion takes besides."""

OVERSHOOT = 1.3
"""Largest yaw rate on the way into a turn, in those of the steady one: a thumb rule that bounds the search."""


@dataclass(frozen=True, kw_only=True)
class Capability:
    """Speeds and turns for repositioning.

    Attributes:
        top_speed_mps: largest steady surge speed within the actuators' limits.
        transit_speed_mps: speed of repositioning legs through water.
        turning_radius_m: of repositioning legs.
        yaw_rate_radps: largest yaw rate used on legs.
        acceleration_mps2: mean surge acceleration between rest and transit speed.
        spot_rate_radps: yaw rate of turns at little speed, used only where `agile`.
        agile: the actuators push in every direction at once, so the vessel turns on the spot and goes sideways; others
            sail arcs of the turning radius.
        lateral_mps2: largest surge speed times yaw rate on legs.
        approach: how a ship that is steered by a helm goes straight at transit speed; None for vessels that the
            generalised force steers.
        turns: its steady turns with the engines at that order.
        stopping_m: distance in which it stops from there with the engines full astern.
        run_up_m: straight before each run: room to settle, and a steady approach.
        working_s: in which the slowest actuator goes from nothing to full, or turns a quarter of a circle.
        late_s: until what an actuator delivers has come by most of the way to what it is told.
    """

    top_speed_mps: float
    transit_speed_mps: float
    turning_radius_m: float
    yaw_rate_radps: float
    acceleration_mps2: float
    spot_rate_radps: float = 0.0
    agile: bool = False
    lateral_mps2: float = LATERAL_MPS2
    approach: Approach | None = None
    turns: tuple[SteadyTurn, ...] = ()
    stopping_m: float = 0.0
    run_up_m: float = 0.0
    working_s: float = 0.0
    late_s: float = 0.0

    @property
    def swing_radps(self) -> float:
        """Mean yaw rate of an agile vessel's turns, on the spot or slowed down as far as the lateral limit asks."""
        return min(self.spot_rate_radps, 1.5 * self.lateral_mps2 / self.transit_speed_mps)

    @property
    def settle_s(self) -> float:
        """Time that a change of motion takes beyond what speeds and accelerations explain: a thumb rule."""
        return SETTLING * max(self.transit_speed_mps / self.acceleration_mps2, self.working_s) + self.late_s


def capability(vessel: Vessel, settings: PlanSettings, *, current_mps: float = 0.0) -> Capability:
    """Repositioning speeds and turns: the user's wishes, or what the nominal model gives in calm air.

    Raises:
        NoPlan: the vessel cannot make headway, not even against the mean current, cannot reach the wished speed or
            the wished radius, or cannot turn while moving.
    """
    for output, motion in (("u", "move ahead"), ("r", "turn")):
        if output not in vessel.model.outputs:
            raise NoPlan(
                f"the model of vessel {vessel.name!r} has no {output} equation and cannot {motion}: its primitives "
                "can be scored and given durations, but a plan needs a model that can be steered"
            )
    if needs_helm(vessel):
        return _helmed_capability(vessel, settings, current_mps)
    top = _largest(lambda u: _holds(vessel, (u, 0.0, 0.0)), start=1e-3 * vessel.length_m)
    if top is None:
        raise NoPlan(f"vessel {vessel.name!r} cannot hold any speed ahead with its actuators and nominal model")
    transit = _transit_speed(vessel, settings, top, current_mps)
    yaw = _largest(lambda r: _holds(vessel, (transit, 0.0, r)), start=1e-4 * transit / vessel.length_m)
    if yaw is None:
        raise NoPlan(f"vessel {vessel.name!r} cannot turn at {transit:.3g} m/s with its actuators and nominal model")
    yaw = min(yaw, LATERAL_MPS2 / transit / USABLE)
    if settings.turning_radius_m is not None and settings.turning_radius_m < transit / yaw:
        raise NoPlan(
            f"plan.turning_radius_m is {settings.turning_radius_m:g}, at {transit:.3g} m/s vessel {vessel.name!r} "
            f"needs {transit / yaw:.3g} m or more"
        )
    spot = _largest(lambda r: _holds(vessel, (0.0, 0.0, r)), start=1e-4 * transit / vessel.length_m) or 0.0
    agile = bool(np.linalg.matrix_rank(force_matrix(vessel.actuators)) == 3) and spot > transit / vessel.length_m / 10
    radius = settings.turning_radius_m or max(transit / (USABLE * yaw), 1.5 * vessel.length_m)
    return Capability(
        top_speed_mps=top,
        transit_speed_mps=transit,
        turning_radius_m=radius,
        yaw_rate_radps=min(USABLE * yaw, 2.0 * transit / radius),
        acceleration_mps2=_acceleration(vessel, transit),
        spot_rate_radps=USABLE * spot,
        agile=agile,
        lateral_mps2=max(LATERAL_MPS2, 1.01 * transit * min(USABLE * yaw, 2.0 * transit / radius)),
        working_s=max(_reach(limit) / limit.rate for limit in vessel.limits),
        late_s=max(response.lag_s + response.delay_s for response in vessel.responses),
    )


def _reach(limit: Limit) -> float:
    """Largest size of a command; a quarter turn of angles without limits."""
    far = max(abs(limit.low), abs(limit.high))
    return far if np.isfinite(far) else np.pi / 2


def needs_helm(vessel: Vessel) -> bool:
    """Whether no inverse model steers it: its model reads actuators directly, or they cannot push every way."""
    return bool(direct_terms(vessel.model)) or bool(np.linalg.matrix_rank(force_matrix(vessel.actuators)) < 3)


def _transit_speed(vessel: Vessel, settings: PlanSettings, top: float, current_mps: float) -> float:
    transit = settings.transit_speed_mps or USABLE * top
    if transit > top:
        raise NoPlan(f"plan.transit_speed_mps is {transit:g}, vessel {vessel.name!r} reaches {top:.3g} m/s")
    if current_mps >= transit:
        raise NoPlan(f"the mean current of {current_mps:.3g} m/s is not slower than repositioning at {transit:.3g} m/s")
    return transit


def _helmed_capability(vessel: Vessel, settings: PlanSettings, current_mps: float) -> Capability:
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
    return Capability(
        top_speed_mps=top,
        transit_speed_mps=transit,
        turning_radius_m=radius,
        yaw_rate_radps=OVERSHOOT * max(fastest, transit / radius),
        acceleration_mps2=simulated_acceleration(approach),
        lateral_mps2=max(LATERAL_MPS2, OVERSHOOT * transit**2 / radius),
        approach=approach,
        turns=turns,
        stopping_m=stopping_way_m(vessel, transit),
        run_up_m=(SETTLE + RUN_UP) * vessel.length_m,
    )


def turn_loss_s(ship: Capability, first_rad: Array, second_rad: Array) -> Array:
    """Time that turning costs an agile vessel besides the way: from its course at first to the way, and at the end.

    A fit to optimised legs: about the time of half a turn on the spot for half a turn in all, less when it is shared
    between the ends.
    """
    half_turn_s = np.pi / ship.swing_radps
    return np.asarray(2.0 * half_turn_s * (wrap_angle(first_rad) ** 2 + wrap_angle(second_rad) ** 2) / np.pi**2)


def speed_loss_s(ship: Capability, first_mps: Array, last_mps: Array) -> Array:
    """Time that gathering and losing speed costs besides the way at transit speed, and settling."""
    v = ship.transit_speed_mps
    lost = [(v - np.clip(end, 0.0, v)) ** 2 / (2 * ship.acceleration_mps2 * v) for end in (first_mps, last_mps)]
    return np.asarray(lost[0] + lost[1] + ship.settle_s)


def joint_m(ship: Capability, turn_rad: float, hull_m: float) -> float:
    """Length of way in which an agile vessel turns by an angle and reaches transit speed."""
    v = ship.transit_speed_mps
    turning = v * abs(float(wrap_angle(turn_rad))) / ship.swing_radps
    return turning + v**2 / (2 * ship.acceleration_mps2) + 2 * v * ship.settle_s + hull_m / 2


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
