"""Tuning constants of step trials that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived."""

    constant_share: float = 0.02  # of a command's range, within which it counts as held
    # least_hold_s, least_hold_samples: shorter holds belong to the change of command that follows
    least_hold_s: float = 3.0
    least_hold_samples: int = 6
    memory_share: float = 0.6  # memory of the filtered signal, as a share of the slower time constants
    most_delay_s: float = 3.0  # dead times are sought up to this
    steady_blocks: int = 8  # of a plateau, whose means give its standard error


TUNING = Tuning()
