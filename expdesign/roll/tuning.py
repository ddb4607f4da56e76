"""Tuning constants of roll identification that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived."""

    passed_gain: float = 0.9  # least gain of the low-pass filter at the roll frequency
    least_samples_per_period: float = 10.0  # of roll in the data
    # of the noise of roll rates to that of other signals, as they enter the equation, that are tried
    noise_ratios: tuple[float, ...] = (0.0, *(10.0**power for power in range(-4, 5)), 1e6)
    # least sum of squares over its expected value, beyond which intervals are not to be trusted
    most_surprise: float = 3.0
    # of instruments, below which noise alone seems to give nearly as much information, and no interval is trusted
    least_strength: float = 1.5


TUNING = Tuning()
