"""The tuning constants of the manoeuvre dictionary, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        steady_change: largest relative change of speed per sample of a steady state.
        share_starts: shares of a desired velocity from which the search for the largest one that can be held begins.
        thrust_starts: shares of full thrust from which the search for commands of a direct model begins.
        reported_deviation: deviation, as a share of the largest desired speed or yaw rate, above which a primitive is
            reported.
        tones: sines for each of the three velocities.
        followed_samples: samples of desired velocities whose commands are found at a time.
        least_swing: least amplitude to both sides of a wave before it is scaled to amplitude 1.
    """

    steady_change: float = 1e-6
    share_starts: tuple[float, ...] = (0.9, 0.75, 0.5, 0.25, 0.1, 0.03, 0.01)
    thrust_starts: tuple[float, ...] = (0.05, 0.4, 0.9)
    reported_deviation: float = 0.1
    tones: int = 4
    followed_samples: int = 300_000
    least_swing: float = 0.5


TUNING = Tuning()
