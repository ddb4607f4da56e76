"""The tuning constants of the estimation, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        most_refinements: of simulated instruments.
        settled_deviations: change of an estimate, in standard deviations, that ends the refinement.
        rough_samples: compared at earlier horizons than the last, spread over the data.
        rough_step_s: longest step of simulations that compare some samples only.
        spectrum_misfit: Bartlett's statistic at 1 % (Kolmogorov's distribution).
        whitening_passes: the second filter finds a slow disturbance below the measurement noise.
    """

    most_refinements: int = 30
    settled_deviations: float = 1e-3
    rough_samples: int = 10_000
    rough_step_s: float = 0.5
    spectrum_misfit: float = 1.628
    whitening_passes: int = 2


TUNING = Tuning()
