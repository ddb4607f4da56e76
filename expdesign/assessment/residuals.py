"""One-step residuals of an estimate: the explained share of the accelerations, and the residuals over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.assessment.tuning import TUNING
from expdesign.estimation.methods import as_read, method_named
from expdesign.estimation.regression import Integers, build_layout, build_regression, model_for
from expdesign.estimation.values import Estimate
from expdesign.signals import Record
from expdesign.values import Array, frozen_set, seal
from expdesign.vessel import VesselModel


@dataclass(frozen=True, kw_only=True, eq=False)
class OneStep:
    """Residuals nu(k) - nu(k - 1) - Phi(k - 1)^T theta, their mean taken off.

    Attributes:
        outputs: names.
        residuals: (k, n) in the unit of a sample-to-sample difference.
        batch: (k,) number of the run.
        explained: (n,) share of the variance of nu(k) - nu(k - 1) that the model explains, at most 1.
        autocorrelation: (lags + 1, n), 1 at lag 0; pairs never reach across runs or missing samples.
    """

    outputs: tuple[str, ...]
    residuals: Array
    batch: Integers
    explained: Array
    autocorrelation: Array

    def __post_init__(self) -> None:
        seal(self, residuals="k n", explained="n", autocorrelation="l n")
        numbers = np.array(self.batch, dtype=np.int64)
        numbers.setflags(write=False)
        frozen_set(self, "batch", numbers)

    @property
    def white_band(self) -> float:
        """Autocorrelations of white residuals stay within this, 95 times in 100."""
        return 1.96 / float(np.sqrt(max(1, len(self.residuals))))


def one_step(
    record: Record, model: VesselModel, found: Estimate, *, fixed: Sequence[str] = (), quadrature: str = "euler"
) -> OneStep:
    """The residuals of an estimate on the record it comes from.

    Args:
        record: the data.
        model: the initial model; gives the values of the fixed parameters.
        found: the estimate.
        fixed: fixed parameters.
        quadrature: one of `predictors.QUADRATURES`.
    """
    method = method_named(found.method)
    record = as_read(record, method)
    layout = build_layout(
        model_for(model, record), record, predictor=method.predictor, fixed=tuple(fixed), quadrature=quadrature
    )
    regression = build_regression(layout, record).regression
    names, values = (*found.names, *found.nuisance_names), np.concatenate([found.values, found.nuisance_values])
    residuals = regression.residuals(values[[names.index(name) for name in regression.parameters]])
    residuals = residuals - residuals.mean(axis=0)
    total = np.var(regression.y, axis=0)
    explained = 1.0 - np.var(residuals, axis=0) / np.where(total > 0, total, np.nan)
    return OneStep(
        outputs=regression.outputs,
        residuals=residuals,
        batch=regression.batch_of,
        explained=explained,
        autocorrelation=autocorrelation(residuals, regression.batch_of, regression.step_of),
    )


def autocorrelation(residuals: Array, batch: Integers, step: Integers, *, lags: int = TUNING.lags) -> Array:
    """(lags + 1, n) mean products of residuals so many samples apart over the mean square; 0 where no pair exists."""
    power = (residuals**2).mean(axis=0)
    power = np.where(power > 0, power, 1.0)
    rows = [np.ones(residuals.shape[1])]
    place = _places(batch, step)
    grid = np.zeros((int(place[-1]) + 1, residuals.shape[1]))
    there = np.zeros(len(grid))
    grid[place], there[place] = residuals, 1.0
    owner = np.full(len(grid), -1)
    owner[place] = batch
    for lag in range(1, lags + 1):
        same = (owner[lag:] == owner[:-lag]) & (there[lag:] > 0) & (there[:-lag] > 0)
        pairs = (grid[lag:] * grid[:-lag])[same]
        rows.append(pairs.mean(axis=0) / power if len(pairs) else np.zeros(residuals.shape[1]))
    return np.array(rows)


def _places(batch: Integers, step: Integers) -> Integers:
    """(k,) places of the samples on one line on which the runs lie one after the other, gaps and all."""
    starts = np.flatnonzero(np.diff(batch, prepend=batch[0] - 1))
    ends = np.append(starts[1:], len(batch)) - 1
    lengths = step[ends] - step[starts] + 1
    offsets = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    run = np.searchsorted(starts, np.arange(len(batch)), side="right") - 1
    return np.asarray(step - step[starts][run] + offsets[run], dtype=np.int64)
