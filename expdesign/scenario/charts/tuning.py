"""The tuning constants of the charts, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        largest_extent_km: of a sea area, so that a local frame holds it.
        area_rounding_deg2: area of rounding, for outlines of about one degree; a tenth of a square decimetre.
        wall_half_width_m: half the width given to walls and pontoons drawn as lines.
    """

    largest_extent_km: float = 250.0
    area_rounding_deg2: float = 1e-13
    wall_half_width_m: float = 1.0


TUNING = Tuning()
