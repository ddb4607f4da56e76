"""Waves as a ship meets them, and Froude's scaling between model and ship.

Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2011), chapter 8, for
the JONSWAP spectrum, encounter and shaping filters; DNV-RP-C205 (2010), 3.5.5, for the spectrum's level at any gamma;
E. V. Lewis (ed.), Principles of Naval Architecture (1989), volume III, for roll by the effective slope of waves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.errors import InputError
from expdesign.values import Array

G_MPS2 = 9.81  # gravity, as everywhere in calculations of roll and waves [m/s2]


@dataclass(frozen=True, kw_only=True)
class Jonswap:
    """A sea."""

    height_m: float  # significant wave height
    peak_radps: float  # frequency of the peak
    gamma: float = 3.3  # its sharpness, 1 to 7

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
        heading_rad: of the waves relative to the ship's course, 0 for a following sea.
    """
    w = np.asarray(frequency_radps)
    return np.asarray(np.abs(w - w**2 * (speed_mps / G_MPS2) * np.cos(heading_rad)))


@dataclass(frozen=True, kw_only=True)
class Waves:
    """Long-crested waves that roll a ship by their slope across her; they do not sway or yaw her."""

    height_m: float  # significant wave height
    period_s: float  # of the spectrum's peak
    from_rad: float  # whence they come, clockwise from north
    gamma: float = 3.3  # sharpness of the peak, 1 to 7
    slope_share: float = 1.0  # of the slope at a point that acts on the hull, 0 to 1; less where the beam is not small

    def __post_init__(self) -> None:
        for name in ("height_m", "period_s"):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(f"waves.{name} is {getattr(self, name):g}, expected more than 0")
        if not 0 < self.slope_share <= 1:
            raise InputError(f"waves.slope_share is {self.slope_share:g}, expected more than 0, at most 1")
        if not 1 <= self.gamma <= 7:
            raise InputError(f"waves.gamma is {self.gamma:g}, expected 1 to 7")

    def slope(self, pose: Array, step_s: float, rng: np.random.Generator) -> Array:
        """(k,) slope [rad] across a ship with poses (k, 3) at the samples, positive where water rises to starboard.

        Encounter is in the poses. Components have random phases, and random frequencies in bands of equal width, so
        that nothing repeats.
        """
        edges = np.linspace(*self._reach, COMPONENTS + 1)
        w = edges[:-1] + np.diff(edges) * rng.random(COMPONENTS)
        number, to = w**2 / G_MPS2, self.from_rad + np.pi
        steep = self.slope_share * number * np.sqrt(2.0 * self._sea.density(w) * np.diff(edges))
        start = 2.0 * np.pi * rng.random(COMPONENTS)
        time = step_s * np.arange(len(pose))
        along = pose[:, 0] * np.cos(to) + pose[:, 1] * np.sin(to)
        rising = np.zeros(len(pose))
        for one in zip(w, number, steep, start, strict=True):
            rising += one[2] * np.sin(one[0] * time - one[1] * along + one[3])
        return np.asarray(np.sin(to - pose[:, 2]) * rising)

    def met_density(self, frequency_radps: Array, speed_mps: float) -> Array:
        """(f,) one-sided density [rad2 s/rad] of that slope as met at frequencies in even steps, all courses alike."""
        half = (frequency_radps[1] - frequency_radps[0]) / 2.0
        edges = np.append(frequency_radps - half, frequency_radps[-1] + half)
        w = np.linspace(*self._reach, 40 * COMPONENTS)
        power = self._sea.density(w) * (self.slope_share * w**2 / G_MPS2) ** 2 * (w[1] - w[0])
        courses = 2.0 * np.pi * (np.arange(COURSES) + 0.5) / COURSES
        met = [encounter(w, speed_mps=speed_mps, heading_rad=course) for course in courses]
        parts = [
            np.sin(course) ** 2 * np.histogram(one, edges, weights=power)[0]
            for course, one in zip(courses, met, strict=True)
        ]
        return np.asarray(np.mean(parts, axis=0) / (2.0 * half))

    @property
    def _sea(self) -> Jonswap:
        return Jonswap(height_m=self.height_m, peak_radps=2.0 * np.pi / self.period_s, gamma=self.gamma)

    @property
    def _reach(self) -> tuple[float, float]:
        """Frequencies [rad/s] that are counted with; shorter waves have little slope on a hull."""
        return 0.5 * 2.0 * np.pi / self.period_s, 3.0 * 2.0 * np.pi / self.period_s


COMPONENTS, COURSES = 200, 36  # number of drawn wave components, and of courses over which encounter is averaged
POWERS = {
    "length": 1.0, "time": 0.5, "speed": 0.5, "angle": 0.0, "mass": 3.0, "force": 3.0, "moment": 4.0, "damping": 4.5,
    "inertia": 5.0,
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
    heavy = quantity in ("mass", "force", "moment", "damping", "inertia")
    return float(scale ** POWERS[quantity] * (density_ratio if heavy else 1.0))
