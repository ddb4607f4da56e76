"""Tuning constants of the estimation that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived."""

    most_refinements: int = 30  # of simulated instruments
    settled_deviations: float = 1e-3  # change of an estimate, in standard deviations, that ends the refinement
    rough_samples: int = 10_000  # compared at earlier horizons than the last, spread over the data
    rough_step_s: float = 0.5  # longest step of simulations that compare some samples only
    spectrum_misfit: float = 1.628  # Bartlett's statistic at 1 % (Kolmogorov's distribution)
    whitening_passes: int = 2  # the second filter finds a slow disturbance below the measurement noise


TUNING = Tuning()
