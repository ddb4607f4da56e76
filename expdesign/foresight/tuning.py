"""Numbers that steer what is foreseen."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Numbers of this room."""

    told_apart: float = 0.5  # probability below which two causes count as not told apart


TUNING = Tuning()
