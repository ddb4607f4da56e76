"""Numbers that steer fits."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Numbers of this room. "Cost" is twice the negative log likelihood.

    Attributes:
        steps: Gauss-Newton steps of a fit, at most.
        converged_below: a fit has converged when the next step would lower the cost by less than this.
        allowed_rise: a step may raise the cost by this, because the noise is an estimate.
        halvings: of a step that raises the cost.
        first_noise_passes: alternations between effects and noise without a first guess of the noise.
        current_stds_mps: standard deviations of the random current that are tried [m/s].
        current_times_s: correlation times of the random current that are tried [s].
        shares: of differences of white noise, as noise of yaw rates, that are tried; shares_beside_current: beside a
            random current, which leaves some noise at low frequencies, as it is known at its knots alone.
        numbers_at_once: in matrices of random currents that are tried together, at most.
        sensitivities_at_once: numbers in sensitivities and their inner products of windows that are taken together, so
            that memory does not grow with the data.
        knot_spacing_s: of the random current, at least [s].
        most_knots: of the random current in a window.
        tile: edge of blocks of matrix products; for up to 64 x 64 x 64 multiplications OpenBLAS uses one thread.
        largest_sensitivity: beyond it the model counts as unstable.
        smallest_factor_change: factors of inertia, thrust, log and gyro stay above one plus this.
        largest_ratio: times and widths change by this factor in a step, at most.
        beyond_std_level: of the test whether parameters are within their stated standard deviations.
        least_correlation_eigenvalue: of stated parameters; smaller ones count as rounded.
        folds: of the cross-validation.
        parts: of every run, in the cross-validation of short stretches.
        fold_steps: Gauss-Newton steps from the fit to all units to the fit without a fold.
        ahead_s: length of the stretches that held-out data are also simulated in [s].
        longer_by: factor of the length of windows from one fit of a diverging model to the next.
        least_fit: of simulations of whole held-out units [%]; where one is worse, the stretches count.
        force_spacing_s: between the knots of a force that nobody measured [s].
        force_penalties: sizes of such a force that are tried, as ridge penalties.
        block_s: length of the blocks that predictions are compared in [s].
        bootstrap_draws: of units, for intervals.
    """

    steps: int = 8
    converged_below: float = 0.05
    allowed_rise: float = 1.0
    halvings: int = 5
    first_noise_passes: int = 3
    current_stds_mps: tuple[float, ...] = (0.0, 0.005, 0.01, 0.02, 0.035, 0.06, 0.1, 0.2)
    current_times_s: tuple[float, ...] = (60.0, 150.0, 400.0, 1000.0)
    shares: tuple[float, ...] = (0.9, 1.0)
    shares_beside_current: tuple[float, ...] = (0.95,)
    numbers_at_once: int = 200_000
    sensitivities_at_once: int = 20_000_000
    knot_spacing_s: float = 20.0
    most_knots: int = 24
    tile: int = 64
    largest_sensitivity: float = 1e30
    smallest_factor_change: float = -0.8
    largest_ratio: float = 3.0
    beyond_std_level: float = 1e-3
    least_correlation_eigenvalue: float = 1e-6
    folds: int = 3
    parts: int = 5
    fold_steps: int = 6
    ahead_s: float = 30.0
    longer_by: float = 1.4
    least_fit: float = 0.0
    force_spacing_s: float = 60.0
    force_penalties: tuple[float, ...] = (1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4)
    block_s: float = 60.0
    bootstrap_draws: int = 1000


TUNING = Tuning()
