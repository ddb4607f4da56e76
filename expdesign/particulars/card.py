"""What a pilot card or wheelhouse poster states of a ship, in SI units: particulars, and values measured in trials."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

WATER_KGPM3 = 1025.0
AIR_KGPM3 = 1.225

SCATTER = {
    "speed_mps": 0.03,
    "advance_m": 0.06,
    "transfer_m": 0.10,
    "tactical_diameter_m": 0.06,
    "time_90_s": 0.07,
    "time_180_s": 0.07,
    "speed_90_mps": 0.08,
    "speed_180_mps": 0.08,
    "overshoot_1_rad": 0.20,
    "overshoot_2_rad": 0.25,
    "reach_m": 0.12,
    "time_s": 0.12,
    "turn_90_s": 0.12,
    "drift_mps": 0.15,
}
"""Quantity -> how far repeated trials scatter, and a model of this kind misses them, as a standard deviation of the
logarithm. Circles and overshoots: what repetitions of the free-running benchmarks scatter, a few per cent of advance
and a fifth of an overshoot (SIMMAN 2008, Lyngby; ITTC 7.5-04-02-01); the rest is a judgement."""


@dataclass(frozen=True, kw_only=True)
class Hull:
    """Form and weight."""

    length_m: float  # between perpendiculars
    beam_m: float  # of one hull
    draught_m: float
    mass_kg: float  # displacement
    gravity_forward_m: float = 0.0  # centre of gravity ahead of midships
    hulls: int = 1  # 2 for a catamaran, each with that beam
    over_all_m: float | None = None  # beam over all hulls; None where there is one

    @property
    def block(self) -> float:
        """Block coefficient."""
        return self.mass_kg / (WATER_KGPM3 * self.hulls * self.length_m * self.beam_m * self.draught_m)

    @property
    def wetted_m2(self) -> float:
        """Wetted surface by Denny and Mumford, 1.7 L T + volume / T."""
        volume = self.mass_kg / WATER_KGPM3
        return self.hulls * 1.7 * self.length_m * self.draught_m + volume / self.draught_m


@dataclass(frozen=True, kw_only=True)
class Thruster:
    """A propeller, azimuth thruster, podded drive or tunnel thruster; None for what the card does not say."""

    kind: str  # "propeller", "azimuth", "podded" or "tunnel"
    forward_m: float  # of midships
    starboard_m: float = 0.0  # of the centre line
    diameter_m: float | None = None
    power_w: float | None = None  # on the shaft at full order
    max_rps: float | None = None  # shaft speed at full order ahead
    astern_share: float = 0.7  # of it, at full order astern
    pitch_ratio: float | None = None
    full_order_s: float = 20.0  # from stop to full ahead
    angle_max_rad: float | None = None  # to each side; it turns freely when None
    angle_rate_radps: float = math.radians(10.0)

    @property
    def drives(self) -> bool:
        """Whether it drives the ship ahead."""
        return self.kind != "tunnel"


@dataclass(frozen=True, kw_only=True)
class Rudder:
    """A rudder."""

    area_m2: float
    forward_m: float
    starboard_m: float = 0.0
    aspect_ratio: float = 1.6  # height squared by area
    angle_max_rad: float = math.radians(35.0)
    angle_rate_radps: float = math.radians(2.32)  # SOLAS II-1: 35 to 30 degrees on the other side in 28 s


@dataclass(frozen=True, kw_only=True)
class Windage:
    """Areas above the water."""

    frontal_m2: float
    lateral_m2: float
    centre_forward_m: float = 0.0  # of the lateral area, ahead of midships


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A standard trial, from a steady course."""

    kind: str  # "speed", "circle", "zigzag", "stop", "spin" or "drift"
    speed_mps: float = 0.0  # of the approach; of the wind for "drift"
    angle_rad: float = 0.0  # helm of a circle; heading and helm of a zig-zag
    order: float = 1.0  # engine order: of a speed, ahead; of a stop, astern, 0 for stopped engines


@dataclass(frozen=True, kw_only=True)
class Stated:
    """One number of the card."""

    trial: Trial
    quantity: str  # a key of `SCATTER`
    value: float  # positive, SI
    source: str  # the key in the card
    side: str = ""  # to which she turned, "starboard" or "port"; the model is the same to both


@dataclass(frozen=True, kw_only=True)
class Card:
    """A ship as her owner knows her."""

    name: str
    hull: Hull
    thrusters: tuple[Thruster, ...]
    rudders: tuple[Rudder, ...] = ()
    windage: Windage | None = None
    top_speed_mps: float | None = None  # at full order ahead
    stated: tuple[Stated, ...] = field(default=())
    silent: tuple[str, ...] = ()  # keys that it leaves out, "rudders[1].rate_degps", where others stand for them

    @property
    def drives(self) -> tuple[Thruster, ...]:
        """Thrusters that drive her ahead."""
        return tuple(thruster for thruster in self.thrusters if thruster.drives)
