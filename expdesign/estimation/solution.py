"""LS and IV: the estimate, its covariance and its residuals, from a regression and instruments.

    theta = (sum Z Phi^T)^-1 sum Z y                          LS is IV with Z = Phi
    P = G^-1 Omega G^-T,   G = sum Z Phi^T,   Omega = long-run covariance of Z(k) eps(k)

Residuals of one-step predictors from noisy data are coloured (noise enters at k and, through Phi, at k - 1), so Omega
is by default robust to both changing variance and correlation in time ("hac"). "hc0" and "hc1" are robust to
changing variance only, and "kernel" to both but without the correction that "hac" makes for the share of the variance
that is lost because the scores of an estimate sum to zero: these three are as in econometric software.

With one block of instruments per batch there are more equations than unknowns; they are weighted by the inverse second
moments of the instruments (two-stage least squares), which keeps the estimate free of the scale of parameters, or by
weights of the caller.

Source: F. Ljungberg, doctoral thesis, Linköping University, (2.17), (2.21), (4.45); L. P. Hansen, Econometrica 50
(1982), 1029-1054.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy

from expdesign.errors import InputError, ShapeError, UnknownName
from expdesign.estimation.long_run import automatic_lags, long_run_covariance, lost_share
from expdesign.estimation.null_space import NullSpace, joined, null_space, require_informative
from expdesign.estimation.regression import Integers, Regression, batch_slices
from expdesign.estimation.zero_mean import subtract_mean
from expdesign.values import Array, seal

COVARIANCES = ("hac", "kernel", "hc1", "hc0")
BLOCKS = ("one", "batch")


@dataclass(frozen=True, kw_only=True)
class Weighting:
    """How equations are formed and what the covariance allows for.

    Attributes:
        mean: subtracted from the instruments, one of `zero_mean.MEANS`.
        blocks: "one" block of instruments for all batches, or one per "batch" (4.45).
        batch_weights: one factor per batch, how much its equations count; () for all alike.
        output_weights: one factor per output, how much its equation counts; () for all alike.
        covariance: one of `COVARIANCES`.
        kernel: of the "hac" and "kernel" covariance.
        lags: their last lag, None for automatic.
    """

    mean: str = "none"
    blocks: str = "one"
    batch_weights: tuple[float, ...] = ()
    output_weights: tuple[float, ...] = ()
    covariance: str = "hac"
    kernel: str = "parzen"
    lags: int | None = None

    def __post_init__(self) -> None:
        for what, value, known in (
            ("instrument blocks", self.blocks, BLOCKS),
            ("covariance", self.covariance, COVARIANCES),
        ):
            if value not in known:
                raise UnknownName(what, value, known=known)
        for name in ("batch_weights", "output_weights"):
            if not all(0 < weight < np.inf for weight in getattr(self, name)):
                raise InputError(f"{name} {getattr(self, name)} need to be positive numbers")


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """What a regression says.

    Attributes:
        values: (p,) estimate.
        covariance: (p, p) of the estimate.
        residuals: (k, n) one-step residuals; with zero-mean instruments without their mean.
        lags: last lag that the covariance counts.
        null_space: what the data cannot see.
    """

    values: Array
    covariance: Array
    residuals: Array
    lags: int
    null_space: NullSpace = field(repr=False)

    def __post_init__(self) -> None:
        seal(self, values="p", covariance="p p", residuals="k n")


def solve_ls(regression: Regression, weighting: Weighting | None = None) -> Solution:
    """Least squares; arguments and errors as in `solve_iv`."""
    return solve_iv(regression, regression.Phi, weighting)


def solve_iv(regression: Regression, instruments: Array, weighting: Weighting | None = None) -> Solution:
    """Instrumental variables.

    Args:
        regression: the data.
        instruments: (k, n, p), one instrument per parameter.
        weighting: how equations are formed; one block, no mean subtraction when left out.

    Raises:
        NotInformative: some parameters cannot be told apart; the message names the combinations.
        ShapeError: the instruments do not fit the regression.
        InputError: weights that do not fit, or blocks per batch with a mean subtracted over all of them.
    """
    weighting = weighting or Weighting()
    _check(regression, instruments, weighting)
    exogenous = instruments is regression.Phi
    systems = [_system(regression, instruments, group, weighting) for group in _groups(regression, instruments)]
    solved = [_solvers(system, weighting, exogenous=exogenous) for system in systems]
    found = joined([report for _, report in solved])
    require_informative(found)
    k, p = len(regression), len(regression.parameters)
    values, residuals, scores = np.zeros(p), np.array(regression.y), np.zeros((k, p))
    for system, (parts, _) in zip(systems, solved, strict=True):
        theta = _influences(system.Z, system.y, parts).sum(axis=0)
        left = subtract_mean(system.y - system.Phi @ theta, regression.batch_of, weighting.mean)
        values[system.columns], residuals[:, system.outputs] = theta, left
        scores[:, system.columns] = _influences(system.Z, left, parts)
    lags = _lags(scores, regression, weighting)
    P = long_run_covariance(scores, regression.batch_of, regression.step_of, lags=lags, kernel=weighting.kernel)
    factor = 1.0 if weighting.covariance == "hc0" else residuals.size / max(1, residuals.size - p)
    if weighting.covariance == "hac":
        factor /= 1.0 - lost_share(k, lags=lags, kernel=weighting.kernel)
    return Solution(values=values, covariance=factor * P, residuals=residuals, lags=lags, null_space=found)


@dataclass(frozen=True, eq=False)
class System:
    """The part of a regression that some parameters and outputs have to themselves.

    Attributes:
        names: of the parameters.
        columns, outputs: places in the regression.
        Phi: (k, n, p) regressors.
        varying: (k, n, p) the same without the mean that is subtracted from instruments.
        Z: (k, n, p) instruments without mean, weighted.
        y: (k, n).
        parts: rows of each batch.
    """

    names: tuple[str, ...]
    columns: Integers
    outputs: Integers
    Phi: Array
    varying: Array
    Z: Array
    y: Array
    parts: list[slice]


Group = tuple[Integers, Integers]
"""Places of parameters, and of the outputs they act on."""


def _groups(regression: Regression, instruments: Array) -> list[Group]:
    """Parameters tied together through outputs; in ship models every equation is a group of its own."""
    uses = ((regression.Phi != 0) | (instruments != 0)).any(axis=0)  # (n, p)
    ties = uses.T.astype(int) @ uses.astype(int)
    count, labels = scipy.sparse.csgraph.connected_components(ties, directed=False)
    columns = [np.flatnonzero(labels == label) for label in range(count)]
    return [(places, np.flatnonzero(uses[:, places].any(axis=1))) for places in columns]


def _system(regression: Regression, instruments: Array, group: Group, weighting: Weighting) -> System:
    columns, outputs = group
    cut = (slice(None), outputs[:, None], columns)
    Phi, Z = regression.Phi[cut], subtract_mean(instruments[cut], regression.batch_of, weighting.mean)
    if weighting.output_weights:
        Z = Z * np.array(weighting.output_weights)[outputs, None]
    return System(
        names=tuple(regression.parameters[index] for index in columns),
        columns=columns,
        outputs=outputs,
        Phi=Phi,
        varying=subtract_mean(Phi, regression.batch_of, weighting.mean),
        Z=Z,
        y=regression.y[:, outputs],
        parts=batch_slices(regression.batch_of),
    )


Part = tuple[slice, Array]
"""Rows of one batch, and A (p, p) with theta = sum over batches of A sum Z y."""


def _influences(Z: Array, y: Array, solvers: list[Part]) -> Array:
    """(k, p) what each sample adds to the sum that is theta."""
    scores = np.einsum("knp,kn->kp", Z, y)
    return np.concatenate([scores[rows] @ A.T for rows, A in solvers])


def _solvers(system: System, weighting: Weighting, *, exogenous: bool) -> tuple[list[Part], NullSpace]:
    """Solvers of all batches, and the report; without solvers where the report says that there are none."""
    column, row = _norm(system.varying), _norm(system.Z)
    column[column <= 1e-11 * _norm(system.Phi)] = np.inf  # constant, to working precision
    row[row == 0] = 1.0
    Z, Phi = system.Z, system.varying
    moments = [_moment(Z[rows], Phi[rows]) / row[:, None] / column for rows in system.parts]
    weights = weighting.batch_weights or (1.0,) * len(moments)
    if weighting.blocks == "one":
        total = sum((w * H for w, H in zip(weights, moments, strict=True)), start=np.zeros_like(moments[0]))
        second = (
            None if exogenous else (_moment(Z, Z) / np.outer(row, row), _moment(Phi, Phi) / np.outer(column, column))
        )
        found = null_space(total, system.names, samples=len(Z), exogenous=exogenous, second=second)
        if found.unseen:
            return [], found
        A = np.linalg.inv(total) / column[:, None] / row
        return [(rows, w * A) for w, rows in zip(weights, system.parts, strict=True)], found
    halves = [
        np.sqrt(w) * _whitening(_moment(Z[rows], Z[rows]) / np.outer(row, row))
        for w, rows in zip(weights, system.parts, strict=True)
    ]
    stacked = np.concatenate([half @ H for half, H in zip(halves, moments, strict=True)])
    found = null_space(stacked, system.names, samples=len(Z), exogenous=exogenous)
    if found.unseen:
        return [], found
    pieces = np.split(np.linalg.pinv(stacked), np.cumsum([len(half) for half in halves])[:-1], axis=1)
    solvers = [piece @ half / column[:, None] / row for piece, half in zip(pieces, halves, strict=True)]
    return list(zip(system.parts, solvers, strict=True)), found


def _norm(rows: Array) -> Array:
    """(p,) over samples and outputs."""
    return np.asarray(np.sqrt(np.einsum("knp,knp->p", rows, rows)))


def _moment(Z: Array, Phi: Array) -> Array:
    return np.asarray(Z.reshape(-1, Z.shape[2]).T @ Phi.reshape(-1, Phi.shape[2]))


def _whitening(moments: Array) -> Array:
    """Square root of the inverse second moments, on the directions in which the instruments vary at all."""
    values, vectors = np.linalg.eigh(moments)
    kept = values > 1e-12 * values[-1]
    return np.asarray((vectors[:, kept] / np.sqrt(values[kept])).T)


def _lags(scores: Array, regression: Regression, weighting: Weighting) -> int:
    if weighting.covariance not in ("hac", "kernel"):
        return 0
    if weighting.lags is not None:
        return weighting.lags
    return automatic_lags(scores, regression.batch_of, regression.step_of, kernel=weighting.kernel)


def _check(regression: Regression, instruments: Array, weighting: Weighting) -> None:
    if instruments.shape != regression.Phi.shape:
        raise ShapeError(f"instruments have shape {instruments.shape}, expected {regression.Phi.shape}")
    if not np.isfinite(instruments).all():
        raise InputError("instruments hold numbers that are not finite")
    if weighting.blocks == "batch" and weighting.mean == "complete":
        raise InputError("instrument blocks per batch need their mean subtracted per batch, found 'complete'")
    batches = len(np.unique(regression.batch_of))
    for what, weights, count in (
        ("batch_weights", weighting.batch_weights, batches),
        ("output_weights", weighting.output_weights, len(regression.outputs)),
    ):
        if weights and len(weights) != count:
            raise InputError(f"{what} has {len(weights)} entries, expected {count}")
