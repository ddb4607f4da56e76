"""Coupled inertia of sway and yaw, as of a ship whose centre of gravity is not at the origin of the b-frame.

    [ sway_kg       sway_yaw_kgm ] [ dv/dt ]   [ sway_kg   Y(u, v, r, ...) ]
    [ yaw_sway_kgm  yaw_kgm2     ] [ dr/dt ] = [ yaw_kgm2  N(u, v, r, ...) ]

Y and N are what the model's terms say: the accelerations were there no coupling. For a rigid body of mass m with added
mass and its centre of gravity x_g ahead of midships, the four numbers are m - Y_dv, m x_g - Y_dr, m x_g - N_dv and
I_z - N_dr, with I_z about midships. Coriolis forces are terms: m x_g r^2 in surge, m u r in sway, m x_g u r in yaw. The
accelerations stay linear in the parameters, as the matrix is known from the vessel file.

Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2011), (6.41)-(6.44).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from expdesign.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Inertia:
    """The matrix.

    Attributes:
        sway_kg: mass with added mass in sway [kg], positive.
        yaw_kgm2: moment of inertia with added inertia in yaw, about midships [kg m2], positive.
        sway_yaw_kgm: sway force per yaw acceleration [kg m].
        yaw_sway_kgm: yaw moment per sway acceleration [kg m]; None where it is the same.
    """

    sway_kg: float
    yaw_kgm2: float
    sway_yaw_kgm: float
    yaw_sway_kgm: float | None = None

    def __post_init__(self) -> None:
        for name in ("sway_kg", "yaw_kgm2"):
            if not 0 < getattr(self, name) < math.inf:
                raise InputError(f"inertia.{name} is {getattr(self, name):g}, expected more than 0")
        if not self._determinant > 0:
            raise InputError(
                f"inertia.sway_yaw_kgm is {self.sway_yaw_kgm:g}, expected a product with the other coupling of less "
                f"than sway_kg times yaw_kgm2, {self.sway_kg * self.yaw_kgm2:g}"
            )

    @property
    def arm_m(self) -> float:
        """Sway acceleration per yaw acceleration [m], but for the sign."""
        return self.sway_yaw_kgm / self.sway_kg

    @property
    def turn_per_m(self) -> float:
        """Yaw acceleration per sway acceleration [rad/m], but for the sign."""
        return (self.sway_yaw_kgm if self.yaw_sway_kgm is None else self.yaw_sway_kgm) / self.yaw_kgm2

    @property
    def _determinant(self) -> float:
        return 1.0 - self.arm_m * self.turn_per_m

    def coupled(self, sway: Any, yaw: Any) -> tuple[Any, Any]:
        """dv/dt and dr/dt from those without coupling; numbers, arrays or symbols."""
        scale = 1.0 / self._determinant
        return scale * (sway - self.arm_m * yaw), scale * (yaw - self.turn_per_m * sway)

    def uncoupled(self, sway: Any, yaw: Any) -> tuple[Any, Any]:
        """The inverse of `coupled`."""
        return sway + self.arm_m * yaw, yaw + self.turn_per_m * sway


NOT_SUPPORTED = (
    "the vessel's model has coupled inertia, [model.inertia], which {what} does not support; expected a vessel file "
    "without that table"
)
