"""Which kind of ship a vessel is, and what it can do on repositioning legs, by its nominal model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from expdesign.dictionary.trim import drift, trim
from expdesign.errors import NoPlan
from expdesign.plan.control.helm_capability import (
    LATERAL_MPS2,
    leg_radius_m,
    side_by_side,
    simulated_acceleration,
    steady_turns,
    stopping_distance_m,
    why_not_ahead,
)
from expdesign.plan.control.ships import AgileShip, Capability, DubinsShip, HelmShip
from expdesign.plan.control.tuning import CONTROL
from expdesign.plan.values import PlanSettings
from expdesign.simulation import steady_ahead
from expdesign.vessel import Limit, Vessel, pushed_everywhere

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
    spot = _largest(lambda r: _holds(vessel, (0.0, 0.0, r)), start=1e-4 * transit / vessel.length_m) or 0.0
    agile = pushed_everywhere(vessel.model) and spot > transit / vessel.length_m / 10
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
        run_up_m=(CONTROL.settling_hulls + CONTROL.approach_hulls) * vessel.length_m,
    )


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
