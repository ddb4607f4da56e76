"""One helm and one engine order for any vessel, and the steady run ahead that standard trials begin with.

The helm turns all rudders together. A vessel without rudders steers with the common angle of its azimuth thrusters:
those abaft amidships, or all where none is. A vessel known only by generalised forces steers as if one thruster at its
stern, half a length abaft amidships, gave all of its thrust. One with fixed propellers on both sides and nothing else
to steer with lets them turn at different speeds.

Azimuth thrusters whose propellers do not reverse go astern as a mate lets them: the engines stop, the thrusters turn
half round, each by its own side, and the engines go on.
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
from expdesign.values import Array, sealed
from expdesign.vessel import NUMPY, SCALAR, Actuator, Limit, Operators, Vessel

SERVICE_SHARE = 0.85 ** (1 / 3)
"""Propeller speed at 85 % of the largest power, as a share of the largest, as power goes with its cube."""
FASTEST_MPS = 60.0
HARD_OVER_RAD = math.radians(35.0)
HALF_TURN = math.pi
AT_ONCE = 1e6  # change of the engine order per second that counts as one at once
STEADY = 1e-9  # share of its speed that a steady vessel may gain or lose in a second


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
            drive: engine order from -1, full astern, to 1, full ahead: the share of each actuator's limit. Thrusters
                that turn round for orders astern stand there.
            angle_rad: helm, in the sense of the actuators' own angles; where propellers steer, its sine is added to the
                engine orders to port and taken from those to starboard, as far as there is any left.
        """
        return self._row(drive, angle_rad, SCALAR)

    def rows(self, drive: Array, angle_rad: Array) -> Array:
        """(..., m) inputs for orders (...,) and angles (...,)."""
        return _stacked(self._row(drive, angle_rad, NUMPY), drive + angle_rad)

    def moved_rows(self, lever: Array, angle_rad: Array) -> Array:
        """(..., m) inputs for levers (...,) and angles (...,), also while orders change; see `lever`."""
        return _stacked(self._moved(lever, angle_rad, NUMPY), lever + angle_rad)

    def moved(self, lever: float, angle_rad: float) -> list[float]:
        """Commands in the model's order for a lever, also while orders change; see `lever`."""
        return self._moved(lever, angle_rad, SCALAR)

    def _moved(self, lever: Any, angle_rad: Any, ops: Operators) -> list[Any]:
        way, astern = self._lever_round, lever + self._lever_round
        share = (ops.abs(lever) - ops.abs(astern) + way) / (2 * way) if way else lever < 0.0
        drive = (lever + ops.abs(lever)) / 2 + (astern - ops.abs(astern)) / 2
        return self._row(drive, angle_rad, ops, round_share=share)

    def lever(self, drive: Any) -> Any:
        """Engine order as a lever whose way from ahead to astern takes in the time in which thrusters turn round.

        It moves by `lever_rate` per second: ahead it is the order; between 0 and `-_lever_round` thrusters turn.
        """
        return drive - self._lever_round * (drive < 0.0)

    def followed(self, drive: Array, angle_rad: Array, steps_s: Array, *, before: float) -> Array:
        """(k, m) commands after steps (k,) of time to orders (k,) and angles (k,), thrusters turning as they can.

        Where none turns round they are the `rows` of the orders, whose rates are left to others.

        Args:
            drive, angle_rad, steps_s: see above.
            before: engine order that stands before the first step, ahead.
        """
        if not self.turning_round or not (drive < 0.0).any():
            return self.rows(drive, angle_rad)
        levers, lever = [], before
        for goal, reach in zip(self.lever(drive).tolist(), (self.lever_rate * steps_s).tolist(), strict=True):
            lever += min(max(goal - lever, -reach), reach)
            levers.append(lever)
        return self.moved_rows(np.array(levers), angle_rad)

    @cached_property
    def lever_rate(self) -> float:
        """Largest change of the lever per second."""
        return min(self.drive_rate, AT_ONCE) if self.turning_round else self.drive_rate

    @cached_property
    def _lever_round(self) -> float:
        """Way of the lever on which thrusters turn round; 0 where none does, or they do at once."""
        slowest = min((one.responses[1].rate for one in self.turning_round), default=math.inf)
        return self.lever_rate * HALF_TURN / slowest if self.turning_round else 0.0

    @cached_property
    def turning_round(self) -> dict[Actuator, float]:
        """The azimuth thrusters that turn round for orders astern, with the angle by which they do [rad]."""
        found: dict[Actuator, float] = {}
        for one in self.vessel.actuators:
            if one.kind == "azimuth" and not one.limits[0].low < 0.0:
                own = math.copysign(HALF_TURN, one.starboard_m)
                ways = [way for way in (own, -own) if one.limits[1].low <= way <= one.limits[1].high]
                if ways:
                    found[one] = ways[0]
        return found

    def stands_astern(self, inputs: Array) -> np.ndarray:
        """(n,) whether thrusters that turn round for orders astern stand there in commands (n, m)."""
        stands = [np.cos(inputs[:, self._columns[one][1]]) < 0.0 for one in self.turning_round]
        return np.asarray(np.any(stands, axis=0)) if stands else np.zeros(len(inputs), dtype=bool)

    def turned_back(self, inputs: Array) -> Array:
        """Commands (n, m) with thrusters that stand astern turned back as they came."""
        rows, astern = inputs.copy(), self.stands_astern(inputs)
        for one, way in self.turning_round.items():
            rows[astern, self._columns[one][1]] -= way
        return rows

    def idle_in_turns(self, rows: Array, standing: Array) -> Array:
        """Commands (n, m) without the thrust of thrusters more than a quarter turn off where they stand (n, m)."""
        rows = rows.copy()
        for one in self.turning_round:
            thrust, angle = self._columns[one]
            rows[np.cos(rows[:, angle] - standing[:, angle]) < 0.0, thrust] = 0.0
        return rows

    @cached_property
    def _columns(self) -> dict[Actuator, tuple[int, ...]]:
        """Columns of each actuator's signals in commands."""
        names = self.vessel.model.inputs
        return {one: tuple(names.index(name) for name in one.signals) for one in self.vessel.actuators}

    def _row(self, drive: Any, angle_rad: Any, ops: Operators, *, round_share: Any = None) -> list[Any]:
        """Commands; thrusters are turned round by a share of their way, or all of it where the order is astern."""
        row: list[Any] = []
        steering, by_propellers = self.steering, self.means == "propeller"
        share = drive < 0.0 if round_share is None else round_share
        for actuator in self.vessel.actuators:
            turned, order = angle_rad if actuator in steering else 0.0, drive
            if by_propellers and actuator in steering:
                desired = drive - float(np.sign(actuator.starboard_m)) * ops.sin(turned)
                order = (ops.abs(desired + 1.0) - ops.abs(desired - 1.0)) / 2  # no more than there is to either side
            if actuator in self.turning_round:
                turned, order = turned + share * self.turning_round[actuator], ops.abs(order)
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
        limit, thrust = actuator.limits[0], inputs[:, self._columns[actuator][0]]
        if actuator in self.turning_round:
            return np.asarray(np.where(self.stands_astern(inputs), -1.0, 1.0) * thrust / max(limit.high, 1e-300))
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


@sealed(velocity="3")
class Approach:
    """A steady run straight ahead in calm water."""

    helm: Helm  # how the vessel is steered
    drive: float  # engine order that holds the speed
    angle_rad: float  # helm that holds the course; 0 for a symmetric vessel
    starboard: int  # +1 or -1: sign of a change of helm that turns the vessel to starboard, 0 where nothing does
    velocity: Array  # (3,) u, v, r through water, r = 0

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


def _stacked(row: list[Any], like: Array) -> Array:
    """(..., m) commands, each the same for all or of the shape (...,) of an array."""
    return np.stack(np.broadcast_arrays(*row, like)[:-1], axis=-1)


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
