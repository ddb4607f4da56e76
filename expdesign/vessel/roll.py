"""Roll of a vessel, in one of two ways: a mode that acts back on sway and yaw, or a pendulum that does not.

`Roll`, [model.roll], is roll that is not measured: one lightly damped mode, driven by the side acceleration.

    phi'' + 2 zeta w0 phi' + w0^2 phi = w0^2 a_y       w0 = 2 pi / period
    dv/dt = Y(u, v, r, ...) + Y_phi phi                a_y = Y(u, v, r, ...) + u r
    dr/dt = N(u, v, r, ...) + N_phi phi

Y and N are the model's terms. Roll is counted in the side acceleration a_y [m/s^2] that would hold it for long, as data
without roll do not determine its angle; with the angle phi_0 that 1 m/s^2 holds, Y_phi / phi_0 is per radian. At rest
and on a straight course roll is zero.

`RollPendulum`, [roll], has masses, places and loads of a ship whose path is that of the model's terms alone:

    A1 phi'' = -(k + g S1) phi - d phi' + (K_vd + S1) a_y + K_r r + K_delta delta          a_y = dv/dt + u r
    A1 = A_x + I_m + M (z_g + z_f)^2 + m (z_m + z_f)^2          S1 = M (z_g + z_f) + m (z_m + z_f)

with masses M of the ship and m of a load, at z [m] down from a body origin, so that -z is a height, and the rotation
axis z_f above it; a mass at z is z + z_f below the axis. An accelerometer reads a_s = z_s phi'' + g phi - a_y to port.
K_r and K_delta hold for one speed.

Source: K. Son and K. Nomoto, Journal of the Society of Naval Architects of Japan 150 (1981), 232-244; T. Perez and
M. Blanke, Mathematical Ship Modelling for Control Applications (2002), for the linear roll mode and its coupling terms;
doctoral thesis on grey-box identification of ship roll with few sensors, (4.7), (5.8)-(5.21), for the pendulum.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from expdesign.errors import InputError
from expdesign.waves import G_MPS2 as G_MPS2
from expdesign.waves import Waves


@dataclass(frozen=True, kw_only=True)
class Load:
    """A mass on board beside the ship's own."""

    mass_kg: float  # not negative
    z_m: float  # of its centre, down from the body origin [m]
    inertia_kgm2: float = 0.0  # about its own centre

    def __post_init__(self) -> None:
        for name in ("mass_kg", "inertia_kgm2"):
            if not 0 <= getattr(self, name) < math.inf:
                raise InputError(f"load.{name} is {getattr(self, name):g}, expected 0 or more")
        if not math.isfinite(self.z_m):
            raise InputError(f"load.z_m is {self.z_m:g}, expected a finite place")


NOMINAL = Load(mass_kg=0.0, z_m=0.0)  # no load besides the ship


@dataclass(frozen=True, kw_only=True)
class Body:
    """What is known of the ship without load: from scales, a tilting test and a ruler."""

    mass_kg: float  # M, positive
    z_g: float  # of its centre of mass, down from the body origin [m]
    z_s: float  # of the accelerometer, down [m]: from the body origin, or from the rotation axis
    sensor_from_axis: bool = False  # z_s is counted from the rotation axis, which somebody has located
    forward_m: float = 0.0  # the sensor before the axis of yaw, whose yaw acceleration it reads
    # of the sensor, its bow end up: its gyros mix roll and yaw; None where nobody measured it, and it counts as level
    tilt_rad: float | None = None

    def __post_init__(self) -> None:
        if not 0 < self.mass_kg < math.inf:
            raise InputError(f"body.mass_kg is {self.mass_kg:g}, expected more than 0")
        for name in ("z_g", "z_s", "forward_m", "tilt_rad"):
            if not math.isfinite(getattr(self, name) or 0.0):
                raise InputError(f"body.{name} is {getattr(self, name):g}, expected a finite place")

    def sensor(self, z_f: float) -> float:
        """Accelerometer, down from the rotation axis [m]."""
        return self.z_s if self.sensor_from_axis else self.z_s + z_f


def first_moment(body: Body, load: Load, z_f: float = 0.0) -> float:
    """S1 = M z_g + m z_m about the rotation axis [kg m]; negative for a ship whose masses lie above it."""
    return body.mass_kg * (body.z_g + z_f) + load.mass_kg * (load.z_m + z_f)


def axis_inertia(own: float, body: Body, load: Load, z_f: float = 0.0) -> float:
    """I1 = I_x + M z_g^2 + I_xm + m z_m^2 about the rotation axis [kg m2]; A1 where `own` has the added inertia."""
    return own + load.inertia_kgm2 + body.mass_kg * (body.z_g + z_f) ** 2 + load.mass_kg * (load.z_m + z_f) ** 2


def sensed_inertia(own: float, body: Body, load: Load, z_f: float = 0.0) -> float:
    """I2 = I1 - z_s S1, the inertia in the equation that reads the accelerometer [kg m2]."""
    return axis_inertia(own, body, load, z_f) - body.sensor(z_f) * first_moment(body, load, z_f)


