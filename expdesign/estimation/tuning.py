"""The tuning constants of the estimation, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        worst_case_sigmas: standard deviations of Gaussian noise in the excitation condition.
        unseen: relative singular value below which a combination of parameters is not visible in the data.
        faint: relative singular value below which least squares gets a warning.
        weak_statistic: Cragg-Donald statistic per instrument below which instruments get a warning.
        small_weight: least weight of a parameter that a message names.
        named_parameters: most parameters of a combination that a message names.
        most_refinements: of simulated instruments.
        most_choices: of equation-wise samples, by the start and by what was estimated.
        most_currents: guesses of an unknown steady current after the first.
        exact_share: of the data's power, which residuals have at least where equations are weighed by them.
        settled_deviations: change of an estimate, in standard deviations, that ends the refinement.
        stabilising_weights: of the first model, tried one after the other where an estimate is unstable.
        prior_share: spread of a parameter without a stated standard deviation, relative to its size.
        first_horizon_samples: of output error.
        horizon_growth: ratio of successive horizons of output error.
        shortest_horizon_samples, least_horizon_growth: where the model diverges at a horizon, others are tried down to
            the one, and up to a ratio of it of the other.
        diverged_times: a simulation so many times as fast as the largest measurement has diverged.
        most_partial_searches: without stretches in which the model diverges, of one horizon.
        most_left_out: share of these, at most.
        most_steps: of Gauss and Newton at one horizon.
        most_damping: of such a step, relative to the diagonal; with more, nothing is left to find.
        most_first_weight: weight of the first sample of a stretch, to that of another, at most.
        remembered_steps: that the next one is mixed with.
        rough_samples: compared at earlier horizons than the last, spread over the data.
        rough_step_s: longest step of simulations that compare some samples only.
        most_correlated: correlation of residuals from sample to sample that counts, at most.
        expected_steps: of Gauss and Newton on all data, for the progress told; twice as many on part of them.
        covariance_steps: how many such steps the covariance takes as long as.
        loading_samples, compiling_samples: how many samples a step could do while libraries are loaded, and while a
            stage is compiled.
        slowest_convergence: least ratio of successive expected decreases that the progress told counts on.
        settled_cost: expected decrease of the cost, in squared standard deviations, that ends the last horizons.
        rough_cost: the same for earlier horizons.
        block_instructions: size of the flat CasADi functions that simulations are cut into.
        block_samples: of a stretch, simulated at once.
        simulated_points, block_points: samples of all stretches, simulated or differentiated at once.
        spectrum_bins: bins of the periodogram, of equal width in the logarithm of frequency.
        spectrum_iterations: of reweighted non-negative least squares.
        spectrum_misfit: Bartlett's statistic at 1 % (Kolmogorov's distribution).
        least_left: share of a part of the noise that parameters leave in residuals at a frequency, at least.
        memory_doublings: how far the memory of a slow part may be from the found one, standard deviation of log2.
        least_freedom: degrees of freedom that a variance is taken to have at least.
        rounding: expected periodogram of a part with unit variance below which it is rounding errors.
        long_gap_samples: missing samples in a row after which the noise starts again.
        slowest_pole: bound on the autoregressive coefficient of a whitening filter.
        whitening_passes: the second filter finds a slow disturbance below the measurement noise.
        white_test_level: of White's test.
        longest_lag_share: automatic lags end at the longest batch divided by this.
        shortest_stretch: samples between steered ones that are worth a batch.
        feedback_lags: past samples known to the test for feedback, and later ones tested.
        feedback_gap_of_differences: first later sample tested where velocities are differences of the pose.
        feedback_samples: compared by that test at most, which bounds its time and memory.
        feedback_level: chance below which inputs are said to follow disturbances.
        feedback_rounding: size of a direction of inputs, relative to theirs, below which it is rounding errors.
        few_lags: up to this number, sums of products are faster than Fourier transforms.
    """

    worst_case_sigmas: float = 3.0
    unseen: float = 1e-10
    faint: float = 1e-5
    weak_statistic: float = 10.0
    small_weight: float = 0.05
    named_parameters: int = 4
    most_refinements: int = 30
    most_choices: int = 4
    most_currents: int = 8
    exact_share: float = 1e-12
    settled_deviations: float = 1e-3
    stabilising_weights: tuple[float, ...] = (0.01, 0.1, 1.0, 10.0, 100.0, 1e4)
    prior_share: float = 1.0
    first_horizon_samples: int = 8
    horizon_growth: int = 4
    shortest_horizon_samples: int = 3
    least_horizon_growth: float = 1.2
    diverged_times: float = 10.0
    most_partial_searches: int = 3
    most_left_out: float = 0.5
    most_steps: int = 40
    most_damping: float = 1e10
    most_first_weight: float = 1e4
    remembered_steps: int = 5
    rough_samples: int = 10_000
    rough_step_s: float = 0.5
    most_correlated: float = 0.9999
    expected_steps: int = 3
    covariance_steps: float = 4.0
    loading_samples: float = 7e4
    compiling_samples: float = 7e3
    slowest_convergence: float = 1.5
    settled_cost: float = 1e-4
    rough_cost: float = 0.1
    block_instructions: int = 20_000
    block_samples: int = 256
    simulated_points: int = 1024
    block_points: int = 4096
    spectrum_bins: int = 80
    spectrum_iterations: int = 12
    spectrum_misfit: float = 1.628
    least_left: float = 0.05
    memory_doublings: float = 1.0
    least_freedom: float = 2.0
    rounding: float = 1e-9
    long_gap_samples: int = 500
    slowest_pole: float = 0.98
    whitening_passes: int = 2
    white_test_level: float = 0.01
    longest_lag_share: int = 8
    shortest_stretch: int = 3
    feedback_lags: int = 8
    feedback_gap_of_differences: int = 3
    feedback_samples: int = 50_000
    feedback_level: float = 0.01
    feedback_rounding: float = 1e-6
    few_lags: int = 10


TUNING = Tuning()
