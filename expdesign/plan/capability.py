"""What the vessel can do on repositioning legs, by its nominal model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from expdesign.dictionary.build import drift, trim
from expdesign.errors import NoPlan
from expdesign.plan.values import PlanSettings
from expdesign.vessel import Vessel

USABLE = 0.9
"""Share of the largest steady speed, and of the largest steady yaw rate, that repositioning counts on."""

LATERAL_MPS2 = 0.03 * 9.81
"""Lateral acceleration of turns on legs: small enough not to heel the ship."""


@dataclass(frozen=True, kw_only=True)
class Capability:
    """Speeds and turns for repositioning.

    Attributes:
        top_speed_mps: largest steady surge speed within the actuators' limits.
        transit_speed_mps: speed of repositioning legs through water.
        turning_radius_m: of repositioning legs.
        yaw_rate_radps: largest yaw rate used on legs.
        acceleration_mps2: mean surge acceleration between rest and transit speed.
    """

    top_speed_mps: float
    transit_speed_mps: float
    turning_radius_m: float
    yaw_rate_radps: float
    acceleration_mps2: float


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
    top = _largest(lambda u: _holds(vessel, (u, 0.0, 0.0)), start=1e-3 * vessel.length_m)
    if top is None:
        raise NoPlan(f"vessel {vessel.name!r} cannot hold any speed ahead with its actuators and nominal model")
    transit = settings.transit_speed_mps or USABLE * top
    if transit > top:
        raise NoPlan(f"plan.transit_speed_mps is {transit:g}, vessel {vessel.name!r} reaches {top:.3g} m/s")
    if current_mps >= transit:
        raise NoPlan(f"the mean current of {current_mps:.3g} m/s is not slower than repositioning at {transit:.3g} m/s")
    yaw = _largest(lambda r: _holds(vessel, (transit, 0.0, r)), start=1e-4 * transit / vessel.length_m)
    if yaw is None:
        raise NoPlan(f"vessel {vessel.name!r} cannot turn at {transit:.3g} m/s with its actuators and nominal model")
    yaw = min(yaw, LATERAL_MPS2 / transit / USABLE)
    if settings.turning_radius_m is not None and settings.turning_radius_m < transit / yaw:
        raise NoPlan(
            f"plan.turning_radius_m is {settings.turning_radius_m:g}, at {transit:.3g} m/s vessel {vessel.name!r} "
            f"needs {transit / yaw:.3g} m or more"
        )
    radius = settings.turning_radius_m or max(transit / (USABLE * yaw), 1.5 * vessel.length_m)
    return Capability(
        top_speed_mps=top,
        transit_speed_mps=transit,
        turning_radius_m=radius,
        yaw_rate_radps=min(USABLE * yaw, 2.0 * transit / radius),
        acceleration_mps2=_acceleration(vessel, transit),
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
