"""LS and IV: the estimate, its covariance and its residuals, from a regression and instruments.

    theta = (sum Z Phi^T)^-1 sum Z y                          LS is IV with Z = Phi
    P = G^-1 Omega G^-T,   G = sum Z Phi^T,   Omega = long-run covariance of Z(k) eps(k)

Residuals of one-step predictors from noisy data are coloured (noise enters at k and, through Phi, at k - 1), so Omega
is by default robust to both changing variance and correlation in time ("hac"). "hc0" and "hc1" are robust to
changing variance only, as in econometric software.

With one block of instruments per batch there are more equations than unknowns; they are weighted by the inverse second
moments of the instruments (two-stage least squares), which keeps the estimate free of the scale of parameters, or by
weights of the caller.

Source: F. Ljungberg, doctoral thesis, Linköping University, (2.17), (2.21), (4.45); L. P. Hansen, Econometrica 50
(1982), 1029-1054.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from expdesign.errors import InputError, ShapeError, UnknownName
from expdesign.estimation.long_run import automatic_lags, long_run_covariance
from expdesign.estimation.null_space import NullSpace, null_space, require_informative
from expdesign.estimation.regression import Regression
from expdesign.estimation.zero_mean import subtract_mean
from expdesign.values import Array, seal

COVARIANCES = ("hac", "hc1", "hc0")
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
        kernel: of the "hac" covariance.
        lags: last lag of the "hac" covariance, None for automatic.
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
    """
    weighting = weighting or Weighting()
    if instruments.shape != regression.Phi.shape:
        raise ShapeError(f"instruments have shape {instruments.shape}, expected {regression.Phi.shape}")
    if not np.isfinite(instruments).all():
        raise InputError("instruments hold numbers that are not finite")
    Z = subtract_mean(instruments, regression.batch_of, weighting.mean) * _output_weights(regression, weighting)
    A, found = _equations(regression, Z, weighting)
    k, n, p = Z.shape
    values = A @ _blocks(Z * regression.y[:, :, None], regression, weighting).sum(axis=(0, 1))
    residuals = subtract_mean(regression.residuals(values), regression.batch_of, weighting.mean)
    scores = _blocks(Z * residuals[:, :, None], regression, weighting).sum(axis=1) @ A.T  # (k, p) influence of a sample
    lags = _lags(scores, regression, weighting)
    P = long_run_covariance(scores, regression.batch_of, regression.step_of, lags=lags, kernel=weighting.kernel)
    factor = 1.0 if weighting.covariance == "hc0" else k * n / max(1, k * n - p)
    return Solution(values=values, covariance=factor * P, residuals=residuals, lags=lags, null_space=found)


def _equations(regression: Regression, Z: Array, weighting: Weighting) -> tuple[Array, NullSpace]:
    """A (p, q) with theta = A sum Z y, and the report on the moment matrix."""
    k, n, p = Z.shape
    Phi = subtract_mean(regression.Phi, regression.batch_of, weighting.mean).reshape(k * n, p)
    stacked = _blocks(Z, regression, weighting).reshape(k * n, -1)
    G = stacked.T @ Phi
    found = null_space(G, stacked, Phi, regression, symmetric=weighting.blocks == "one")
    require_informative(found)
    column, row = np.sqrt((Phi**2).sum(axis=0)), np.sqrt((stacked**2).sum(axis=0))
    row[row == 0] = 1.0
    scaled = G / row[:, None] / column
    if weighting.blocks == "one":
        return np.asarray(np.linalg.inv(scaled) / column[:, None] / row), found
    half = _whitening(stacked / row)
    return np.asarray(np.linalg.pinv(half @ scaled, rcond=1e-12) @ half / column[:, None] / row), found


def _whitening(instruments: Array) -> Array:
    """Square root of the inverse second moments, on the directions in which the instruments vary at all."""
    values, vectors = np.linalg.eigh(instruments.T @ instruments)
    kept = values > 1e-12 * values[-1]
    return np.asarray((vectors[:, kept] / np.sqrt(values[kept])).T)


def _blocks(rows: Array, regression: Regression, weighting: Weighting) -> Array:
    """Rows (k, n, p) spread over one block of columns per batch, (k, n, p x batches), each with its weight."""
    if weighting.blocks == "one":
        return _batch_weighted(rows, regression, weighting)
    numbers = np.unique(regression.batch_of)
    member = (regression.batch_of[:, None] == numbers).astype(float)
    return np.asarray(np.einsum("knp,kb->knbp", rows, member).reshape(*rows.shape[:2], -1))
