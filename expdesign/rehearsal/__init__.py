"""Designs put to the test: Monte Carlo trials of a true ship, and subsets of recorded data."""

from expdesign.rehearsal.recorded import Drawn, drawn_subsets, random_subsets, recorded_pieces, try_subsets
from expdesign.rehearsal.validation import (
    RANDOM,
    Alone,
    Rehearsal,
    Validated,
    equal_runs,
    estimates_alone,
    random_runs,
    trial_parts,
    validate,
)
