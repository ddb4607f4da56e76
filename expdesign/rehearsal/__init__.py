"""Designs put to the test: Monte Carlo trials of a true ship, and subsets of recorded data."""

from expdesign.rehearsal.covariances import Alone, estimates_alone
from expdesign.rehearsal.recorded import (
    Drawn,
    Pieces,
    drawn_subsets,
    random_subsets,
    recorded_pieces,
    try_subsets,
)
from expdesign.rehearsal.validation import RANDOM, Rehearsal, Validated, equal_runs, trial_parts, validate

__all__ = [
    "RANDOM",
    "Alone",
    "Drawn",
    "Pieces",
    "Rehearsal",
    "Validated",
    "drawn_subsets",
    "equal_runs",
    "estimates_alone",
    "random_subsets",
    "recorded_pieces",
    "trial_parts",
    "try_subsets",
    "validate",
]
