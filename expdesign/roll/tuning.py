"""The tuning constants of roll identification, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        samples_per_period: of roll, at least; fewer bias the bilinear map by a share of about (pi / samples)^2 / 3.
        unwarped_periods: frequencies, in that of roll, up to which the bilinear map is made exact; none above twice it.
        most_unwarped: of these, in half the sample rate.
        passed_gain: least gain of the low-pass filter at the roll frequency.
        cutoff_share: of the rate after thinning out, at which the low-pass filter before it leaves half.
        taps_per_period: length of that filter, in periods of its cut-off, to each side.
        least_samples_per_period: of roll in the data.
        least_samples: in a run, beside those that are left out.
        black_box: orders (past outputs, inputs) of the models from rudder to each signal.
        folds: parts of the record, each of which has black boxes that were fitted to the others.
        largest_pole: of these models; larger ones are moved inside.
        lags: of each simulated signal among the instruments.
        rudder_lags: of the rudder's difference.
        noise_order: of the autoregression in the noise model of a case.
        spectral_segments: least number of segments in all runs of a case, where spectra of residuals are estimated.
        samples_per_segment: there are as many segments as the root of all samples over this.
        least_density: of that of its peak, in such a spectrum, below which no frequency weighs more.
        noise_ratios: of the noise of roll rates to that of other signals, as they enter the equation, that are tried.
        repeated: share of variance below which a combination of instruments repeats others.
        left_out_samples: at the beginning of a run, where lags reach before it.
        farthest: typical sizes from zero, beyond which no parameter is sought.
        at_bound: share of the range of the search, within which of its end a parameter stands at the bound.
        most_rounds: of instruments and noise models.
        settled: change in a round, in standard deviations of each parameter, that ends them.
        most_surprise: least sum of squares over its expected value, beyond which intervals are not to be trusted.
        least_strength: of instruments, below which noise alone would give as much information, and no interval is
            trusted.
        leads: to which the rudder is looked at, up to a period of roll later, to see whether it answers.
        least_unanswered: chance without feedback, below which the rudder is said to answer roll.
        unseen: relative sensitivity below which the equations themselves leave a direction open.
        open_sizes: change along an open direction that is counted with, in sizes of the parameter that it moves most.
        faint_std: relative standard deviation along a direction from which data are said not to determine it.
        small_share: of a direction's largest relative change, below which a parameter is not named.
    """

    samples_per_period: float = 80.0
    unwarped_periods: float = 3.0
    most_unwarped: float = 0.45
    passed_gain: float = 0.9
    cutoff_share: float = 0.4
    taps_per_period: float = 2.0
    least_samples_per_period: float = 10.0
    least_samples: int = 100
    black_box: tuple[int, int] = (24, 25)
    folds: int = 3
    largest_pole: float = 0.999
    lags: int = 4
    rudder_lags: int = 2
    noise_order: int = 12
    spectral_segments: int = 4
    samples_per_segment: float = 1600.0
    least_density: float = 1e-14
    noise_ratios: tuple[float, ...] = (0.0, *(10.0**power for power in range(-4, 5)), 1e6)
    repeated: float = 1e-10
    left_out_samples: int = 50
    farthest: float = 10.0
    at_bound: float = 1e-4
    most_rounds: int = 12
    settled: float = 0.1
    most_surprise: float = 3.0
    least_strength: float = 1.0
    leads: int = 8
    least_unanswered: float = 0.05
    unseen: float = 1e-9
    open_sizes: float = 5.0
    faint_std: float = 1.0
    small_share: float = 0.01


TUNING = Tuning()
