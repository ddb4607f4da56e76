"""One helm and one engine order for any vessel, and the steady run ahead that standard trials begin with.

The helm turns all rudders together. A vessel without rudders steers with the common angle of its azimuth thrusters:
those abaft amidships, or all where none is. A vessel known only by generalised forces steers as if one thruster at its
stern, half a length abaft amidships, gave all of its thrust. One with fixed propellers on both sides and nothing else
to steer with lets them turn at different speeds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from expdesign.errors import InputError, SpeedOutOfReach
from expdesign.simulation.actuation import past_deadband
from expdesign.values import Array, seal
from expdesign.vessel import NUMPY, SCALAR, Actuator, Limit, Operators, Vessel

SERVICE_SHARE = 0.85 ** (1 / 3)
"""Propeller speed at 85 % of the largest power, as a share of the largest, as power goes with its cube."""
FASTEST_MPS = 60.0
HARD_OVER_RAD = math.radians(35.0)
STEADY = 1e-9
"""Share of its speed that a steady vessel may gain or lose in a second."""


@dataclass(frozen=True, kw_only=True)
class Helm:
    """How a helm angle and an engine order become actuator commands."""

    vessel: Vessel  # the one that is steered

    def __post_init__(self) -> None:
        kinds = {actuator.kind for actuator in self.vessel.actuators}
        if not kinds & {"propeller", "azimuth", "force"}:
            raise InputError(f"vessel {self.vessel.name!r} has no propeller, azimuth thruster or force to drive it")
        for name, limit in zip(self.vessel.model.inputs, self.vessel.limits, strict=True):
            if name.startswith(("n", "tau_x")) and not (math.isfinite(limit.low) and math.isfinite(limit.high)):
                raise InputError(f"vessel {self.vessel.name!r}: {name} has no limits, expected finite ones")

    @cached_property
    def means(self) -> str:
        """Kind of steering: "rudder", "azimuth", "force", "propeller", or "" where nothing does."""
        kinds = [actuator.kind for actuator in self.vessel.actuators]
        sides = {np.sign(actuator.starboard_m) for actuator in self.vessel.actuators if actuator.kind == "propeller"}
        kinds = [kind for kind in kinds if kind != "propeller"] + ["propeller"] * ({-1.0, 1.0} <= sides)
        return next((kind for kind in ("rudder", "azimuth", "force", "propeller") if kind in kinds), "")

    @cached_property
    def steering(self) -> tuple[Actuator, ...]:
        """The actuators that turn with the helm."""
        able = tuple(actuator for actuator in self.vessel.actuators if actuator.kind == self.means)
        abaft = tuple(actuator for actuator in able if actuator.forward_m < 0)
        return abaft if self.means == "azimuth" and abaft else able

    @property
    def description(self) -> str:
        """One phrase for reports."""
        names = ", ".join(a.signals[-1] for a in self.steering)
        return {
            "rudder": f"rudder angle ({names})",
            "azimuth": f"common angle of the stern thrusters ({names})",
            "force": "angle of all thrust, as if it were given at the stern",
            "propeller": f"sine of the angle: difference of engine orders between the sides and their mean ({names})",
        }.get(self.means, "none")

    def inputs(self, drive: float, angle_rad: float) -> list[float]:
        """Commands in the model's order.

        Args:
            drive: engine order from -1, full astern, to 1, full ahead: the share of each actuator's limit.
            angle_rad: helm, in the sense of the actuators' own angles; where propellers steer, its sine is added to the
                engine orders to port and taken from those to starboard, as far as there is any left.
        """
        return self._row(drive, angle_rad, SCALAR)

    def rows(self, drive: Array, angle_rad: Array) -> Array:
        """(..., m) inputs for orders (...,) and angles (...,)."""
        return np.stack(np.broadcast_arrays(*self._row(drive, angle_rad, NUMPY), drive + angle_rad)[:-1], axis=-1)

    def _row(self, drive: Any, angle_rad: Any, ops: Operators) -> list[Any]:
        row: list[Any] = []
        steering, by_propellers = self.steering, self.means == "propeller"
        for actuator in self.vessel.actuators:
            turned, order = angle_rad if actuator in steering else 0.0, drive
            if by_propellers and actuator in steering:
                desired = drive - float(np.sign(actuator.starboard_m)) * ops.sin(turned)
                order = (ops.abs(desired + 1.0) - ops.abs(desired - 1.0)) / 2  # no more than there is to either side
            thrust = 0.0 if actuator.kind in ("tunnel", "rudder") else _share(actuator.limits[0], order, ops)
            side = thrust * ops.sin(turned)
            row += {
                "rudder": [turned],
                "azimuth": [thrust, turned],
                "force": [thrust * ops.cos(turned), side, 0.0 - self.vessel.length_m / 2 * side],
            }.get(actuator.kind, [thrust])
        return row

    @property
    def turns_thrust(self) -> bool:
        """Whether the helm turns thrust, so that it acts the other way round with the engines astern."""
        return self.means in ("azimuth", "force")

    def drives(self, inputs: Array) -> Array:
        """(n,) engine orders of commands (n, m) whose thrust is turned: those of the first actuator that steers."""
        actuator = self.steering[0]
        column, limit = self.vessel.model.inputs.index(actuator.signals[0]), actuator.limits[0]
        thrust = inputs[:, column]
        return np.asarray(thrust / np.where(thrust < 0.0, -min(limit.low, -1e-300), max(limit.high, 1e-300)))

    @property
    def drive_rate(self) -> float:
        """Largest change of the engine order per second."""
        thrust = [a for a in self.vessel.actuators if a.kind in ("propeller", "azimuth", "force")]
        return min(a.responses[0].rate / max(abs(a.limits[0].low), abs(a.limits[0].high)) for a in thrust)

    def angle_rate(self, drive: float) -> float:
        """Largest change of the helm angle per second [rad/s] at an engine order."""
        if self.means == "propeller":
            return self.drive_rate
        if self.means != "force":
            return min((actuator.responses[-1].rate for actuator in self.steering), default=math.inf)
        thrust = max(abs(float(_share(self.steering[0].limits[0], drive))), 1e-300)
        levers = (1.0, 1.0, self.vessel.length_m / 2)
        return min(how.rate / (thrust * lever) for how, lever in zip(self.steering[0].responses, levers, strict=True))

    def check(self, drive: float, angle_rad: float) -> None:
        """Raise InputError when an actuator cannot give this."""
        row = self.inputs(drive, angle_rad)
        for name, value, limit in zip(self.vessel.model.inputs, row, self.vessel.limits, strict=True):
            slack = 1e-9 * max(1.0, abs(value))
            if not limit.low - slack <= value <= limit.high + slack:
                raise InputError(
                    f"vessel {self.vessel.name!r}: a helm of {math.degrees(angle_rad):.4g} deg needs {name} = "
                    f"{value:.4g}, expected {limit.low:.4g} to {limit.high:.4g}"
                )

    def hardest(self, drive: float) -> float:
        """Largest helm angle to both sides [rad] that all actuators can give, `HARD_OVER_RAD` at most."""
        if self.means == "propeller":
            return HARD_OVER_RAD
        if self.means != "force":
            reaches = [min(-a.limits[-1].low, a.limits[-1].high) for a in self.steering]
            return min([HARD_OVER_RAD, *reaches])
        _, side, turn = self.steering[0].limits
        thrust, arm = abs(_share(self.steering[0].limits[0], drive)), self.vessel.length_m / 2
        most = min(-side.low, side.high, -turn.low / arm, turn.high / arm)
        return min(HARD_OVER_RAD, math.asin(min(1.0, max(0.0, most) / max(thrust, 1e-300))))

    def acceleration(self, motion: tuple[float, float, float], drive: float, angle_rad: float) -> list[float]:
        """d/dt (u, v, r) at a motion (u, v, r) through calm water under orders that have stood for long."""
        given = [
            float(past_deadband(command, response.deadband)) + response.offset
            for command, response in zip(self.inputs(drive, angle_rad), self.vessel.responses, strict=True)
        ]
        return [float(a) for a in self.vessel.model.accelerations(motion, motion[:2], given, SCALAR)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Approach:
    """A steady run straight ahead in calm water."""

    helm: Helm  # how the vessel is steered
    drive: float  # engine order that holds the speed
    angle_rad: float  # helm that holds the course; 0 for a symmetric vessel
    starboard: int  # +1 or -1: sign of a change of helm that turns the vessel to starboard, 0 where nothing does
    velocity: Array  # (3,) u, v, r through water, r = 0

    def __post_init__(self) -> None:
        seal(self, velocity="3")

    @property
    def inputs(self) -> Array:
        """(m,) commands that stand during the approach."""
        return np.array(self.helm.inputs(self.drive, self.angle_rad))

    @property
    def speed_mps(self) -> float:
        """Speed through water [m/s]."""
        return float(np.hypot(*self.velocity[:2]))


def steady_ahead(vessel: Vessel, speed_mps: float | None = None) -> Approach:
    """Trim for a straight course: engine order, drift and helm at which nothing accelerates.

    Args:
        vessel: nominal model, in calm water.
        speed_mps: surge speed through water, or None for `service_speed`.

    Raises:
        InputError: the engines cannot hold the speed, or the helm cannot hold the course.
    """
    helm = Helm(vessel=vessel)
    speed = service_speed(vessel) if speed_mps is None else float(speed_mps)
    if not 0 < speed < FASTEST_MPS:
        raise InputError(f"approach speed is {speed:g} m/s, expected more than 0 and less than {FASTEST_MPS:g}")
    drive, sway, angle = _balance(helm, speed, _engine_order(helm, speed))
    helm.check(drive, angle)
    tilt = 1e-3
    right, left = (helm.acceleration((speed, sway, 0.0), drive, angle + side * tilt)[2] for side in (1, -1))
    steers = abs(right - left) > 1e-12 * (abs(right) + abs(left)) and right != left
    return Approach(
        helm=helm,
        drive=drive,
        angle_rad=angle,
        starboard=(1 if right > left else -1) if steers else 0,
        velocity=np.array([speed, sway, 0.0]),
    )


def service_speed(vessel: Vessel) -> float:
    """Steady surge speed ahead [m/s] in calm water at 85 % of the engines' power (`SERVICE_SHARE` of their speed).

    Raises:
        InputError: the model has no steady speed there.
    """
    helm = Helm(vessel=vessel)

    def gain(speed: float) -> float:
        return helm.acceleration((speed, 0.0, 0.0), SERVICE_SHARE, 0.0)[0]

    first, *speeds = np.linspace(0.0, FASTEST_MPS, 601).tolist()
    low, before = first, gain(first)
    for high in speeds:  # up to the first that is too high
        after = gain(high)
        if before > 0 >= after:
            return float(scipy.optimize.brentq(gain, low, high, xtol=1e-12))
        low, before = high, after
    raise InputError(
        f"vessel {vessel.name!r}: the model has no steady speed below {FASTEST_MPS:g} m/s at 85 % power: "
        f"du/dt is {gain(first):.3g} m/s2 at rest; give the approach speed"
    )


def _share(limit: Limit, drive: Any, ops: Operators = SCALAR) -> Any:
    ahead, astern = (drive + ops.abs(drive)) / 2, (drive - ops.abs(drive)) / 2
    return limit.high * ahead + abs(limit.low) * astern


def _engine_order(helm: Helm, speed: float) -> float:
    def gain(drive: float) -> float:
        return helm.acceleration((speed, 0.0, 0.0), drive, 0.0)[0]

    idle, full = gain(0.0), gain(1.0)
    named = f"vessel {helm.vessel.name!r} cannot hold {speed:g} m/s"
    if full < -STEADY * speed:
        reached = _fastest(helm, speed)
        raise SpeedOutOfReach(
            f"{named}: it loses {-full:.3g} m/s2 at full ahead and reaches {reached:.4g} m/s; choose another speed",
            reached_mps=reached,
        )
    if idle > STEADY * speed:
        raise InputError(f"{named}: it gains {idle:.3g} m/s2 without thrust; choose another speed")
    if idle * full >= 0:
        return 0.0 if abs(idle) <= abs(full) else 1.0
    return float(scipy.optimize.brentq(gain, 0.0, 1.0, xtol=1e-14))


def _fastest(helm: Helm, below: float) -> float:
    """The largest steady speed under one that full ahead does not hold [m/s], 0 where there is none."""

    def gain(speed: float) -> float:
        return helm.acceleration((speed, 0.0, 0.0), 1.0, 0.0)[0]

    grid = np.linspace(below, 0.0, 101)
    for high, low in pairwise(grid.tolist()):
        if gain(low) > 0:
            return float(scipy.optimize.brentq(gain, low, high, xtol=1e-12))
    return 0.0


def _balance(helm: Helm, speed: float, drive: float) -> tuple[float, float, float]:
    """Engine order, sway speed and helm of the straight course, from the engine order of a symmetric vessel."""
    if max(map(abs, helm.acceleration((speed, 0.0, 0.0), drive, 0.0)[1:])) <= STEADY * speed:
        return drive, 0.0, 0.0
    sways = "v" in helm.vessel.model.outputs

    def excess(x: Array) -> list[float]:
        surge, sway, yaw = helm.acceleration((speed, x[2] if sways else 0.0, 0.0), x[0], x[1])
        return [surge, yaw, sway] if sways else [surge, yaw]

    found = scipy.optimize.root(excess, [drive, 0.0, 0.0][: 3 if sways else 2], tol=1e-14)
    if max(map(abs, excess(found.x))) > STEADY * speed or not 0 <= found.x[0] <= 1:
        raise InputError(f"vessel {helm.vessel.name!r} has no helm that holds a straight course at {speed:g} m/s")
    return float(found.x[0]), float(found.x[2]) if sways else 0.0, float(found.x[1])
