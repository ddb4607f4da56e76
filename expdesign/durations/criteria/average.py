"""A: the smallest sum of variances of the parameters of interest, each in its own unit, e.g. its nominal size."""

from __future__ import annotations

from expdesign.durations.criteria.criterion import Criterion, Picked
from expdesign.durations.criteria.measures import LogTrace, Measure


def _measure(picked: Picked) -> Measure:
    return LogTrace(picked.scaled_columns("A"))


AVERAGE = Criterion(name="A", title="mean square relative error of the parameters", measure=_measure)
