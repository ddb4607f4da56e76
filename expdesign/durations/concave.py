"""The concave problem behind a duration problem, and the criterion of times that need not fill the total.

Estimators merge a regressor of a disturbance with another one that it coincides with up to its sign
(`estimation.nuisance`): while v keeps its sign, sign(v) r cos psi is r cos psi. Runs need not distinguish such
regressors, but they must distinguish the parameters of the ship.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from expdesign.durations.criteria import (
    SINGULAR,
    Indices,
    LogDet,
    LogTrace,
    Measure,
    Objective,
    Piece,
    congruent,
    criterion,
    pieces_of,
    stacked_values,
)
from expdesign.durations.limits import Polytope, feasible_set
from expdesign.durations.measures import SmoothMeasure
from expdesign.durations.problem import DurationProblem, InformationFloor
from expdesign.errors import FloorOutOfReach, InputError, NotInformative
from expdesign.values import Array

COINCIDE = 1e-9  # regressors coincide whose correlation, means included, falls short of 1 by less
NEGLIGIBLE = 1e-12  # eigenvalues of scaled information below this are rounding
SMALL_WEIGHT = 0.05  # least weight in a null vector of a parameter that a message names
IDLE = "(unused time)"
T = "T"  # name of the criterion that is about other parameters


@dataclass(frozen=True, kw_only=True, eq=False)
class ConcaveProblem:
    """Maximise a concave objective over time fractions."""

    objective: Objective  # to maximise
    polytope: Polytope  # linear limits
    floors: tuple[Objective, ...] = ()  # concave functions that must not be negative
    floor_names: tuple[str, ...] = ()  # of the floors

    @property
    def smooth(self) -> bool:
        """Whether every measure has second derivatives."""
        return all(isinstance(piece.measure, SmoothMeasure) for piece in self.objective.pieces)

    def among(self, chosen: Indices) -> ConcaveProblem:
        """The problem of some of the candidates (c,), which keep what least times there are; others have no time."""
        return replace(
            self,
            objective=self.objective.among(chosen),
            polytope=self.polytope.among(chosen),
            floors=tuple(floor.among(chosen) for floor in self.floors),
        )

    @property
    def plain_d(self) -> bool:
        """Whether it is D of one model, with no limits but least times and excluded primitives."""
        (piece, *more), most = self.objective.pieces, self.polytope.most
        square = isinstance(piece.measure, LogDet) and piece.measure.L.shape[0] == piece.measure.L.shape[1]
        boxed = ((most >= 1.0) | (most <= self.polytope.least)).all()
        return bool(square and boxed) and not (more or self.floors or len(self.polytope.rows))


def unit_scaling(problem: DurationProblem) -> Array:
    """(d,) roots of the mean magnitudes on the diagonals; 1 where they are zero."""
    diagonal = np.abs(np.diagonal(problem.matrices, axis1=1, axis2=2)).mean(axis=0) + np.abs(np.diag(problem.prior))
    return np.sqrt(np.where(diagonal > 0, diagonal, 1.0))


def symmetric_part(matrices: Array) -> Array:
    """(..., d, d) half the sum with the transpose."""
    return np.asarray((matrices + np.swapaxes(matrices, -1, -2)) / 2)


def objective_of(problem: DurationProblem, measure: Measure, *, within: Array | None = None) -> Objective:
    """A measure over the models of the problem.

    Args:
        problem: the symmetric parts of its matrices count.
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


def information_floor(floor: InformationFloor) -> Objective:
    """A least information as a concave function that must not be negative: the log of its share of what is asked for.

    Raises:
        FloorOutOfReach: equal shares have no such information, so that no shares do.
    """
    try:
        asked = LogTrace(floor.L * np.sqrt(floor.least))
        pieces = pieces_of([symmetric_part(floor.matrices)], symmetric_part(floor.prior), asked)
    except NotInformative:
        raise FloorOutOfReach(floor.name, share=0.0) from None
    return Objective(pieces, np.zeros(1))


def least_of_floors(problem: DurationProblem) -> Objective:
    """The objective of criterion T: the least of what is told of other parameters, as a share of what is asked for.

    Raises:
        InputError: nothing is asked for.
    """
    if not problem.floors:
        raise InputError("criterion T needs causes in design.reveal or design.tell_apart")
    pieces = tuple(information_floor(item).pieces[0] for item in problem.floors)
    return Objective(pieces, np.zeros(len(pieces)), worst=True)


