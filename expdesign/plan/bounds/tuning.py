"""Numbers of this package that are chosen, not derived, and that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Bounds on repositioning time."""

    sides: int = 24  # of the polygon that contains a track


BOUNDS = Tuning()
