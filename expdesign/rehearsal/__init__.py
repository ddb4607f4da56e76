"""Monte Carlo validation of designs: estimates of many simulated trials beside what was predicted."""

from expdesign.rehearsal.validation import RANDOM, Rehearsal, Validated, equal_runs, trial_parts, validate

__all__ = ["RANDOM", "Rehearsal", "Validated", "equal_runs", "trial_parts", "validate"]
