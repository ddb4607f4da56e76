"""The nominal vessel model with three degrees of freedom that a step trial leaves."""

from expdesign.step_trials.nominal.evidence import States
from expdesign.step_trials.nominal.vessel import nominal_vessel, with_delays
