"""Monte Carlo validation of designs: estimates from many simulated trials, compared with the predictions."""

from expdesign.rehearsal.validation import RANDOM, Rehearsal, Validated, equal_runs, trial_parts, validate

__all__ = ["RANDOM", "Rehearsal", "Validated", "equal_runs", "trial_parts", "validate"]
