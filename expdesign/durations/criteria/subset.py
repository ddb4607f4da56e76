"""D_s: the smallest volume of the confidence region of the parameters of interest, the others being unknown too."""

from __future__ import annotations

from expdesign.durations.criteria.criterion import Criterion, Picked
from expdesign.durations.criteria.measures import LogDet, Measure


def _measure(picked: Picked) -> Measure:
    return LogDet(picked.columns(picked.interest))


SUBSET = Criterion(name="D_s", title="volume of the confidence region of the parameters of interest", measure=_measure)
