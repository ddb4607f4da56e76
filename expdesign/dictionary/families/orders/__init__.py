"""Families that state helm and engine orders."""

from expdesign.dictionary.families.orders.crash_stop import CRASH_STOP
from expdesign.dictionary.families.orders.dieudonne_spiral import DIEUDONNE_SPIRAL
from expdesign.dictionary.families.orders.pull_out import PULL_OUT
from expdesign.dictionary.families.orders.recorded import RECORDED
from expdesign.dictionary.families.orders.steps import STEPS
from expdesign.dictionary.families.orders.turning_circle_helm import TURNING_CIRCLE_HELM
from expdesign.dictionary.families.orders.zigzag_heading import ZIGZAG_HEADING

__all__ = [
    "CRASH_STOP",
    "DIEUDONNE_SPIRAL",
    "PULL_OUT",
    "RECORDED",
    "STEPS",
    "TURNING_CIRCLE_HELM",
    "ZIGZAG_HEADING",
]