def polytope_of(problem: DurationProblem) -> Polytope:
    """The linear limits.

    Raises:
        UnknownName, InputError, NoAnswer: see `feasible_set`.
    """
    return feasible_set(problem.constraints, problem.names, run_s=problem.run_s, total_s=problem.total_s)


def limits_of(problem: DurationProblem) -> Polytope:
    """The linear limits of fractions (q,) of sum 1 or less.

    Raises:
        UnknownName, InputError, NoAnswer: see `feasible_set`.
    """
    whole, count = polytope_of(with_idle(problem)), len(problem.names)
    return replace(whole, least=whole.least[:count], most=whole.most[:count], rows=whole.rows[:, :count])


def with_idle(problem: DurationProblem) -> DurationProblem:
    """The problem with an idle primitive at its end, without information and cost, for unused time."""
    idle = np.zeros((1, *problem.matrices.shape[1:]))
    sampled = problem.sampled
    if len(sampled):
        sampled = np.concatenate([sampled, np.zeros((len(sampled), *idle.shape))], axis=1)
    return replace(
        problem,
        names=(*problem.names, IDLE),
        matrices=np.concatenate([problem.matrices, idle]),
        run_s=np.r_[problem.run_s, problem.total_s],
        sampled=sampled,
        floors=tuple(
            replace(item, matrices=np.concatenate([item.matrices, np.zeros((1, *item.prior.shape))]))
            for item in problem.floors
        ),
    )


def collected_measure(problem: DurationProblem, name: str) -> Measure:
    """The measure of a criterion for fractions of any sum: means are eliminated, not counted."""
    if name == "D":
        return LogDet(problem.picked.columns(problem.parameters))
    return criterion(name).measure(problem.picked)


@dataclass(frozen=True, kw_only=True, eq=False)
class Collected:
    """The criterion as a function of time shares of any sum."""

    pieces: tuple[Piece, ...]  # one for each model
    worst: bool  # the least over models instead of the average
    symmetric: bool = True  # whether matrices are symmetric; else the magnitude of the determinant counts

    @staticmethod
    def of(problem: DurationProblem, name: str | None = None) -> Collected:
        """Models and measures of the problem's criterion, or of a named one.

        Raises:
            UnknownName, InputError: no such criterion, or the aim lacks settings for it.
            NotInformative: equal shares do not inform about every parameter.
        """
        name = name or problem.aim.criterion
        if name == T:
            return Collected(pieces=least_of_floors(problem).pieces, worst=True)
        measure = collected_measure(problem, name)
        if not problem.symmetric:
            return Collected(pieces=(_unsymmetric(problem, measure),), worst=False, symmetric=False)
        objective = objective_of(problem, measure)
        return Collected(pieces=objective.pieces, worst=objective.worst)

    @property
    def degree(self) -> int:
        """Doubling the information raises the value by degree x log 2."""
        return self.pieces[0].measure.degree

    def totals(self, shares: Array) -> tuple[Array, ...]:
        """(d, d) information for each model: the prior plus that of shares (q,)."""
        return tuple(piece.matrix(shares) for piece in self.pieces)

    def values(self, totals: tuple[Array, ...]) -> Array:
        """(c,) values of (c, d, d) for each model, -inf where one is singular."""
        if not self.symmetric:
            return self.regular_values(totals)
        return self._over_models(
            [stacked_values(piece.measure, total) for piece, total in zip(self.pieces, totals, strict=True)]
        )

    def regular_values(self, totals: tuple[Array, ...]) -> Array:
        """As `values`, for totals that are known to be positive definite."""
        return self._over_models(
            [piece.measure.values(total) for piece, total in zip(self.pieces, totals, strict=True)]
        )

    def _over_models(self, values: list[Array]) -> Array:
        return np.asarray(np.min(values, axis=0) if self.worst else np.mean(values, axis=0))

    def value(self, shares: Array) -> float:
        """Value of time shares (q,)."""
        if not shares.any() and not any(piece.prior.any() for piece in self.pieces):
            return -np.inf
        return float(self.values(tuple(total[None] for total in self.totals(shares)))[0])

    def efficiency(self, shares: Array, reference: Array) -> float:
        """Share of the time in which the reference collects the same, without prior information."""
        return float(np.exp((self.value(shares) - self.value(reference)) / self.degree))

    def efficiency_of(self, collected: Array, reference: Array) -> float:
        """Efficiency of given information (d, d), in physical parameter scale; one model only."""
        piece = self.pieces[0]
        total = piece.prior + congruent(piece.transformation, collected)
        return float(np.exp((self.values((total[None],))[0] - self.value(reference)) / self.degree))


