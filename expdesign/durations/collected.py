"""What a set of runs, or any times, are worth: the criterion of the information collected, not per second."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.durations.criteria import Measure
from expdesign.durations.objective import Piece, congruent, stacked_values
from expdesign.durations.task import collected_measure, objective_of
from expdesign.durations.values import DurationProblem
from expdesign.values import Array


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
