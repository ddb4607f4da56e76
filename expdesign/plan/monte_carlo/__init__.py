"""Monte Carlo trials of drawn ships in drawn weather: the probability that one leaves allowed water."""

from expdesign.plan.monte_carlo.risk import (
    Trials,
    estimate_risk,
    failed_chance_constraint,
    sail_trials,
    shares_allowed,
    trials_needed,
    violates_chance_constraint,
    worst_leg,
)
