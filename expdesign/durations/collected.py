"""What times are worth that need not fill the total: their criterion, and the parameters that they tell apart.

A nuisance regressor that stands for a disturbance may coincide with another one, up to its sign, as long as nothing
inside a modulus changes its sign: sign(v) r cos psi is then r cos psi, and sign(v) a constant. Estimators merge such
regressors (`estimation.nuisance`), so runs that do not tell them apart lack nothing. The ship's parameters have to be
told apart by all means.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.durations.concave import collected_measure, objective_of
from expdesign.durations.criteria import Measure
from expdesign.durations.criteria.models import SINGULAR, Piece, congruent, stacked_values
from expdesign.durations.problem import DurationProblem
from expdesign.values import Array

COINCIDE = 1e-9
"""Regressors coincide whose correlation, means not taken off, falls short of 1 by less."""
NULL = 1e-12
"""Eigenvalues of scaled information below this, relative to the largest, are rounding."""
SMALL_WEIGHT = 0.05
"""Parameters with less weight in a null vector are not named."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Collected:
    """The criterion as a function of time shares that need not sum to one.

    Attributes:
        pieces: one for each model.
        worst: the least over models instead of the average.
        symmetric: whether matrices are; the determinant of others may have either sign, and its magnitude counts.
    """

    pieces: tuple[Piece, ...]
    worst: bool
    symmetric: bool = True

    @staticmethod
    def of(problem: DurationProblem, name: str | None = None) -> Collected:
        """For the problem's criterion or a named one.

        Raises:
            UnknownName, InputError: no such criterion, or the aim does not say enough for it.
            NotInformative: equal shares do not inform about every parameter.
        """
        measure = collected_measure(problem, name or problem.aim.criterion)
        if not problem.symmetric:
            return Collected(pieces=(_unsymmetric(problem, measure),), worst=False, symmetric=False)
        objective = objective_of(problem, measure)
        return Collected(pieces=objective.pieces, worst=objective.worst)

    @property
    def degree(self) -> int:
        """Value of twice the information is higher by degree x log 2."""
        return self.pieces[0].measure.degree

    def totals(self, shares: Array) -> tuple[Array, ...]:
        """(d, d) for each model: prior and what the shares (q,) collect."""
        return tuple(piece.matrix(shares) for piece in self.pieces)

    def worth(self, totals: tuple[Array, ...]) -> Array:
        """(c,) values of (c, d, d) for each model, -inf where one is singular."""
        if not self.symmetric:
            return self.compared(totals)
        return self._over_models(
            [stacked_values(piece.measure, total) for piece, total in zip(self.pieces, totals, strict=True)]
        )

    def compared(self, totals: tuple[Array, ...]) -> Array:
        """As `worth`, for totals that are known to be positive definite."""
        return self._over_models(
            [piece.measure.values(total) for piece, total in zip(self.pieces, totals, strict=True)]
        )

    def _over_models(self, values: list[Array]) -> Array:
        return np.asarray(np.min(values, axis=0) if self.worst else np.mean(values, axis=0))

    def value(self, shares: Array) -> float:
        """Value of time shares (q,)."""
        if not shares.any() and not any(piece.prior.any() for piece in self.pieces):
            return -np.inf
        return float(self.worth(tuple(total[None] for total in self.totals(shares)))[0])

    def efficiency(self, shares: Array, reference: Array) -> float:
        """Share of the reference's time in which it would collect the same, when nothing is known before."""
        return float(np.exp((self.value(shares) - self.value(reference)) / self.degree))

    def efficiency_of(self, collected: Array, reference: Array) -> float:
        """The same of information (d, d) that was collected otherwise, in physical parameter scale; one model only."""
        piece = self.pieces[0]
        total = piece.prior + congruent(piece.transformation, collected)
        return float(np.exp((self.worth((total[None],))[0] - self.value(reference)) / self.degree))


def _unsymmetric(problem: DurationProblem, measure: Measure) -> Piece:
    """Recorded primitives, scaled to unit mean squares; only the log of the determinant's magnitude makes sense."""
    diagonal = np.abs(np.diagonal(problem.matrices, axis1=1, axis2=2)).mean(axis=0) + np.abs(np.diag(problem.prior))
    T = np.diag(1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)))
    return Piece(T @ problem.matrices @ T, T @ problem.prior @ T, measure.transformed(T), T)


def sees_everything(problem: DurationProblem, collected: Collected, shares: Array) -> bool:
    """Whether time shares (q,) inform about every parameter, nuisance regressors that coincide counted once."""
    if not collected.symmetric:
        return bool(np.isfinite(collected.value(shares)))
    if not np.isfinite(collected.value(shares)):
        return False
    return _regular(collected, shares) or (bool(problem.nuisance) and not unseen(problem, shares))


def _regular(collected: Collected, shares: Array) -> bool:
    values = [np.linalg.eigvalsh(total) for total in collected.totals(shares)]
    return all(item[0] > SINGULAR * item[-1] for item in values)


def unseen(problem: DurationProblem, shares: Array) -> tuple[str, ...]:
    """Parameters that time shares (q,) do not tell apart by the nominal model; empty when all are."""
    scaled, dark = _scaled(problem, shares)
    merged = _merged(problem, scaled)
    kept = np.array([i for i in range(problem.dimension) if i not in merged and not dark[i]], dtype=int)
    names = _names(problem)
    found = {names[i] for i in np.flatnonzero(dark) if i < len(problem.parameters)}
    if len(kept):
        values, vectors = np.linalg.eigh(scaled[np.ix_(kept, kept)])
        null = vectors[:, values < NULL * values[-1]]
        found |= {names[i] for i in kept[np.linalg.norm(null, axis=1) > SMALL_WEIGHT]}
    return tuple(name for name in problem.parameters if name in found)


def merged_nuisance(problem: DurationProblem, shares: Array) -> tuple[tuple[str, str], ...]:
    """Pairs of a nuisance parameter and what it coincides with under time shares (q,)."""
    scaled, _ = _scaled(problem, shares)
    names = _names(problem)
    return tuple((names[i], names[j]) for i, j in _merged(problem, scaled).items())


def _names(problem: DurationProblem) -> tuple[str, ...]:
    return problem.parameters + ("a constant",) * (problem.dimension - len(problem.parameters))


def _scaled(problem: DurationProblem, shares: Array) -> tuple[Array, Array]:
    """(d, d) symmetric information with a unit diagonal, and (d,) where there is none."""
    total = problem.prior + np.tensordot(shares, problem.matrices, axes=1)
    total = (total + total.T) / 2
    most = np.abs(np.diagonal(problem.matrices, axis1=1, axis2=2)).max(axis=0) + np.abs(np.diag(problem.prior))
    size = np.sqrt(np.clip(np.diag(total), 0.0, None))
    dark = size <= np.sqrt(NULL * most)
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
