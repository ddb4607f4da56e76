"""Families that state a motion; commands follow from the inverse model."""

from expdesign.dictionary.families.motions.acceleration import ACCELERATION
from expdesign.dictionary.families.motions.deceleration import DECELERATION
from expdesign.dictionary.families.motions.inward_spiral import INWARD_SPIRAL
from expdesign.dictionary.families.motions.multisine import MULTISINE
from expdesign.dictionary.families.motions.sway_step import SWAY_STEP
from expdesign.dictionary.families.motions.sway_zigzag import SWAY_ZIGZAG
from expdesign.dictionary.families.motions.telegraph import TELEGRAPH
from expdesign.dictionary.families.motions.turning_circle import TURNING_CIRCLE
from expdesign.dictionary.families.motions.zigzag import ZIGZAG

__all__ = [
    "ACCELERATION",
    "DECELERATION",
    "INWARD_SPIRAL",
    "MULTISINE",
    "SWAY_STEP",
    "SWAY_ZIGZAG",
    "TELEGRAPH",
    "TURNING_CIRCLE",
    "ZIGZAG",
]
