"""Numbers that steer the selection of causes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Numbers of this package. "Statistic" and "gain" are twice a log likelihood ratio where they are not points."""

    level: float = 0.05  # of tests
    # adjusted p-value up to which a cause is accepted: half of `level`, because p-values are exact only for long data
    accepted_p_value: float = 0.025
    price: float = 5.0  # of every estimated effect, so that causes with fewer effects are preferred
    shortlist: int = 7  # causes that are fitted in a round, at most
    # least_statistic_share, statistic_margin: candidates below this share of the largest statistic, and by more than
    # the margin, are not fitted
    least_statistic_share: float = 0.4
    statistic_margin: float = 20.0
    # an alternative that trails by less is not distinguishable. A wrong cause that truly trails by d comes out ahead by
    # more than this with a probability below Phi(-sqrt(equivalent_within)).
    equivalent_within: float = 5.0
    # standard deviation of the random current above which a steady current is fitted too
    large_current_mps: float = 0.1
    most_simulations: int = 250  # of all data in fits of candidates, before the search leaves the rest untried
    first_rounds: int = 2  # rounds expected after the first, before anything is tested
    round_work: float = 35.0  # time of the tests of a round, and of a round, in simulations of all data
    least_gain_points: float = 0.1  # gain of fit on held-out data that causes after the first need, at least [points]
    # gain that suffices even where its interval, of few runs perhaps, includes zero [points]
    clear_gain_points: float = 1.0
    # share of what the best candidate leaves unexplained of held-out data by which one that is less likely, or has more
    # numbers, has to leave less for it to be the cause instead
    much_better_share: float = 0.2
    leads: int = 3  # candidates that are named where a simulation explains little and no cause is certain
    # share by which the error of some output must fall on held-out data for a cause to be a finding
    least_reduction: float = 0.01
    least_predicted: float = 0.05  # share of the squared error of predictions that a first cause may take away instead
    # loss at the lower end of the interval that the first cause may risk, if some output is simulated worse with it, as
    # a share of what the model without it leaves unexplained
    most_loss_share: float = 0.02


TUNING = Tuning()
