"""A linear regression with several outputs, in several batches: y(k) = Phi(k)^T theta + eps(k).

Arrays put samples first: `Phi` is (k, n, p), so that sample k's regression matrix of the literature, Phi(k), is the
transpose of `Phi[k]`. Instruments have the same layout, (k, n, q).

Source: F. Ljungberg, doctoral thesis, Linköping University, (2.14)-(2.21).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from expdesign.errors import InputError, UnknownName
from expdesign.values import Array, closed, frozen_set, seal

Integers = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Regression:
    """Data of a linear regression."""

    parameters: tuple[str, ...]  # names of the p columns
    Phi: Array  # (k, n, p) regressors
    y: Array  # (k, n) what they explain
    batch: Integers | None = None  # (k,) number of the batch of each row, rising; all zeros when left out
    # (k,) sample number within the batch, so that lags skip rows left out; counted when left out
    step: Integers | None = None
    outputs: tuple[str, ...] = ()  # names of the n outputs, "y1", "y2" ... when left out.
    # (k,) of the ship [rad], by which the covariance knows disturbances that keep their side of the chart while the
    # ship turns; None where it is not known
    heading: Array | None = None
    # (k, n) groups of rows for each output, from whose instruments the mean is subtracted separately, counted from 1; 0
    # for rows that it does not use. None for one group of all.
    strata: Integers | None = None

    def __post_init__(self) -> None:
        seal(self, Phi="k n p", y="k n")
        k, n, p = self.Phi.shape
        if len(self.parameters) != p:
            raise InputError(f"Regression has {p} columns for {len(self.parameters)} parameter names")
        if not (np.isfinite(self.Phi).all() and np.isfinite(self.y).all()):
            raise InputError("Regression holds numbers that are not finite; leave such rows out")
        batch = np.zeros(k, dtype=np.int64) if self.batch is None else np.array(self.batch, dtype=np.int64)
        if batch.shape != (k,) or (np.diff(batch) < 0).any():
            raise InputError(f"Regression.batch needs {k} batch numbers that never fall")
        step = _count(batch) if self.step is None else np.array(self.step, dtype=np.int64)
        if step.shape != (k,) or ((np.diff(step) <= 0) & (np.diff(batch) == 0)).any():
            raise InputError(f"Regression.step needs {k} sample numbers that rise within every batch")
        if self.heading is not None:
            seal(self, heading="k", Phi="k n p")
            if not np.isfinite(self.heading).all():
                raise InputError("Regression.heading holds numbers that are not finite; give none")
        if self.strata is not None and self.strata.shape != (k, n):
            raise InputError(f"Regression.strata has shape {self.strata.shape}, expected {(k, n)}")
        frozen_set(self, "batch", batch)
        frozen_set(self, "step", step)
        frozen_set(self, "outputs", self.outputs or tuple(f"y{i + 1}" for i in range(n)))

    def __len__(self) -> int:
        return len(self.y)

    @property
    def batch_of(self) -> Integers:
        """(k,) batch numbers."""
        assert self.batch is not None  # set at birth
        return self.batch

    @property
    def chosen(self) -> Mask | None:
        """(k, n) which rows each output uses; None for all."""
        return None if self.strata is None else self.strata != 0

    @property
    def groups(self) -> Integers:
        """(k, n) `strata`, of which there is one where there are none."""
        return np.ones(self.y.shape, dtype=np.int64) if self.strata is None else self.strata

    @property
    def used(self) -> Mask:
        """(k, n) which rows each output uses."""
        return np.asarray(self.groups != 0)

    @property
    def step_of(self) -> Integers:
        """(k,) sample numbers within the batches."""
        assert self.step is not None  # set at birth
        return self.step

    def at(self, rows: Integers | slice) -> Regression:
        """Some of its rows."""
        return replace(
            self,
            Phi=closed(self.Phi[rows]),
            y=self.y[rows],
            batch=self.batch_of[rows],
            step=self.step_of[rows],
            heading=None if self.heading is None else self.heading[rows],
            strata=None if self.strata is None else self.strata[rows],
        )

    def residuals(self, values: Array) -> Array:
        """(k, n) y - Phi^T theta for parameters (p,)."""
        return np.asarray(self.y - self.Phi @ values)


def single_output(Phi: Array, y: Array, *, parameters: tuple[str, ...], batch: Integers | None = None) -> Regression:
    """A regression of one output from regressors (k, p) and values (k,)."""
    return Regression(parameters=parameters, Phi=Phi[:, None, :], y=y[:, None], batch=batch)


def batch_slices(batch: Integers) -> list[slice]:
    """The rows of each batch, in order."""
    edges = np.flatnonzero(np.diff(batch)) + 1
    bounds = [0, *edges.tolist(), len(batch)]
    return [slice(low, high) for low, high in pairwise(bounds)]


def _count(batch: Integers) -> Integers:
    starts = np.searchsorted(batch, batch, side="left")
    return np.asarray(np.arange(len(batch)) - starts, dtype=np.int64)


# Zero-mean instruments: without their mean, constants and even moments of the noise drop out of the IV equations.
#
# Subtracting the mean over the complete data equals adding one constant nuisance parameter per output, subtracting it
# per batch equals one constant per output and batch (Lemmas 7.1 and 7.2). The complete way never has more variance.
#
# Source: F. Ljungberg, doctoral thesis, Linköping University, (4.40), (7.19), (7.20).

MEANS = ("none", "batch", "complete")


def subtract_mean(rows: Array, batch: Integers, mean: str) -> Array:
    """Rows (k, ...) without their mean over the complete data, or over each batch; "none" returns them as they are.

    Raises:
        UnknownName: `mean` is not one of `MEANS`.
    """
    if mean not in MEANS:
        raise UnknownName("instrument mean", mean, known=MEANS)
    if mean == "none":
        return rows
    if mean == "complete":
        return np.asarray(rows - rows.mean(axis=0))
    result = rows.copy()
    for number in np.unique(batch):
        chosen = batch == number
        result[chosen] -= rows[chosen].mean(axis=0)
    return result
