"""Step trials while they are sailed: when a step is over, which is next, and which must be sailed again."""

from expdesign.step_trials.live.step_list import Inputs, Listed, StepList, in_sequence, step_list
from expdesign.step_trials.live.values import Event, Row, State
from expdesign.step_trials.live.watch import Setup, after_row, beginning, expected_constants
