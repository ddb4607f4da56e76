"""Manoeuvre families, one file each; adding one is a file and a line."""

from expdesign.dictionary.families.acceleration import ACCELERATION
from expdesign.dictionary.families.crash_stop import CRASH_STOP
from expdesign.dictionary.families.deceleration import DECELERATION
from expdesign.dictionary.families.dieudonne_spiral import DIEUDONNE_SPIRAL
from expdesign.dictionary.families.inward_spiral import INWARD_SPIRAL
from expdesign.dictionary.families.multisine import MULTISINE
from expdesign.dictionary.families.pull_out import PULL_OUT
from expdesign.dictionary.families.recorded import RECORDED
from expdesign.dictionary.families.steps import STEPS
from expdesign.dictionary.families.sway_step import SWAY_STEP
from expdesign.dictionary.families.sway_zigzag import SWAY_ZIGZAG
from expdesign.dictionary.families.telegraph import TELEGRAPH
from expdesign.dictionary.families.turning_circle import TURNING_CIRCLE
from expdesign.dictionary.families.turning_circle_helm import TURNING_CIRCLE_HELM
from expdesign.dictionary.families.zigzag import ZIGZAG
from expdesign.dictionary.families.zigzag_heading import ZIGZAG_HEADING

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
    RECORDED,
)
