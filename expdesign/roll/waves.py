"""Waves as a ship meets them, filters that shape noise like them, and Froude's scaling between model and ship.

Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2011), chapter 8, for
the JONSWAP spectrum, encounter and shaping filters; DNV-RP-C205 (2010), 3.5.5, for the spectrum's level at any gamma.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.errors import InputError
from expdesign.values import Array
from expdesign.vessel.masses import G_MPS2


@dataclass(frozen=True, kw_only=True)
class Jonswap:
    """A sea.

    Attributes:
        height_m: significant wave height.
        peak_radps: frequency of the peak.
        gamma: its sharpness, 1 to 7.
    """

    height_m: float
    peak_radps: float
    gamma: float = 3.3

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < np.inf:
                raise InputError(f"jonswap.{name} is {value:g}, expected more than 0")
        if not 1 <= self.gamma <= 7:
            raise InputError(f"jonswap.gamma is {self.gamma:g}, expected 1 to 7")

    def density(self, frequency_radps: Array) -> Array:
        """One-sided spectral density [m2 s/rad] at frequencies (k,) above zero."""
        w, w0 = np.asarray(frequency_radps), self.peak_radps
        width = np.where(w < w0, 0.07, 0.09)
        peak = np.exp(-(((w - w0) / (np.sqrt(2.0) * w0 * width)) ** 2))
        level = 5.0 / 16.0 * (1.0 - 0.287 * np.log(self.gamma)) * self.height_m**2  # 0.2 H^2 for gamma = 3.3
        return np.asarray(level * w0**4 * w**-5.0 * np.exp(-1.25 * (w0 / w) ** 4) * self.gamma**peak)


def encounter(frequency_radps: Array, *, speed_mps: float, heading_rad: float) -> Array:
    """Frequency at which a ship meets waves [rad/s].

    Args:
        frequency_radps: of the waves, seen from a fixed place.
        speed_mps: of the ship.
        heading_rad: of the waves relative to the ship's course, 0 for a following sea.
    """
    w = np.asarray(frequency_radps)
    return np.asarray(np.abs(w - w**2 * (speed_mps / G_MPS2) * np.cos(heading_rad)))


def shaping_filter(peak_radps: float, *, damping: float, std: float = 1.0) -> tuple[Array, Array]:
    """Numerator and denominator (3,) in p of K p / (p^2 + 2 zeta w p + w^2), for white noise of unit density.

    The output has the standard deviation `std`, and its spectrum its peak at `peak_radps`.
    """
    w, zeta = peak_radps, damping
    return np.array([0.0, 2.0 * std * np.sqrt(zeta * w), 0.0]), np.array([1.0, 2.0 * zeta * w, w * w])


POWERS = {
    "length": 1.0, "time": 0.5, "speed": 0.5, "angle": 0.0, "mass": 3.0, "force": 3.0, "moment": 4.0, "inertia": 5.0,
}  # fmt: skip
"""Quantity -> power of the scale in Froude's law."""


def froude_factor(quantity: str, scale: float, *, density_ratio: float = 1.0) -> float:
    """What a model's quantity is multiplied by for the ship.

    Args:
        quantity: a key of `POWERS`.
        scale: ship length by model length.
        density_ratio: of the water around the ship by that around the model.

    Raises:
        InputError: no such quantity, or a scale that is not positive.
    """
    if quantity not in POWERS:
        raise InputError(f"quantity is {quantity!r}, expected one of {', '.join(POWERS)}")
    if not scale > 0 or not density_ratio > 0:
        raise InputError(f"scale is {scale:g} and density_ratio {density_ratio:g}, expected more than 0")
    heavy = quantity in ("mass", "force", "moment", "inertia")
    return float(scale ** POWERS[quantity] * (density_ratio if heavy else 1.0))
