"""The tuning constants of the information room, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        headings: evenly spread headings over which information is averaged in wind or current.
        regressor_rounding: a regressor below this share of its possible size is rounding.
        simulated_samples: samples simulated together.
        evaluated_samples: samples of regressors evaluated together.
        runs_at_once: runs simulated together, so that their states stay in the processor's cache.
        redraws: ratio of drawn to desired models above which the prior is refused as unstable.
        ideal_share: variance of an ideal sensor's noise, in that of the noisiest, where equations are weighed by it.
        unseen_current: correlation matrices' relative eigenvalue below which a current is not told from the means.
        velocity_step: step of central differences, relative to the larger of 1 and the signal [m/s, rad/s].
        parameter_step: relative step of central differences in a parameter.
        gradient_agreement: change of a gradient when the step is halved, relative to the outcome's largest gradient.
        least_clear: share of a run that meets the excitation condition, at least, where designs require it.
        singular: condition number above which a trial counts as uninformative.
    """

    headings: int = 8
    regressor_rounding: float = 1e-12
    simulated_samples: int = 3_000_000
    evaluated_samples: int = 500_000
    runs_at_once: int = 2048
    redraws: int = 5
    ideal_share: float = 1e-12
    unseen_current: float = 1e-9
    velocity_step: float = 1e-6
    parameter_step: float = 1e-3
    gradient_agreement: float = 0.05
    least_clear: float = 0.5
    singular: float = 1e12


TUNING = Tuning()
