"""D-optimal fractions of bare matrices: the plain problem without names, limits or prior."""

from __future__ import annotations

import numpy as np

from expdesign.durations.constraints import Polytope
from expdesign.durations.criteria import LogDet
from expdesign.durations.interior import Task, climb, warmed
from expdesign.durations.objective import Objective, Piece
from expdesign.values import Array


def polish(matrices: Array, fractions: Array, *, tolerance: float = 1e-10) -> Array:
    """Fractions (q,) that maximise log det sum_q w_q B_q, to about `tolerance` x dimension in the certificate.

    Args:
        matrices: (q, d, d) symmetric positive semidefinite B_q.
        fractions: (q,) start on the simplex; B of it may be singular.
        tolerance: relative certificate to aim at.

    Raises:
        NotInformative: B of equal shares is singular to working precision.
    """
    count, size = matrices.shape[:2]
    piece = Piece.of(matrices, np.zeros((size, size)), LogDet(np.eye(size)))
    free = Polytope(
        least=np.zeros(count), most=np.ones(count), rows=np.zeros((0, count)), limits=np.zeros(0), labels=()
    )
    task = Task(objective=Objective((piece,), np.zeros(1)), polytope=free)
    return climb(task, warmed(task, fractions), tolerance=tolerance).fractions