@dataclass(frozen=True, kw_only=True)
class Roll:
    """The mode."""

    period_s: float  # of the undamped oscillation [s], positive
    damping_ratio: float  # zeta, not negative
    Y_phi: float  # sway acceleration per unit of roll, a pure number
    N_phi: float  # yaw acceleration per unit of roll [rad/m]
    # roll angle that a side acceleration of 1 m/s2 to starboard holds for long, positive to starboard, negative for a
    # ship that heels outwards; 0 where unknown, so that roll is not measured
    heel_rad_per_mps2: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.period_s < math.inf:
            raise InputError(f"roll.period_s is {self.period_s:g}, expected more than 0")
        if not 0 <= self.damping_ratio < math.inf:
            raise InputError(f"roll.damping_ratio is {self.damping_ratio:g}, expected 0 or more")
        if not math.isfinite(self.heel_rad_per_mps2):
            raise InputError(f"roll.heel_rad_per_mps2 is {self.heel_rad_per_mps2:g}, expected a finite number")

    def rates(self, plain: tuple[Any, ...], turning: Any, roll: tuple[Any, ...]) -> tuple[Any, ...]:
        """d/dt of (u, v, r, roll, roll rate).

        Args:
            plain: d/dt of (u, v, r) by the model's terms.
            turning: u r [m/s2], of the motion over ground.
            roll: roll and its rate; neither for a calculation without roll.

        Raises:
            InputError: there are none.
        """
        if not roll:
            raise InputError(NOT_FOLLOWED)
        surge, sway, yaw = plain
        angle, rate = roll
        w0 = 2 * math.pi / self.period_s
        lean = w0 * w0 * (sway + turning - angle) - 2 * self.damping_ratio * w0 * rate
        return surge, sway + self.Y_phi * angle, yaw + self.N_phi * angle, rate, lean

    def standing(self, plain: tuple[Any, ...], turning: Any) -> tuple[Any, ...]:
        """d/dt of (u, v, r) by the model's terms and a roll that stands where the side acceleration holds it."""
        surge, sway, yaw = plain
        angle = sway + turning
        return surge, sway + self.Y_phi * angle, yaw + self.N_phi * angle


NOT_FOLLOWED = (
    "the vessel's model has a roll mode, [model.roll], which this calculation does not support; expected a vessel "
    "file without it"
)
ROLL_PARAMETERS = ("k", "A_x", "d", "K_r", "K_vd", "K_delta", "z_f")
"""Names of a pendulum's parameters; see `roll.MEANINGS` and `roll.UNITS`."""
NOT_ACTING_BACK = (
    "Roll, [roll] of the vessel file, is left out here: it does not act back on the ship's path, so that results are "
    "those without it. The commands diagnose and monitor judge it; roll estimates it."
)


@dataclass(frozen=True, kw_only=True)
class RollPendulum:
    """The pendulum, with what is known of its parameters."""

    body: Body  # mass and places of the ship without load
    load: Load = NOMINAL  # on board
    parameters: Mapping[str, float] = field(hash=False)  # value of each of `ROLL_PARAMETERS`
    # standard deviations; 0, for known, where there is none
    parameter_std: Mapping[str, float] = field(default_factory=dict, hash=False)
    # of pairs of them, by their names; 0 where there is none
    parameter_correlation: Mapping[tuple[str, str], float] = field(default_factory=dict, hash=False)
    waves: Waves | None = None  # that roll the ship in simulated trials; None for still water
    heel_max_rad: float = math.inf  # that plans keep to, infinite for none

    def __post_init__(self) -> None:
        if set(self.parameters) != set(ROLL_PARAMETERS):
            raise InputError(f"roll.parameters are {', '.join(self.parameters)}, expected {', '.join(ROLL_PARAMETERS)}")
        if not self.inertia_kgm2 > 0:
            raise InputError(f"roll has an inertia of {self.inertia_kgm2:g} kg m2, expected more than 0")

    @property
    def inertia_kgm2(self) -> float:
        """A1, about the rotation axis."""
        return axis_inertia(self.parameters["A_x"], self.body, self.load, self.parameters["z_f"])

    @property
    def moment_kgm(self) -> float:
        """S1, of the masses about the rotation axis."""
        return first_moment(self.body, self.load, self.parameters["z_f"])

    @property
    def righting_nm(self) -> float:
        """k + g S1 [N m/rad]; negative for a ship that does not stay upright."""
        return self.parameters["k"] + G_MPS2 * self.moment_kgm

    @property
    def metacentric_height_m(self) -> float:
        """Righting moment per angle over the weight of ship and load."""
        return self.righting_nm / (G_MPS2 * (self.body.mass_kg + self.load.mass_kg))

    @property
    def period_s(self) -> float:
        """Period of undamped roll; infinite for a ship that does not stay upright."""
        return 2.0 * math.pi * math.sqrt(self.inertia_kgm2 / self.righting_nm) if self.righting_nm > 0 else math.inf

    def acceleration(self, roll: Any, rate: Any, side: Any, yaw_rate: Any, rudder: Any) -> Any:
        """phi'' [rad/s2] from roll [rad], its rate, a_y [m/s2] to starboard, yaw rate and rudder [rad]."""
        of = self.parameters
        push = (of["K_vd"] + self.moment_kgm) * side + of["K_r"] * yaw_rate + of["K_delta"] * rudder
        return (push - self.righting_nm * roll - of["d"] * rate) / self.inertia_kgm2

    def reading(self, roll: Any, acceleration: Any, side: Any) -> Any:
        """a_s [m/s2] of the accelerometer, to port and with gravity in it, at small angles."""
        return self.body.sensor(self.parameters["z_f"]) * acceleration + G_MPS2 * roll - side
