"""The tuning constants of step trials, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        constant_share: of a command's range, within which it counts as held.
        least_hold_s, least_hold_samples: shorter holds belong to the change of command that follows.
        steady_share: end of a hold that is taken as steady before any test is calibrated.
        lower_quantile, upper_quantile: of the ratio in steady data, for its thresholds.
        upper_factor: least ratio of the thresholds.
        memory_share: memory of the filtered signal, as a share of the slower time constants.
        quicker: filters of both variances forget so many times as fast.
        dwell_memories: time below the lower threshold after which the vessel is steady, in filter memories.
        surrogates: of the steady data, to find these quantiles.
        longest_interval_share: of the filter's memory, between samples of the ratio test.
        visible_deviations: change of a steady value, in its standard errors, below which a step is too small.
        misfit: distance of plateau and end of transient, as a share of the step, from which they disagree.
        outlier: modified z-score from which a value is an outlier (B. Iglewicz and D. Hoaglin, 1993).
        least_group: samples of one command level among which outliers are sought.
        most_delay_s: dead times are sought up to this.
        entry_constants, least_entry_samples: beginning of a response to the rudder, from which its dead time is found,
            in time constants, and the least of it.
        preferred: decrease of Akaike's criterion from which a second order response is preferred.
        steady_blocks: of a plateau, whose means give its standard error.
        penalties: of ridge and lasso that cross-validation compares, on columns of unit size.
        folds: of cross-validation where there is no closed form.
        significant: p-value below which asymmetry and hysteresis are reported as found.
        least_inertia_share: of the smallest measured inertia, below which a surface is cut off.
        longest_hold_constants: expected time constants after which a hold that is not steady is given up.
        settling_share: beginning of the first hold that is not learnt from.
        least_plateau_s: time that a steady state is held, for its mean.
        longest_turn_s: a whole turn is made where it takes no longer, which takes a current out of the mean.
        most_attempts: at one step of a trial that is being sailed.
        gap_sample_times: interval, in sample times, from which a trial that is being sailed has a gap.
        substep_share: of the shortest time constant, one step of the simulated model.
    """

    constant_share: float = 0.02
    least_hold_s: float = 3.0
    least_hold_samples: int = 6
    steady_share: float = 1 / 3
    lower_quantile: float = 0.9
    upper_quantile: float = 0.999
    upper_factor: float = 2.0
    memory_share: float = 0.6
    quicker: float = 3.0
    dwell_memories: float = 1.0
    surrogates: int = 40
    longest_interval_share: float = 0.2
    visible_deviations: float = 5.0
    misfit: float = 0.2
    outlier: float = 3.5
    least_group: int = 5
    most_delay_s: float = 3.0
    entry_constants: float = 2.0
    least_entry_samples: int = 10
    preferred: float = 10.0
    steady_blocks: int = 8
    penalties: tuple[float, ...] = (1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
    folds: int = 10
    significant: float = 0.01
    least_inertia_share: float = 0.5
    longest_hold_constants: float = 15.0
    settling_share: float = 1 / 3
    least_plateau_s: float = 10.0
    longest_turn_s: float = 60.0
    most_attempts: int = 3
    gap_sample_times: float = 1.5
    substep_share: float = 0.2


TUNING = Tuning()
