"""The equations of instrumental variables, split into parts that share no parameter, and how they are solved.

In ship models every output has parameters of its own, so a regression of three outputs falls into three parts.

Source: F. Ljungberg, doctoral thesis, Linköping University, (2.21), (4.45).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.errors import InputError, NotInformative, UnknownName
from expdesign.estimation.regression import MEANS, Integers, Regression, batch_slices, subtract_mean
from expdesign.estimation.solve.null_space import NullSpace, null_space
from expdesign.values import Array

COVARIANCES = ("components", "hac", "kernel", "hc1", "hc0")
BLOCKS = ("one", "batch")


@dataclass(frozen=True, kw_only=True)
class Weighting:
    """Options of the equations and of their covariance."""

    mean: str = "none"  # subtracted from the instruments, one of `zero_mean.MEANS`
    blocks: str = "one"  # "one" block of instruments for all batches, or one per "batch" (4.45)
    batch_weights: tuple[float, ...] = ()  # one factor per batch, how much its equations count; () for all alike
    output_weights: tuple[float, ...] = ()  # one factor per output, how much its equation counts; () for all alike
    covariance: str = "components"  # one of `COVARIANCES`, see `sandwich`
    kernel: str = "parzen"  # of the "hac" and "kernel" covariance
    lags: int | None = None  # their last lag, None for automatic

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


@dataclass(frozen=True, eq=False)
class System:
    """The part of a regression that some parameters and outputs have to themselves."""

    names: tuple[str, ...]  # of the parameters
    rows: Integers | slice  # of the regression that its outputs use
    # columns, outputs: places in the regression
    columns: Integers
    outputs: Integers
    varying: Array  # (k, n, p) regressors without the mean that is subtracted from instruments
    size: Array  # (p,) norm of that; infinite where it is constant to working precision
    y: Array  # (k, n)
    group: Integers  # (k,) numbers of the rows that share a mean
    parts: list[slice]  # rows of each batch

    def cut(self, whole: Array) -> Array:
        """(k, n, p) rows of this part, from (all, all, all)."""
        return _cut(whole[self.rows], self.outputs, self.columns)

    def without_mean(self, rows: Array, mean: str) -> Array:
        """Rows (k, ...) of this part without the mean of their group, unless the mean is "none"."""
        return _without_mean(rows, self.group, mean)


def occupied(rows: Array) -> Array:
    """(n, p) sum of squares over samples."""
    flat = rows.reshape(len(rows), -1)
    return np.asarray(np.einsum("kq,kq->q", flat, flat).reshape(rows.shape[1:]))


def split(regression: Regression, uses: Array, mean: str) -> tuple[System, ...]:
    """Parts that share neither parameters nor outputs; `uses` (n, p) is nonzero where a parameter acts on an output.

    Raises:
        NotInformative: a part uses no rows.
    """
    held = (uses > 0).astype(int)
    count, labels = scipy.sparse.csgraph.connected_components(held.T @ held, directed=False)
    columns = [np.flatnonzero(labels == label) for label in range(count)]
    return tuple(_system(regression, places, np.flatnonzero(held[:, places].any(axis=1)), mean) for places in columns)


def _system(regression: Regression, columns: Integers, outputs: Integers, mean: str) -> System:
    rows: Integers | slice = slice(None)
    if regression.chosen is not None:
        rows = np.flatnonzero(regression.chosen[:, outputs].all(axis=1))
        if len(outputs) and not len(rows):
            names = tuple(regression.parameters[index] for index in columns)
            equations = ", ".join(regression.outputs[index] for index in outputs)
            raise NotInformative(
                f"no sample is left for {equations}, which {', '.join(names)} need",
                parameters=names,
                unseen=tuple({name: 1.0} for name in names),
            )
    Phi = _cut(regression.Phi[rows], outputs, columns)
    group = _groups(regression, rows, outputs, mean)
    varying = _without_mean(Phi, group, mean)
    size = _norm(varying)
    size[size <= 1e-11 * _norm(Phi)] = np.inf
    return System(
        names=tuple(regression.parameters[index] for index in columns),
        rows=rows,
        columns=columns,
        outputs=outputs,
        varying=varying,
        size=size,
        y=regression.y[rows][:, outputs],
        group=group,
        parts=batch_slices(regression.batch_of[rows]),
    )


def _without_mean(rows: Array, group: Integers, mean: str) -> Array:
    if mean == "none":
        return rows
    return subtract_mean(rows, group, "batch" if group.any() else "complete")  # of one group without copies of it


def _groups(regression: Regression, rows: Integers | slice, outputs: Integers, mean: str) -> Integers:
    """(k,) numbers of the rows that share a mean: those of a batch, of a stratum, or both.

    Raises:
        UnknownName: `mean` is not one of `MEANS`.
    """
    if mean not in MEANS:
        raise UnknownName("instrument mean", mean, known=MEANS)
    group = regression.batch_of[rows] if mean == "batch" else np.zeros_like(regression.batch_of[rows])
    if regression.strata is None or not len(outputs):
        return group
    strata = regression.strata[rows][:, outputs]
    _, own = np.unique(np.column_stack([group, strata]), axis=0, return_inverse=True)
    return np.asarray(own, dtype=np.int64).reshape(-1)


def _cut(whole: Array, outputs: Integers, columns: Integers) -> Array:
    """(k, n, p), every column in one piece of memory."""
    return np.asarray(whole.transpose(1, 2, 0)[outputs[:, None], columns].transpose(2, 0, 1))


@dataclass(frozen=True, eq=False)
class Part:
    """A system with its instruments."""

    system: System  # the part of the regression
    W: Array  # (k, n, p) with theta = sum W y; nothing that can be used where its data do not see all parameters
    found: NullSpace  # what its data cannot see

    def solved(self, mean: str) -> tuple[Array, Array]:
        """Parameters (p,) and residuals (k, n) without the mean that instruments are without."""
        system = self.system
        theta = sum((rows.T @ y for rows, y in zip(self.W.swapaxes(0, 1), system.y.T, strict=True)), start=np.zeros(1))
        return theta, system.without_mean(system.y, mean) - system.varying @ theta


def build_part(system: System, instruments: Array, weighting: Weighting, *, exogenous: bool) -> Part:
    """A system with instruments (k, all, all); `exogenous`: they are the regressors themselves."""
    Z = instruments_of(system, instruments, weighting)
    A, found = solvers(system, Z, weighting, exogenous=exogenous)
    for rows, own in zip(system.parts, A, strict=False):
        for output in range(Z.shape[1]):
            Z[rows, output] = (own @ Z[rows, output].T).T
    return Part(system, Z, found)


def instruments_of(system: System, instruments: Array, weighting: Weighting) -> Array:
    """(k, n, p) instruments of a part, without mean and weighted, in memory of their own."""
    Z = system.without_mean(system.cut(instruments), weighting.mean)
    if weighting.output_weights:
        Z *= np.array(weighting.output_weights)[system.outputs, None]
    return Z


def solvers(system: System, Z: Array, weighting: Weighting, *, exogenous: bool) -> tuple[list[Array], NullSpace]:
    """A (p, p) for each batch, with theta = sum over batches of A sum Z y; none where the report finds no solution.

    Args:
        Z: (k, n, p) its instruments.
        weighting: how equations are formed.
        exogenous: the instruments are the regressors themselves.
    """
    row = _norm(Z)
    row[row == 0] = 1.0
    moments = [_moment(Z[rows], system.varying[rows]) / row[:, None] / system.size for rows in system.parts]
    weights = weighting.batch_weights or (1.0,) * len(moments)
    if weighting.blocks == "one":
        return _one_block(system, Z, row, moments, weights, exogenous=exogenous)
    halves = [
        np.sqrt(w) * _whitening(_moment(Z[rows], Z[rows]) / np.outer(row, row))
        for w, rows in zip(weights, system.parts, strict=True)
    ]
    stacked = np.concatenate([half @ H for half, H in zip(halves, moments, strict=True)])
    found = null_space(stacked, system.names, system.size, samples=len(Z), exogenous=exogenous)
    if found.unseen:
        return [], found
    pieces = np.split(np.linalg.pinv(stacked), np.cumsum([len(half) for half in halves])[:-1], axis=1)
    return [piece @ half / system.size[:, None] / row for piece, half in zip(pieces, halves, strict=True)], found


def _one_block(
    system: System, Z: Array, row: Array, moments: list[Array], weights: tuple[float, ...], *, exogenous: bool
) -> tuple[list[Array], NullSpace]:
    total = sum((w * H for w, H in zip(weights, moments, strict=True)), start=np.zeros_like(moments[0]))
    second = None
    if not exogenous:
        size = system.size
        second = (_moment(Z, Z) / np.outer(row, row), _moment(system.varying, system.varying) / np.outer(size, size))
    found = null_space(total, system.names, system.size, samples=len(Z), exogenous=exogenous, second=second)
    if found.unseen:
        return [], found
    A = np.linalg.inv(total) / system.size[:, None] / row
    return [w * A for w in weights], found


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