def _unsymmetric(problem: DurationProblem, measure: Measure) -> Piece:
    """Recorded primitives, scaled to unit mean squares, for the log of the determinant's magnitude."""
    T = np.diag(1.0 / unit_scaling(problem))
    return Piece(T @ problem.matrices @ T, T @ problem.prior @ T, measure.transformed(T), T)


def informs_about_all(problem: DurationProblem, collected: Collected, shares: Array) -> bool:
    """Whether time shares (q,) inform about every parameter, with coinciding nuisance regressors merged."""
    if not collected.symmetric:
        return bool(np.isfinite(collected.value(shares)))
    if not np.isfinite(collected.value(shares)):
        return False
    return _regular(collected, shares) or (bool(problem.nuisance) and not unidentifiable(problem, shares))


def _regular(collected: Collected, shares: Array) -> bool:
    values = [np.linalg.eigvalsh(total) for total in collected.totals(shares)]
    return all(item[0] > SINGULAR * item[-1] for item in values)


def unidentifiable(problem: DurationProblem, shares: Array) -> tuple[str, ...]:
    """Parameters that are not identifiable from time shares (q,), by the nominal model."""
    scaled, dark = _scaled(problem, shares)
    merged = _merged(problem, scaled)
    kept = np.array([i for i in range(problem.dimension) if i not in merged and not dark[i]], dtype=int)
    names = _names(problem)
    found = {names[i] for i in np.flatnonzero(dark) if i < len(problem.parameters)}
    if len(kept):
        values, vectors = np.linalg.eigh(scaled[np.ix_(kept, kept)])
        null = vectors[:, values < NEGLIGIBLE * values[-1]]
        found |= {names[i] for i in kept[np.linalg.norm(null, axis=1) > SMALL_WEIGHT]}
    return tuple(name for name in problem.parameters if name in found)


def merged_nuisance(problem: DurationProblem, shares: Array) -> tuple[tuple[str, str], ...]:
    """Pairs of a nuisance parameter and the one that it coincides with under time shares (q,)."""
    scaled, _ = _scaled(problem, shares)
    names = _names(problem)
    return tuple((names[i], names[j]) for i, j in _merged(problem, scaled).items())


def _names(problem: DurationProblem) -> tuple[str, ...]:
    return problem.parameters + ("a constant",) * (problem.dimension - len(problem.parameters))


def _scaled(problem: DurationProblem, shares: Array) -> tuple[Array, Array]:
    """(d, d) symmetric information with a unit diagonal, and (d,) whether a parameter has no information."""
    total = problem.prior + np.tensordot(shares, problem.matrices, axes=1)
    total = (total + total.T) / 2
    most = np.abs(np.diagonal(problem.matrices, axis1=1, axis2=2)).max(axis=0) + np.abs(np.diag(problem.prior))
    size = np.sqrt(np.clip(np.diag(total), 0.0, None))
    dark = size <= np.sqrt(NEGLIGIBLE * most)
    size = np.where(dark, 1.0, size)
    return total / np.outer(size, size), dark


def _merged(problem: DurationProblem, scaled: Array) -> dict[int, int]:
    """Nuisance columns that coincide with an earlier nuisance column, or with the constants of subtracted means."""
    p = len(problem.parameters)
    nuisance = [i for i, name in enumerate(problem.parameters) if name in problem.nuisance]
    found: dict[int, int] = {}
    for place, i in enumerate(nuisance):
        for j in (*range(p, problem.dimension), *nuisance[:place]):
            if j not in found and abs(scaled[i, j]) > 1.0 - COINCIDE:
                found[i] = j
                break
    return found
