"""Criteria: what makes one sharing of the time better than another. A new one is a file and a line here."""

from expdesign.durations.criteria.average import AVERAGE
from expdesign.durations.criteria.criterion import Aim, Criterion, Picked
from expdesign.durations.criteria.determinant import DETERMINANT
from expdesign.durations.criteria.eigenvalue import EIGENVALUE
from expdesign.durations.criteria.measures import LogDet, LogSmallest, LogTrace, Measure
from expdesign.durations.criteria.prediction import PREDICTION
from expdesign.durations.criteria.subset import SUBSET
from expdesign.errors import UnknownName

CRITERIA = (DETERMINANT, SUBSET, AVERAGE, EIGENVALUE, PREDICTION)


def criterion(name: str) -> Criterion:
    """A criterion by name.

    Raises:
        UnknownName: there is none.
    """
    for candidate in CRITERIA:
        if candidate.name == name:
            return candidate
    raise UnknownName("criterion", name, known=[candidate.name for candidate in CRITERIA])


__all__ = [
    "CRITERIA",
    "Aim",
    "Criterion",
    "LogDet",
    "LogSmallest",
    "LogTrace",
    "Measure",
    "Picked",
    "criterion",
]
