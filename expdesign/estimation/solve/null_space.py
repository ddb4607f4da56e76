"""Parameters that data cannot determine: the null space of the scaled moment matrix, in words.

The moment matrix sum Z Phi^T is scaled so that its size does not depend on units; each singular vector is a combination
of parameters, and its singular value says how much of that combination's effect the data show. Combinations are sought
within groups of parameters that share an output, and null spaces of several dimensions are given by their sparsest
vectors, so that the sentences stay short.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.errors import NotInformative
from expdesign.values import Array, sealed

UNSEEN = 1e-10  # relative singular value below which a combination of parameters is not visible in the data
FAINT = 1e-5  # relative singular value below which least squares gets a warning
WEAK_STATISTIC = 10.0  # Cragg-Donald statistic per instrument below which instruments get a warning
SMALL_WEIGHT = 0.05  # least weight of a parameter that a message names
NAMED_PARAMETERS = 4  # most parameters of a combination that a message names


@sealed(weights="k")
class Direction:
    """One combination of parameters."""

    parameters: tuple[str, ...]  # names, largest weight first
    weights: Array  # one per name, in units of each parameter's effect on the data; squares sum to about 1
    strength: float  # singular value of the scaled moment matrix along it, relative to the largest of its equation
    change: Mapping[str, float]  # name -> how far it goes in the parameter's own unit, of all parameters

    def __str__(self) -> str:
        pairs = list(zip(self.parameters, self.weights.tolist(), strict=True))[:NAMED_PARAMETERS]
        text = " ".join(f"{'-' if weight < 0 else '+'} {abs(weight):.2f} {name}" for name, weight in pairs)
        more = f" and {len(self.parameters) - NAMED_PARAMETERS} more" if len(self.parameters) > NAMED_PARAMETERS else ""
        names = " and ".join(name for name, _ in pairs)
        return f"{names}: {text.removeprefix('+ ')}{more}" if len(pairs) > 1 else self.parameters[0]


@sealed(singular_values="p")
class NullSpace:
    """The report."""

    singular_values: Array  # (p,) of the scaled moment matrix, relative to the largest of their equation, falling
    unseen: tuple[Direction, ...]  # combinations that the data do not show at all
    # combinations so weakly shown that they cannot be told from chance (instruments) or rounding
    faint: tuple[Direction, ...]


@dataclass(frozen=True, eq=False)
class _Axes:
    """Parameters, and the norms (p,) of their regressors by which moments are scaled."""

    names: tuple[str, ...]
    size: Array  # infinite for those without variation

    def direction(self, vector: Array, strength: float) -> Direction:
        order = [int(i) for i in np.argsort(-np.abs(vector)) if abs(vector[i]) > SMALL_WEIGHT]
        signed = vector * np.sign(vector[order[0]])
        change = signed / np.where(np.isfinite(self.size), self.size, 1.0)
        return Direction(
            parameters=tuple(self.names[i] for i in order), weights=signed[order], strength=strength,
            change=dict(zip(self.names, change.tolist(), strict=True)),
        )  # fmt: skip


def null_space(
    moment: Array, names: tuple[str, ...], size: Array, *, samples: int, exogenous: bool, second: Second | None = None
) -> NullSpace:
    """The report on the scaled moment matrix (q, p) of parameters that share outputs.

    Args:
        moment: instruments against regressors, each scaled to unit norm over the data (columns without variation zero).
        names: of the p parameters.
        size: (p,) those norms; infinite without variation.
        samples: number of rows behind the moments.
        exogenous: the instruments are the regressors themselves.
        second: second moments (q, q) of instruments and (p, p) of regressors, scaled alike, to find what is weakly
            instrumented; without them nothing is.
    """
    axes = _Axes(names, size)
    sizes, rows = _right_vectors(moment)
    top = max(float(sizes[0]), 1e-300)
    dark = sizes <= UNSEEN * top
    unseen = [axes.direction(vector, 0.0) for vector in _sparse(rows[dark])]
    faint: list[Direction] = []
    if exogenous:
        weak = ~dark & (sizes <= FAINT * top)
        faint = [axes.direction(row, float(value / top)) for value, row in zip(sizes[weak], rows[weak], strict=True)]
    elif second is not None and not dark.any():
        faint = _weak(moment, second, axes, samples)
    return NullSpace(singular_values=sizes / top, unseen=tuple(unseen), faint=tuple(faint))


def joined(parts: Sequence[NullSpace]) -> NullSpace:
    """One report from those of parameters that share no output."""
    return NullSpace(
        singular_values=np.sort(np.concatenate([part.singular_values for part in parts]))[::-1],
        unseen=tuple(direction for part in parts for direction in part.unseen),
        faint=tuple(direction for part in parts for direction in part.faint),
    )


Second = tuple[Array, Array]


def _weak(G: Array, second: Second, axes: _Axes, samples: int) -> list[Direction]:
    """Combinations whose regressor the instruments explain hardly better than chance would.

    Source: J. G. Cragg and S. G. Donald, Econometric Theory 9 (1993), 222-240; J. H. Stock and M. Yogo, in
    Identification and Inference for Econometric Models (2005), 80-108.
    """
    instruments, regressors = second
    explained = G.T @ np.linalg.pinv(instruments, rcond=1e-12, hermitian=True) @ G
    left = regressors - explained
    left = left + max(1e-9, -2.0 * float(np.linalg.eigvalsh(left)[0])) * np.eye(len(left))  # rounding
    ratios, vectors = scipy.linalg.eigh((explained + explained.T) / 2, (left + left.T) / 2)
    statistics = ratios * samples / len(axes.names)
    weak = statistics < WEAK_STATISTIC
    unit = vectors / np.linalg.norm(vectors, axis=0)
    return [axes.direction(unit[:, i], float(np.clip(ratios[i], 0.0, 1.0))) for i in np.flatnonzero(weak)]


def require_informative(found: NullSpace) -> None:
    """Refuse data that do not determine all parameters.

    Raises:
        NotInformative: naming every combination.
    """
    if not found.unseen:
        return
    names = tuple(dict.fromkeys(name for direction in found.unseen for name in direction.parameters))
    listed = "; ".join(str(direction) for direction in found.unseen)
    kept: list[str] = []  # of each combination one, with which the others are determined
    for direction in found.unseen:
        kept += sorted(set(direction.parameters) - set(kept))[-1:]  # rudder2 rather than rudder1
    raise NotInformative(
        f"the data contain no information about these parameters or combinations: {listed}; excite them, or fix "
        f"{' '.join(sorted(kept))}",
        parameters=names,
        unseen=tuple(direction.change for direction in found.unseen),
        fix=tuple(sorted(kept)),
    )


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
