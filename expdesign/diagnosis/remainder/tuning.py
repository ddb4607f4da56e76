"""Numbers that steer the search for what no cause of the catalogue explains."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Numbers of this room. "Statistic" is twice a log likelihood ratio.

    Attributes:
        window_s, fewest_samples: length of the windows that the search simulates.
        steps: of the fit in these.
        whole: sizes between which an effect counts as there or not is there.
        most_terms: of the sum.
        regressors: about so many are tried, by which p-values are multiplied.
        least_statistic: of a regressor; one of 300 reaches it by chance in one of 1000 trials.
        least_own_share: of a regressor that nothing else imitates.
        most_units: that one or two runs are divided into.
        rounding: share of a regressor's information that is rounding, where the rest is imitated by what is estimated.
        half_samples: of the units, for stability selection.
        stable: share of them that must choose a regressor, or one that looks like it.
        alike: correlation from which on regressors look alike.
        folds: of the held-out likelihood.
        least_held_out: gain of held-out likelihood, as a statistic.
        most_lost: share of it that single units may lose.
        level: of the p-value of a size, adjusted for the number of regressors.
        least_share: of the whitened squared error of held-out data that a kind of effect must take away to be named.
        as_good: share of the likelihood gained by causes from which on a kind of effect is named beside them.
        least_reduction: share by which the error of some output must fall on held-out data.
    """

    window_s: float = 30.0
    fewest_samples: int = 20
    steps: int = 3
    whole: tuple[float, float] = (0.6, 1.4)
    most_terms: int = 3
    regressors: int = 300
    least_statistic: float = 25.0
    least_own_share: float = 1e-4
    most_units: int = 200
    rounding: float = 1e-11
    half_samples: int = 50
    stable: float = 0.5
    alike: float = 0.8
    folds: int = 4
    least_held_out: float = 15.0
    most_lost: float = 0.25
    level: float = 0.025
    least_share: float = 0.02
    as_good: float = 0.8
    least_reduction: float = 0.05


TUNING = Tuning()
