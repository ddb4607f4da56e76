"""Inclining and roll-decay tests: a shifted mass heels the ship, and tells her metacentric height and roll inertia.

    tan phi = m y / (D GM)          GM = m y / (D tan phi)          D = M + m
    I = D g GM (T / 2 pi)^2

with the displaced mass D, which includes the shifted mass m, a shift y across the ship, and the period T of undamped
roll. A mass raised by h lowers GM by m h / D.

In waves, beam on at rest, roll phi of the slope s of the waves is

    phi(w) = D g GM / (D g GM - I w^2 + i d w) s(w)

and its mean over a time t keeps the share (sin(w t / 2) / (w t / 2))^2 of its density.

Source: IMO, Intact Stability Code (2008), annex 1, for the inclining test; E. V. Lewis (ed.), Principles of Naval
Architecture (1988), volume I, for its errors; A. Papoulis, Probability, Random Variables, and Stochastic Processes
(1991), 13.1, for means over a time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from expdesign.errors import InputError
from expdesign.values import Array
from expdesign.vessel import RollPendulum
from expdesign.vessel.roll import G_MPS2

MOST_HEEL_RAD = math.radians(10.0)
"""Beyond which righting moments are not those of the metacentric height; rules ask for 4 degrees at most."""


def heel_of_shift(*, mass_kg: float, shift_m: float, displacement_kg: float, metacentric_height_m: float) -> float:
    """Heel [rad] of a mass shifted across the ship; positive towards it."""
    return math.atan2(mass_kg * shift_m, displacement_kg * metacentric_height_m)


@dataclass(frozen=True, kw_only=True)
class Inclining:
    """What a test tells."""

    heel_rad: float  # of the shift
    metacentric_height_std_m: float  # of the height from the heel
    inertia_kgm2: float  # about the axis, added inertia included
    inertia_std_kgm2: float  # from the height and the period; infinite without a decay


def inclining(
    *, mass_kg: float, shift_m: float, displacement_kg: float, metacentric_height_m: float, period_s: float,
    heel_std_rad: float, period_std_s: float = math.inf, shifts: int = 1,
) -> Inclining:  # fmt: skip
    """Standard deviations of metacentric height and inertia by shifts of a known mass and a decay, errors small.

    GM = m y / (D tan phi), so that dGM = -GM / (sin phi cos phi) dphi; I is proportional to GM T^2.

    Args:
        mass_kg, shift_m: of the test, known exactly.
        displacement_kg: of the ship with the mass.
        metacentric_height_m: as believed.
        period_s: of undamped roll, as believed.
        heel_std_rad: of one reading of the change of heel.
        period_std_s: of the period of the decay; infinite without one.
        shifts: how often the mass is shifted and heel read, each with an error of its own.

    Raises:
        InputError: a quantity is not positive, the mass is not a part of the ship, or the heel is too large.
    """
    given = {
        "mass_kg": mass_kg, "shift_m": shift_m, "displacement_kg": displacement_kg, "period_s": period_s,
        "metacentric_height_m": metacentric_height_m, "heel_std_rad": heel_std_rad, "shifts": shifts,
        "period_std_s": period_std_s,
    }  # fmt: skip
    for name, value in given.items():
        if not (0 < value < math.inf or (name == "period_std_s" and value == math.inf)):
            raise InputError(f"{name} is {value:g}, expected more than 0")
    if not mass_kg < displacement_kg:
        raise InputError(f"mass_kg is {mass_kg:g}, expected a weight on board, of less than all {displacement_kg:g} kg")
    heel = heel_of_shift(
        mass_kg=mass_kg, shift_m=shift_m, displacement_kg=displacement_kg, metacentric_height_m=metacentric_height_m
    )
    if heel > MOST_HEEL_RAD:
        raise InputError(
            f"{mass_kg:g} kg shifted by {shift_m:g} m heel the ship by {math.degrees(heel):.0f} degrees, expected "
            f"{math.degrees(MOST_HEEL_RAD):.0f} or less, up to which the heel follows from the metacentric height"
        )
    height_share = heel_std_rad / math.sqrt(shifts) / (math.sin(heel) * math.cos(heel))
    inertia = displacement_kg * G_MPS2 * metacentric_height_m * (period_s / (2.0 * math.pi)) ** 2
    return Inclining(
        heel_rad=heel,
        metacentric_height_std_m=metacentric_height_m * height_share,
        inertia_kgm2=inertia,
        inertia_std_kgm2=inertia * math.hypot(height_share, 2.0 * period_std_s / period_s),
    )


WAVE_FREQUENCIES = 2000
"""Even steps of frequency up to three times that of the peak, beyond which waves are not counted."""


def heel_in_waves(pendulum: RollPendulum, read_s: float) -> tuple[float, float]:
    """Roll by the waves of the vessel file, beam on at rest [rad rms], and what is left of it in a mean over a time.

    Args:
        pendulum: of a ship that stays upright.
        read_s: time over which heel is averaged; 0 for a reading in a moment.

    Raises:
        InputError: read_s is negative.
    """
    if not 0 <= read_s < math.inf:
        raise InputError(f"read_s is {read_s:g}, expected 0 or more")
    if pendulum.waves is None:
        return 0.0, 0.0
    highest = 3.0 * 2.0 * math.pi / pendulum.waves.period_s
    w: Array = np.linspace(0.0, highest, WAVE_FREQUENCIES + 1)[1:]
    beam_on = 2.0 * pendulum.waves.met_density(w, 0.0)  # which is that of all courses alike
    righting = pendulum.righting_nm
    gain = np.abs(righting / (righting - pendulum.inertia_kgm2 * w**2 + 1j * pendulum.parameters["d"] * w))
    density = gain**2 * beam_on
    kept = np.sinc(w * read_s / (2.0 * math.pi)) ** 2
    return math.sqrt(float(density.sum() * w[0])), math.sqrt(float(density @ kept * w[0]))
