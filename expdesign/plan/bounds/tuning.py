"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Bounds on repositioning time.

    Attributes:
        sides: of the polygon that contains a track.
    """

    sides: int = 24


BOUNDS = Tuning()
