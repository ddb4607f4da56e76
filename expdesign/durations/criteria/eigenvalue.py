"""E: the largest smallest eigenvalue of the normalised information about the parameters of interest."""

from __future__ import annotations

from expdesign.durations.criteria.criterion import Criterion, Picked
from expdesign.durations.criteria.measures import LogSmallest, Measure


def _measure(picked: Picked) -> Measure:
    return LogSmallest(picked.scaled_columns("E"))


EIGENVALUE = Criterion(name="E", title="worst relative error of any combination of parameters", measure=_measure)
