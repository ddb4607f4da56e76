"""Roll that is not measured: one lightly damped mode, driven by the side acceleration, that pushes sway and yaw.

    phi'' + 2 zeta w0 phi' + w0^2 phi = w0^2 a_y       w0 = 2 pi / period
    dv/dt = Y(u, v, r, ...) + Y_phi phi                a_y = Y(u, v, r, ...) + u r
    dr/dt = N(u, v, r, ...) + N_phi phi

Y and N are the model's terms. Roll is counted in the side acceleration a_y [m/s^2] that would hold it for long, as data
without roll do not determine its angle; with the angle phi_0 that 1 m/s^2 holds, Y_phi / phi_0 is per radian. At rest
and on a straight course roll is zero.

Source: K. Son and K. Nomoto, Journal of the Society of Naval Architects of Japan 150 (1981), 232-244; T. Perez and
M. Blanke, Mathematical Ship Modelling for Control Applications (2002), for the linear roll mode and its coupling terms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from expdesign.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Roll:
    """The mode.

    Attributes:
        period_s: of the undamped oscillation [s], positive.
        damping_ratio: zeta, not negative.
        Y_phi: sway acceleration per unit of roll, a pure number.
        N_phi: yaw acceleration per unit of roll [rad/m].
        heel_rad_per_mps2: roll angle that a side acceleration of 1 m/s2 to starboard holds for long, positive to
            starboard, negative for a ship that heels outwards; 0 where unknown, so that roll is not measured.
    """

    period_s: float
    damping_ratio: float
    Y_phi: float
    N_phi: float
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
