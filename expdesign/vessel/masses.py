"""Load cases: what lies where on the ship, and the sums that its roll equation holds.

Places are in the b-frame, z down, from a body-fixed origin; -z is a height. The rotation axis lies z_f above that
origin, so that a mass at z is z + z_f below the axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from expdesign.errors import InputError
from expdesign.waves import G_MPS2 as G_MPS2


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


NOMINAL = Load(mass_kg=0.0, z_m=0.0)
"""No load besides the ship."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """What is known of the ship without load: from scales, a tilting test and a ruler."""

    mass_kg: float  # M, positive
    z_g: float  # of its centre of mass, down from the body origin [m]
    z_s: float  # of the accelerometer, down [m]: from the body origin, or from the rotation axis
    sensor_from_axis: bool = False  # z_s is counted from the rotation axis, which somebody has located
    forward_m: float = 0.0  # the sensor before the axis of yaw, whose yaw acceleration it reads
    tilt_rad: float = 0.0  # of the sensor, its bow end up: its gyros mix roll and yaw

    def __post_init__(self) -> None:
        if not 0 < self.mass_kg < math.inf:
            raise InputError(f"body.mass_kg is {self.mass_kg:g}, expected more than 0")
        for name in ("z_g", "z_s", "forward_m", "tilt_rad"):
            if not math.isfinite(getattr(self, name)):
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
