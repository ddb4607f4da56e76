"""Whole trials of drawn ships in drawn weather: the chance that one leaves allowed water."""

from expdesign.plan.monte_carlo.risk import broken_promise, leaves_too_often, promised, trials_for, worst_leg
from expdesign.plan.monte_carlo.trials import Trials

__all__ = ["Trials", "broken_promise", "leaves_too_often", "promised", "trials_for", "worst_leg"]
