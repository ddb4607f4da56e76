"""Families of step trials: steps of throttle and rudder up and down, and waves of both to validate with."""

from expdesign.dictionary.families.step_trials.helm_and_engine_waves import HELM_AND_ENGINE_WAVES
from expdesign.dictionary.families.step_trials.rudder_steps import RUDDER_STEPS
from expdesign.dictionary.families.step_trials.throttle_steps import THROTTLE_STEPS

__all__ = ["HELM_AND_ENGINE_WAVES", "RUDDER_STEPS", "THROTTLE_STEPS"]
