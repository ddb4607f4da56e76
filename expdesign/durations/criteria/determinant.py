"""D: the smallest volume of the confidence region of all parameters."""

from __future__ import annotations

import numpy as np

from expdesign.durations.criteria.criterion import Criterion, Picked
from expdesign.durations.criteria.measures import LogDet, Measure


def _measure(picked: Picked) -> Measure:
    """The means are counted too: their part of the determinant is constant when fractions sum to one."""
    return LogDet(np.eye(picked.dimension))


DETERMINANT = Criterion(name="D", title="volume of the confidence region of all parameters", measure=_measure)
