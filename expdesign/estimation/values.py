"""The result of an estimation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.errors import UnknownName
from expdesign.estimation.feedback import Feedback
from expdesign.estimation.regression import Integers, Share
from expdesign.estimation.replay import Steered
from expdesign.estimation.solve import NullSpace
from expdesign.values import Array, frozen_set, seal
from expdesign.vessel import VesselModel

ROUNDING = 1e-12
"""Added to correlations, of which some are nearly one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Residuals:
    """Statistics of the one-step residuals (for "oe": of the simulated output)."""

    outputs: tuple[str, ...]  # names
    std: Array  # (n,) standard deviation, in the unit of a sample-to-sample difference (for "oe": of the output)
    correlation: Array  # (n,) with the sample before; -0.5 is measurement noise, +1 is a missing slow effect
    rows: int  # samples used by any equation
    rows_of: Integers  # (n,) samples that each equation uses
    left_out: int  # samples left out because numbers are missing
    lags: int  # last lag that the covariance of the estimate counts

    def __post_init__(self) -> None:
        seal(self, std="n", correlation="n")
        counts = np.array(self.rows_of, dtype=np.int64)
        counts.setflags(write=False)
        frozen_set(self, "rows_of", counts)


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """Parameters of a vessel model from data."""

    method: str  # name of the method
    names: tuple[str, ...]  # estimated parameters, in model order
    values: Array  # (p,) in the model's own form
    covariance: Array  # (p, p)
    held: Mapping[str, float]  # parameters not estimated, and the values they were given
    nuisance_names: tuple[str, ...]  # nuisance parameters
    nuisance_values: Array  # (q,)
    # what each nuisance parameter is the sum of: parameters times moments of disturbances
    nuisance_shares: tuple[tuple[Share, ...], ...]
    # parameters of the air that are in others' values because no wind was used, and the names of those
    partners: Mapping[str, str]
    joint_covariance: Array  # (p + q, p + q) of parameters, then nuisance parameters
    residuals: Residuals  # statistics
    null_space: NullSpace  # what the data cannot see, or see faintly
    refinements: int  # number of repeated simulations of the instruments
    warnings: tuple[str, ...]  # one sentence each
    steered: Steered  # samples marked as steered, and what became of them
    # the test whether inputs that instruments are simulated from follow disturbances; None without one
    feedback: Feedback | None

    def __post_init__(self) -> None:
        seal(self, values="p", covariance="p p", nuisance_values="q", joint_covariance="r r")

    @property
    def std(self) -> Array:
        """(p,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def assignments(self) -> dict[str, float]:
        """Every parameter of the model by name."""
        return {**dict(zip(self.names, self.values.tolist(), strict=True)), **self.held}

    def value(self, name: str) -> float:
        """One parameter.

        Raises:
            UnknownName: not a parameter of the model.
        """
        if name not in self.assignments:
            raise UnknownName("parameter", name, known=self.assignments)
        return self.assignments[name]

    def model(self, model: VesselModel) -> VesselModel:
        """A model with these values and this covariance as its prior; held parameters count as known.

        Ranges of parameters that the estimate contradicts fall away.
        """
        found = model.with_parameters(self.assignments).with_covariance(self.names, self.covariance)
        return found.with_kept_ranges()


# Fit of a simulated output to a measured one.
#
# Source: F. Ljungberg, doctoral thesis, Linköping University, (6.4).


def fit_percent(measured: Array, simulated: Array) -> Array:
    """100 (1 - ||y - yhat|| / ||y - mean y||) per column of (k, n); nan for a constant y, negative for bad models.

    Samples that are not measured (nan) do not count.
    """
    seen = np.isfinite(measured)
    error = np.where(seen, measured - simulated, 0.0)
    count = np.maximum(seen.sum(axis=0), 1)
    spread = np.where(seen, measured - np.where(seen, measured, 0.0).sum(axis=0) / count, 0.0)
    size, reference = np.sqrt((error**2).sum(axis=0)), np.sqrt((spread**2).sum(axis=0))
    constant = reference <= 1e-12 * np.sqrt(np.where(seen, measured**2, 0.0).sum(axis=0))
    return np.asarray(np.where(constant, np.nan, 100.0 * (1.0 - size / np.where(constant, 1.0, reference))))


def into_range(values: Array, covariance: Array, ends: Sequence[tuple[float, float]]) -> Array:
    """(p,) most probable numbers within their ranges, where normal ones (p,) with a covariance (p, p) are outside.

    They minimise (x - values)' C^-1 (x - values): those that are not at an end follow the others by their correlation.
    """
    low, high = np.array(ends).T
    if ((low <= values) & (values <= high)).all():
        return values
    std = np.sqrt(np.diag(covariance))
    free = std > 0
    size = std[free]
    correlation = covariance[np.ix_(free, free)] / np.outer(size, size)
    white = np.linalg.inv(np.linalg.cholesky(correlation + ROUNDING * np.eye(len(size))))
    bounds = (low[free] / size, high[free] / size)
    found = values.copy()
    found[free] = size * scipy.optimize.lsq_linear(white, white @ (values[free] / size), bounds=bounds, method="bvls").x
    return np.where(free, np.clip(found, low, high), values)
