"""From a duration problem to the concave problem behind it: an objective over a polytope, and floors to keep above."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from expdesign.durations.criteria import LogDet, Measure, criterion
from expdesign.durations.criteria.measures import SmoothMeasure
from expdesign.durations.criteria.models import Objective, pieces_of
from expdesign.durations.limits import Polytope, feasible_set
from expdesign.durations.problem import DurationProblem
from expdesign.values import Array

IDLE = "(unused time)"


@dataclass(frozen=True, kw_only=True, eq=False)
class ConcaveProblem:
    """Maximise a concave objective over time fractions.

    Attributes:
        objective: what is maximised.
        polytope: linear limits.
        floors: concave functions that must not be negative.
        floor_names: of the floors.
    """

    objective: Objective
    polytope: Polytope
    floors: tuple[Objective, ...] = ()
    floor_names: tuple[str, ...] = ()

    @property
    def smooth(self) -> bool:
        """Whether every measure has second derivatives."""
        return all(isinstance(piece.measure, SmoothMeasure) for piece in self.objective.pieces)

    @property
    def plain_d(self) -> bool:
        """Whether it is D of one model, with no limits but least times and primitives left out."""
        (piece, *more), most = self.objective.pieces, self.polytope.most
        square = isinstance(piece.measure, LogDet) and piece.measure.L.shape[0] == piece.measure.L.shape[1]
        boxed = ((most >= 1.0) | (most <= self.polytope.least)).all()
        return bool(square and boxed) and not (more or self.floors or len(self.polytope.rows))


def symmetric_part(matrices: Array) -> Array:
    """(..., d, d) half the sum with the transpose."""
    return np.asarray((matrices + np.swapaxes(matrices, -1, -2)) / 2)


def objective_of(problem: DurationProblem, measure: Measure, *, within: Array | None = None) -> Objective:
    """A measure over the models that the problem asks to be robust against.

    Args:
        problem: whose symmetric parts count.
        measure: of the information matrix.
        within: (q,) fractions where the information is positive definite; equal ones when not given.

    Raises:
        NotInformative: equal shares do not inform about every parameter.
    """
    stacks = problem.sampled if len(problem.sampled) else problem.matrices[None]
    pieces = pieces_of(symmetric_part(stacks), symmetric_part(problem.prior), measure, within=within)
    return Objective(pieces, np.zeros(len(stacks)), worst=problem.robust == "worst")


def floor_of(problem: DurationProblem, equation: str) -> Objective:
    """The log det of the information about one equation's parameters, by the nominal model."""
    names = tuple(n for n, e in zip(problem.parameters, problem.equations, strict=True) if e == equation)
    measure = LogDet(problem.picked.columns(names))
    return Objective(pieces_of([symmetric_part(problem.matrices)], symmetric_part(problem.prior), measure), np.zeros(1))


def polytope_of(problem: DurationProblem) -> Polytope:
    """The linear limits.

    Raises:
        UnknownName, InputError, NoAnswer: see `feasible_set`.
    """
    return feasible_set(problem.constraints, problem.names, run_s=problem.run_s, total_s=problem.total_s)


def limits_of(problem: DurationProblem) -> Polytope:
    """The linear limits of shares (q,) that need not take all the time.

    Raises:
        UnknownName, InputError, NoAnswer: see `feasible_set`.
    """
    whole, count = polytope_of(with_idle(problem)), len(problem.names)
    return replace(whole, least=whole.least[:count], most=whole.most[:count], rows=whole.rows[:, :count])


def with_idle(problem: DurationProblem) -> DurationProblem:
    """The problem with a primitive of no information and no cost at its end: time that is better left unused."""
    nothing = np.zeros((1, *problem.matrices.shape[1:]))
    sampled = problem.sampled
    if len(sampled):
        sampled = np.concatenate([sampled, np.zeros((len(sampled), *nothing.shape))], axis=1)
    return replace(
        problem,
        names=(*problem.names, IDLE),
        matrices=np.concatenate([problem.matrices, nothing]),
        run_s=np.r_[problem.run_s, problem.total_s],
        sampled=sampled,
    )


def collected_measure(problem: DurationProblem, name: str) -> Measure:
    """The measure of a criterion that stays right when times do not sum to one: means are eliminated, not counted."""
    if name == "D":
        return LogDet(problem.picked.columns(problem.parameters))
    return criterion(name).measure(problem.picked)
