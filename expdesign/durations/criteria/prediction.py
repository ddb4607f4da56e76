"""V: the smallest sum of variances of what the model is to predict, to first order in the parameters."""

from __future__ import annotations

import numpy as np

from expdesign.durations.criteria.criterion import Criterion, Picked
from expdesign.durations.criteria.measures import LogTrace, Measure
from expdesign.errors import InputError


def _measure(picked: Picked) -> Measure:
    aim, p = picked.aim, len(picked.parameters)
    if not aim.gradients.size:
        raise InputError("criterion V needs outcomes to predict")
    if aim.gradients.shape[1] != p:
        raise InputError(f"gradients of outcomes have {aim.gradients.shape[1]} columns for {p} parameters")
    moved = tuple(name for name, column in zip(picked.parameters, aim.gradients.T, strict=True) if column.any())
    if not moved:
        raise InputError(f"no parameter to be estimated moves {', '.join(aim.outcomes)}")
    L = np.zeros((picked.dimension, len(aim.gradients)))
    index = [picked.parameters.index(name) for name in moved]
    L[index] = (aim.gradients[:, index] * picked.noise("V", moved)).T
    return LogTrace(L)


PREDICTION = Criterion(name="V", title="mean square error of the predicted outcomes", measure=_measure)
