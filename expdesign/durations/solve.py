"""Problem -> durations with a certificate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.durations._cvxpy import maximise_log_det
from expdesign.durations.certificate import log_det, sensitivities, whitened
from expdesign.durations.polish import polish
from expdesign.durations.rounding import value, whole_runs
from expdesign.durations.values import DurationDesign, DurationProblem
from expdesign.errors import NoAnswer, NotInformative, UnknownName
from expdesign.information import MEAN_SUBTRACTIONS, PrimitiveInformation, check_informative
from expdesign.values import Array

LARGEST_GAP = 1e-6
"""Certificates above this, relative to the dimension, are not given out as optimal designs."""


def build_durations(
    information: Sequence[PrimitiveInformation],
    parameters: Sequence[str],
    *,
    total_s: float,
    mean_subtraction: str = "complete",
) -> DurationProblem:
    """The duration problem of a scored dictionary.

    Raises:
        UnknownName: no such mean subtraction.
        NotInformative: no shares of these primitives inform about every parameter.
    """
    if mean_subtraction not in MEAN_SUBTRACTIONS:
        raise UnknownName("mean subtraction", mean_subtraction, known=MEAN_SUBTRACTIONS)
    check_informative(information, parameters, mean_subtraction)
    return DurationProblem(
        names=tuple(item.primitive.name for item in information),
        parameters=tuple(parameters),
        mean_subtraction=mean_subtraction,
        matrices=np.array([bordered(item, mean_subtraction) for item in information]),
        run_s=np.array([item.primitive.duration_s for item in information]),
        total_s=total_s,
    )


def bordered(item: PrimitiveInformation, mean_subtraction: str) -> Array:
    """B_q of one primitive, linear in time fractions: see `DurationProblem`."""
    if mean_subtraction == "none":
        return item.X
    if mean_subtraction == "batch":
        return item.X - item.YZ
    return np.block([[item.X, item.Y], [item.Z.T, np.eye(item.Y.shape[1])]])


def solve_durations(problem: DurationProblem) -> DurationDesign:
    """The D-optimal time fractions, whole runs, and the proof of both.

    Raises:
        NotInformative: no shares inform about every parameter.
        NoAnswer: the certificate cannot be brought below `LARGEST_GAP`, or whole runs do not fit.
    """
    try:
        matrices, _ = whitened(problem.matrices)
    except np.linalg.LinAlgError:
        raise NotInformative(
            "all primitives together do not inform about every parameter, to working precision",
            parameters=problem.parameters,
        ) from None
    start = maximise_log_det(matrices)
    if start is None:
        start = np.full(len(problem.names), 1.0 / len(problem.names))
    fractions = polish(matrices, start)
    d = sensitivities(matrices, fractions)
    gap = max(float(d.max()) - problem.dimension, 0.0)
    if not gap < LARGEST_GAP * problem.dimension:
        raise NoAnswer(
            f"the durations could not be certified: the sensitivity of {problem.names[int(d.argmax())]!r} is "
            f"{d.max():.9g}, an optimum needs at most {problem.dimension}"
        )
    return _rounded(problem, fractions, d, gap, whole_runs(problem, matrices, fractions))


def with_repeats(design: DurationDesign, repeats: Sequence[int]) -> DurationDesign:
    """The same optimum with other whole runs, their efficiency measured against it.

    Raises:
        NotInformative: the runs do not inform about every parameter.
    """
    changed = _rounded(design.problem, design.fractions, design.sensitivities, design.gap, tuple(repeats))
    if not changed.efficiency_repeats > 0:
        raise NotInformative(
            "the given whole runs do not inform about every parameter", parameters=design.problem.parameters
        )
    return changed


def _rounded(
    problem: DurationProblem, fractions: Array, sensitivity: Array, gap: float, repeats: tuple[int, ...]
) -> DurationDesign:
    matrices, offset = whitened(problem.matrices)
    best, p = log_det(matrices, fractions), len(problem.parameters)
    uniform = np.full(len(problem.names), 1.0 / len(problem.names))
    return DurationDesign(
        problem=problem,
        fractions=fractions,
        sensitivities=sensitivity,
        log_det=best + offset,
        gap=gap,
        repeats=repeats,
        efficiency_repeats=float(np.exp((value(problem, matrices, np.array(repeats)) - best) / p)),
        efficiency_uniform=float(np.exp((log_det(matrices, uniform) - best) / p)),
    )
