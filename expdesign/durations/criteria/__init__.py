"""Optimality criteria.

A new criterion is one entry of `CRITERIA`. A new measure is also a class like `LogDet` and one expression in the convex
solver.
"""

from __future__ import annotations

import numpy as np

from expdesign.durations.criteria.aim import Aim, Criterion, Picked, of_other_parameters, prediction_columns
from expdesign.durations.criteria.measures import LogDet, LogSmallest, LogTrace, Measure
from expdesign.errors import UnknownName

CRITERIA = (
    # D includes the means: their part of the determinant is constant when fractions sum to one.
    Criterion(
        name="D",
        title="volume of the confidence region of all parameters",
        measure=lambda picked: LogDet(np.eye(picked.dimension)),
    ),
    Criterion(
        name="D_s",
        title="volume of the confidence region of the parameters of interest",
        measure=lambda picked: LogDet(picked.columns(picked.interest)),
    ),
    Criterion(
        name="A",
        title="mean square relative error of the parameters",
        measure=lambda picked: LogTrace(picked.scaled_columns("A")),
    ),
    Criterion(
        name="E",
        title="worst relative error of any combination of parameters",
        measure=lambda picked: LogSmallest(picked.scaled_columns("E")),
    ),
    Criterion(
        name="V",
        title="mean square error of the predicted outcomes",
        measure=lambda picked: LogTrace(prediction_columns(picked)),
    ),
    Criterion(
        name="T",
        title="worst shortfall of what reveals, or tells apart, the causes asked for",
        measure=of_other_parameters,
    ),
)


def criterion(name: str) -> Criterion:
    """A criterion by name.

    Raises:
        UnknownName: there is none.
    """
    for candidate in CRITERIA:
        if candidate.name == name:
            return candidate
    raise UnknownName("criterion", name, known=[candidate.name for candidate in CRITERIA])
