"""What times on primitives tell apart, nuisance regressors that coincide counted once.

A nuisance regressor that stands for a disturbance may coincide with another one, up to its sign, as long as nothing
inside a modulus changes its sign: sign(v) r cos psi is then r cos psi, and sign(v) a constant. Estimators merge such
regressors (`estimation.nuisance`), so runs that do not tell them apart lack nothing. The ship's parameters have to be
told apart by all means.
"""

from __future__ import annotations

import numpy as np

from expdesign.durations.values import DurationProblem
from expdesign.values import Array

COINCIDE = 1e-9
"""Regressors coincide whose correlation, means not taken off, falls short of 1 by less."""
NULL = 1e-12
"""Eigenvalues of scaled information below this, relative to the largest, are rounding."""
SMALL_WEIGHT = 0.05
"""Parameters with less weight in a null vector are not named."""


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
