"""Monte Carlo trials of drawn ships in drawn weather: the probability that one leaves allowed water."""

from expdesign.plan.monte_carlo.risk import (
    estimate_risk,
    failed_chance_constraint,
    shares_allowed,
    trials_needed,
    violates_chance_constraint,
    worst_leg,
)
from expdesign.plan.monte_carlo.trials import Trials, sail_trials
