"""Fits of effects and parameters to all windows, and the tests that follow from them."""

from expdesign.diagnosis.fit.clusters import widened
from expdesign.diagnosis.fit.cross_validation import DRAWS, HeldOut, gained, held_out, on_same, units
from expdesign.diagnosis.fit.gauss_newton import Fit, fit, profile_cost
from expdesign.diagnosis.fit.linear_model import answers
from expdesign.diagnosis.fit.score_tests import LEVEL, Scored, screen

__all__ = [
    "DRAWS",
    "LEVEL",
    "Fit",
    "HeldOut",
    "Scored",
    "answers",
    "fit",
    "gained",
    "held_out",
    "on_same",
    "profile_cost",
    "screen",
    "units",
    "widened",
]
