"""Manoeuvre families, in one visible tuple; adding one is a function, a `Family` and its name here."""

from expdesign.dictionary.families.motions import (
    ACCELERATION,
    DECELERATION,
    INWARD_SPIRAL,
    MULTISINE,
    SWAY_STEP,
    SWAY_ZIGZAG,
    TELEGRAPH,
    TURNING_CIRCLE,
    ZIGZAG,
)
from expdesign.dictionary.families.orders import (
    CRASH_STOP,
    DIEUDONNE_SPIRAL,
    PULL_OUT,
    RECORDED,
    STEPS,
    TURNING_CIRCLE_HELM,
    ZIGZAG_HEADING,
)
from expdesign.dictionary.families.step_trials import HELM_AND_ENGINE_WAVES, RUDDER_STEPS, THROTTLE_STEPS

FAMILIES = (
    ACCELERATION,
    DECELERATION,
    ZIGZAG,
    TURNING_CIRCLE,
    INWARD_SPIRAL,
    SWAY_ZIGZAG,
    SWAY_STEP,
    TELEGRAPH,
    MULTISINE,
    CRASH_STOP,
    TURNING_CIRCLE_HELM,
    ZIGZAG_HEADING,
    PULL_OUT,
    DIEUDONNE_SPIRAL,
    STEPS,
    THROTTLE_STEPS,
    RUDDER_STEPS,
    HELM_AND_ENGINE_WAVES,
    RECORDED,
)
