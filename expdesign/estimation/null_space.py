"""What the data cannot see: the null space of the scaled moment matrix, in words.

The moment matrix sum Z Phi^T is scaled so that its size does not depend on units; each singular vector is a combination
of parameters, and its singular value says how much of that combination's effect the data show. Combinations are sought
within groups of parameters that share an output, and null spaces of several dimensions are given by their sparsest
vectors, so that the sentences stay short.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.errors import NotInformative
from expdesign.estimation.regression import Regression
from expdesign.values import Array, seal

UNSEEN = 1e-10
"""Relative singular value below which a combination is invisible to working precision."""
FAINT = 1e-5
"""The same for combinations that least squares sees so faintly that estimates along them mean little."""
SMALL_WEIGHT = 0.05
"""Parameters with less than this weight are left out of sentences."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Direction:
    """One combination of parameters.

    Attributes:
        parameters: names, largest weight first.
        weights: one per name, in units of each parameter's effect on the data; squares sum to about 1.
        strength: singular value of the scaled moment matrix along it, relative to the largest of its equation.
    """

    parameters: tuple[str, ...]
    weights: Array
    strength: float

    def __post_init__(self) -> None:
        seal(self, weights="k")

    def __str__(self) -> str:
        parts = [f"{weight:+.2f} {name}" for name, weight in zip(self.parameters, self.weights, strict=True)]
        text = " ".join(f"{part[0]} {part[1:]}" for part in parts).removeprefix("+ ")
        return f"{' and '.join(self.parameters)}: {text}" if len(parts) > 1 else self.parameters[0]


@dataclass(frozen=True, kw_only=True, eq=False)
class NullSpace:
    """The report.

    Attributes:
        singular_values: (p,) of the scaled moment matrix, relative to the largest of their equation, falling.
        unseen: combinations that the data do not show at all.
        faint: combinations so weakly shown that they cannot be told from chance (instruments) or rounding.
    """

    singular_values: Array
    unseen: tuple[Direction, ...]
    faint: tuple[Direction, ...]

    def __post_init__(self) -> None:
        seal(self, singular_values="p")


def null_space(moment: Array, regression: Regression, *, exogenous: bool) -> NullSpace:
    """The report on a scaled moment matrix (q, p), columns in parameter order.

    Args:
        moment: instruments against regressors, each scaled to unit norm over the data (columns without variation zero).
        regression: for names and for which parameters share an output.
        exogenous: instruments are the regressors themselves; otherwise chance correlation sets what is faint.
    """
    values: list[float] = []
    unseen: list[Direction] = []
    faint: list[Direction] = []
    limit = FAINT if exogenous else 3.0 / np.sqrt(len(regression))
    for group in _groups(regression):
        part = moment[:, group]
        sizes, rows = _right_vectors(part)
        top = max(float(sizes[0]), 1e-300)
        values += (sizes / top).tolist()
        names = tuple(regression.parameters[index] for index in group)
        dark = sizes <= UNSEEN * top
        unseen += [_direction(names, vector, 0.0) for vector in _sparse(rows[dark])]
        weak = ~dark & (sizes <= limit * (top if exogenous else 1.0))
        faint += [
            _direction(names, vector, float(size / top)) for size, vector in zip(sizes[weak], rows[weak], strict=True)
        ]
    return NullSpace(singular_values=np.sort(values)[::-1], unseen=tuple(unseen), faint=tuple(faint))


def require_informative(found: NullSpace) -> None:
    """Refuse to estimate what the data cannot see.

    Raises:
        NotInformative: naming every combination.
    """
    if not found.unseen:
        return
    names = tuple(dict.fromkeys(name for direction in found.unseen for name in direction.parameters))
    listed = "; ".join(str(direction) for direction in found.unseen)
    raise NotInformative(
        f"the data cannot see these parameters or combinations: {listed}; excite them, or hold some of them fixed",
        parameters=names,
    )


def _groups(regression: Regression) -> list[list[int]]:
    """Parameters that are tied together through outputs."""
    uses = (regression.Phi != 0).any(axis=0)  # (n, p)
    count, labels = scipy.sparse.csgraph.connected_components(uses.T.astype(int) @ uses.astype(int), directed=False)
    return [np.flatnonzero(labels == label).tolist() for label in range(count)]


def _right_vectors(matrix: Array) -> tuple[Array, Array]:
    """Singular values and right singular vectors in rows, one per column of the matrix."""
    _, sizes, rows = np.linalg.svd(matrix, full_matrices=True)
    padded = np.zeros(matrix.shape[1])
    padded[: len(sizes)] = sizes
    return padded, rows


def _sparse(basis: Array) -> Array:
    """Another basis of the same space with as many zeros as elimination with pivoting makes."""
    if len(basis) < 2:
        return basis
    _, _, pivots = scipy.linalg.qr(basis, pivoting=True)
    reduced = np.linalg.solve(basis[:, pivots[: len(basis)]], basis)
    return np.asarray(reduced / np.linalg.norm(reduced, axis=1, keepdims=True))


def _direction(names: tuple[str, ...], vector: Array, strength: float) -> Direction:
    order = [int(i) for i in np.argsort(-np.abs(vector)) if abs(vector[i]) > SMALL_WEIGHT]
    signed = vector * np.sign(vector[order[0]])
    return Direction(parameters=tuple(names[i] for i in order), weights=signed[order], strength=strength)
