"""The covariance of weighted sums of noise that consists of parts, ends of batches included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.estimation.noise.components import Components
from expdesign.estimation.noise.parts import SENSOR, Slow, filtered
from expdesign.estimation.noise.timeline import Stretch
from expdesign.values import Array


@dataclass(frozen=True, eq=False)
class Scores:
    """How sums over samples of W eps vary, for outputs o with W (k, p_o).

    Attributes:
        blocks: (p_o, p_o') covariances of the sums of outputs o and o'.
        doubts: (p_o,) variance of each estimated variance.
    """

    blocks: list[list[Array]]
    doubts: list[Array]


def score_covariance(
    W: Sequence[Array], residuals: Array, fitted: Sequence[Components], parts: Sequence[Stretch]
) -> Scores:
    """The covariance of sum W_o eps_o, and how well the variances are known that it is made of.

    Parts of different outputs are as correlated as the outputs' residuals are at the same sample.

    Args:
        W: (k, p_o) for each output.
        residuals: (k, n).
        fitted: the parts of each output.
        parts: `stretches`.
    """
    variances = np.array([item.variances for item in fitted])
    doubted = np.array([np.diag(item.uncertainty) > 0 for item in fitted])
    blocks, units = sums_of_parts(W, variances, fitted[0].slow, _common(residuals, variances), parts, doubted)
    doubts = [np.einsum("ip,ij,jp->p", own, item.uncertainty, own) for own, item in zip(units, fitted, strict=True)]
    return Scores(blocks, doubts)


def sums_of_parts(
    W: Sequence[Array],
    variances: Array,
    slow: Sequence[Slow],
    common: Array,
    parts: Sequence[Stretch],
    doubted: NDArray[np.bool_],
) -> tuple[list[list[Array]], list[Array]]:
    """Covariances (p_o, p_o') of sum W_o eps_o, and what each part adds to variances if its own is one (2 + m, p_o).

    Args:
        W: (k, p_o) for each output.
        variances: (n, 2 + m) of each output's parts.
        slow: the m slow parts.
        common: (n, n) correlation of the outputs' parts.
        parts: `stretches`.
        doubted: (n, 2 + m) parts without variance whose own sums are asked for all the same.
    """
    blocks = [[np.zeros((a.shape[1], b.shape[1])) for b in W] for a in W]
    units = [np.zeros((variances.shape[1], a.shape[1])) for a in W]
    for part in parts:
        wide = [part.spread(item[part.rows]) for item in W]
        for index, scale in enumerate(np.sqrt(variances.T)):
            for o in np.flatnonzero((scale > 0) | doubted[:, index]).tolist():
                turned = filtered(index, slow, wide[o], part.turn)
                units[o][index] += np.einsum("kp,kp->p", wide[o], turned)
                for other in np.flatnonzero(scale[: o + 1] * common[o, : o + 1]).tolist():
                    blocks[other][o] += scale[o] * scale[other] * common[o, other] * (wide[other].T @ turned)
    for o in range(len(W)):
        for other in range(o):
            blocks[o][other] = blocks[other][o].T
    return blocks, units


def _common(residuals: Array, variances: Array) -> Array:
    """(n, n) correlation that parts with variances (n, 2 + m) share."""
    level, roots = np.ones(variances.shape[1]), np.sqrt(variances)
    level[SENSOR] = 2.0
    moments, explained = residuals.T @ residuals / len(residuals), (roots * level) @ roots.T
    return as_correlation(np.divide(moments, explained, out=np.zeros_like(moments), where=explained > 0))


def as_correlation(found: Array) -> Array:
    """(n, n) correlation matrix near the one found: ones on the diagonal, none above one, positive semidefinite."""
    found = np.clip(found, -1.0, 1.0)
    np.fill_diagonal(found, 1.0)
    least = float(np.linalg.eigvalsh(found)[0])
    return found if least >= 0 else np.asarray((found - least * np.eye(len(found))) / (1.0 - least))
