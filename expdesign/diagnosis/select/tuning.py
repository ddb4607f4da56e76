"""Numbers that steer the selection of causes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Numbers of this room. "Statistic" and "gain" are twice a log likelihood ratio, where they are not points of fit.

    Attributes:
        level: of tests.
        accepted_p_value: adjusted p-value up to which a cause is accepted: half of `level`, because p-values are exact
            only for long data.
        draws: of the null distribution, for adjusted p-values.
        least_own_share: share of a candidate's sensitivity that nothing else in the model can imitate, at least, for it
            to be tested.
        price: of every estimated effect, so that causes with fewer effects are preferred.
        shortlist: causes that are fitted in a round, at most.
        per_cause: candidates of a cause that are fitted in a round, at most.
        least_statistic_share, statistic_margin: candidates below this share of the largest statistic, and by more than
            the margin, are not fitted.
        equivalent_within: an alternative that trails by less is not distinguishable. A wrong cause that truly trails by
            d comes out ahead by more than this with a probability below Phi(-sqrt(equivalent_within)).
        rival_share: share of the likelihood gain of the chosen candidate from which on another may be equivalent, where
            runs differ so that the difference counts less.
        first_steps: Gauss-Newton steps of every candidate.
        leading_share: candidates that then gain less than this share of the best are dropped.
        simple_share: the same of those with fewer numbers than the best.
        rivals: candidates with fewer numbers that are compared with the best on held-out data, at most.
        nearly_as_much: share of the gain of a candidate that imitates many causes which one with fewer numbers needs to
            come first.
        about_as_likely: share of the gain of a candidate from which on another is compared with it on held-out data;
            one with fewer numbers comes first unless it is clearly worse there.
        nuisance_steps: Gauss-Newton steps of the fit before anything is tested, at most.
        large_share: share of the remainder above which an effect counts as large and is fitted in short windows too.
        certain: causes whose best candidates are always fitted in long windows.
        short_s, middle_s: length of short windows, and of those between short and long ones [s].
        fewest_samples: of a short window.
        short_steps: Gauss-Newton steps in short windows.
        least_gain_share: candidates that gain less than this share of the best in short windows are not fitted in long
            ones.
        large_current_mps: standard deviation of the random current above which a steady current is fitted too.
        most_simulations: of all data in fits of candidates, before the search leaves the rest untried.
        most_findings: causes, at most.
        most_rejected: causes that are removed again, at most.
        most_exchanges: of a cause for another that gains more beside the rest, at most.
        first_rounds: rounds expected after the first, before anything is tested.
        tests_work, round_work: time of the tests of a round, and of a round, in simulations of all data.
        roll_work: time of a simulation with roll, which is stepped through, in simulations without.
        refined_grid: values of the second grid search.
        profile_points, profile_rounds: values per round of a profile likelihood, and rounds, at most.
        equivalent_cost: values of a profile count as equally likely up to this cost: one standard error of a Gaussian.
        equivalent_values: this many equally likely values in a round end the search.
        least_gain_points: gain of fit on held-out data that causes after the first need, at least [points].
        clear_gain_points: gain that suffices even where its interval, of few runs perhaps, includes zero [points].
        much_better_points: by which a candidate that is less likely, or has more numbers, has to simulate held-out data
            better than the best for it to be the cause instead [points].
        leads: candidates that are named where a simulation explains little and no cause is certain.
        least_reduction: share by which the error of some output must fall on held-out data for a cause to be a finding.
        least_predicted: share of the squared error of predictions that a first cause may take away instead.
        most_loss_points: loss at the lower end of the interval that the first cause may risk, if some output is
            simulated worse with it [points].
    """

    level: float = 0.05
    accepted_p_value: float = 0.025
    draws: int = 2000
    least_own_share: float = 1e-5
    price: float = 5.0
    shortlist: int = 7
    per_cause: int = 2
    least_statistic_share: float = 0.4
    statistic_margin: float = 20.0
    equivalent_within: float = 5.0
    rival_share: float = 0.5
    first_steps: int = 3
    leading_share: float = 0.6
    simple_share: float = 0.3
    rivals: int = 3
    nearly_as_much: float = 0.7
    about_as_likely: float = 0.85
    nuisance_steps: int = 12
    large_share: float = 0.15
    certain: int = 2
    short_s: float = 45.0
    middle_s: float = 140.0
    fewest_samples: int = 30
    short_steps: int = 6
    least_gain_share: float = 0.75
    large_current_mps: float = 0.1
    most_simulations: int = 250
    most_findings: int = 6
    most_rejected: int = 4
    most_exchanges: int = 2
    first_rounds: int = 2
    tests_work: float = 18.0
    round_work: float = 35.0
    roll_work: float = 15.0
    refined_grid: int = 11
    profile_points: int = 9
    profile_rounds: int = 9
    equivalent_cost: float = 1.0
    equivalent_values: int = 3
    least_gain_points: float = 0.1
    clear_gain_points: float = 1.0
    much_better_points: float = 5.0
    leads: int = 3
    least_reduction: float = 0.01
    least_predicted: float = 0.05
    most_loss_points: float = 0.5


TUNING = Tuning()
