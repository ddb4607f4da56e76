"""Manoeuvre families, one file each; adding one is a file and a line."""

from expdesign.dictionary.families.acceleration import ACCELERATION
from expdesign.dictionary.families.deceleration import DECELERATION
from expdesign.dictionary.families.inward_spiral import INWARD_SPIRAL
from expdesign.dictionary.families.sway_zigzag import SWAY_ZIGZAG
from expdesign.dictionary.families.telegraph import TELEGRAPH
from expdesign.dictionary.families.turning_circle import TURNING_CIRCLE
from expdesign.dictionary.families.zigzag import ZIGZAG

FAMILIES = (ACCELERATION, DECELERATION, ZIGZAG, TURNING_CIRCLE, INWARD_SPIRAL, SWAY_ZIGZAG, TELEGRAPH)
