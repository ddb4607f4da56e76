"""Weighted ridge and lasso with cross-validation.

    minimise  (1/N) sum w_i (y_i - phi_i beta)^2 + penalty * sum beta_j^2    (ridge)
                                              or + penalty * sum |beta_j|    (lasso)

on columns of unit root mean square; the intercept is not penalised. Nothing prevents weights in either.

Source: T. Hastie, R. Tibshirani and J. Friedman, The Elements of Statistical Learning (2009), 3.4, 7.10; leave-one-out
errors of ridge by its hat matrix.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.values import Array, seal

# of ridge and lasso that cross-validation compares, on columns of unit size
PENALTIES = (1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
FOLDS = 10  # of cross-validation where there is no closed form


SMALLEST = 1e-11
"""Eigenvalue of the normal equations, relative to the largest, below which smaller ones are raised."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sampled:
    """Values of a function at places."""

    columns: Array  # (n, p) basis functions
    values: Array  # (n,)
    weights: Array  # (n,)
    penalised: Array  # (p,) 0 for the intercept, 1 for others

    def __post_init__(self) -> None:
        seal(self, columns="n p", values="n", weights="n", penalised="p")

    def part(self, rows: Array) -> Sampled:
        """Some of the samples."""
        return Sampled(
            columns=self.columns[rows], values=self.values[rows], weights=self.weights[rows], penalised=self.penalised
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """A regression."""

    method: str  # "ridge" or "lasso"
    penalty: float  # that cross-validation chose
    coefficients: Array  # (p,) of the columns as given
    held_out: float  # weighted root mean square error of cross-validation, unit of the values


def best_fit(samples: Sampled) -> Fit:
    """Ridge or lasso, whichever predicts what was held out better."""
    return min((ridge(samples), lasso(samples)), key=lambda fit: fit.held_out)


def ridge(samples: Sampled, penalties: tuple[float, ...] = PENALTIES) -> Fit:
    """Ridge regression with the penalty of the least leave-one-out error, in closed form."""
    errors = [_left_out_error(samples, penalty) for penalty in penalties]
    best = int(np.argmin(errors))
    solution = _ridge(samples, penalties[best])[0]
    return Fit(method="ridge", penalty=penalties[best], coefficients=solution, held_out=errors[best])


def lasso(samples: Sampled, penalties: tuple[float, ...] = PENALTIES) -> Fit:
    """Lasso with the penalty of the least error in folds; zeros are exact."""
    folds = np.arange(float(len(samples.values))) % min(FOLDS, len(samples.values))
    largest = _largest_penalty(samples)
    errors = [_fold_error(samples, folds, penalty * largest) for penalty in penalties]
    best = int(np.argmin(errors))
    solution = _lasso(samples, penalties[best] * largest)
    return Fit(method="lasso", penalty=penalties[best] * largest, coefficients=solution, held_out=errors[best])


def _scale(samples: Sampled) -> Array:
    size = np.sqrt(np.mean(samples.columns**2, axis=0))
    return np.where(size > 0, size, 1.0)


def _ridge(samples: Sampled, penalty: float) -> tuple[Array, Array]:
    """(p,) coefficients, (n,) leverages."""
    scale, root = _scale(samples), np.sqrt(samples.weights / len(samples.values))
    rows = root[:, None] * samples.columns / scale
    gram = rows.T @ rows + penalty * np.diag(samples.penalised + 1e-12)
    gain = np.linalg.pinv(gram, hermitian=True, rcond=1e-14) @ rows.T
    return gain @ (root * samples.values) / scale, np.einsum("np,pn->n", rows, gain)


def _left_out_error(samples: Sampled, penalty: float) -> float:
    solution, leverage = _ridge(samples, penalty)
    error = (samples.values - samples.columns @ solution) / np.maximum(1.0 - leverage, 1e-6)
    return _weighted_rms(samples, error)


def _weighted_rms(samples: Sampled, error: Array) -> float:
    return float(np.sqrt(np.sum(samples.weights * error**2) / np.sum(samples.weights)))


def _fold_error(samples: Sampled, folds: Array, penalty: float) -> float:
    error = np.empty(len(samples.values))
    for fold in np.unique(folds):
        out = folds == fold
        error[out] = samples.values[out] - samples.columns[out] @ _lasso(samples.part(~out), penalty)
    return _weighted_rms(samples, error)


def _largest_penalty(samples: Sampled) -> float:
    """The penalty from which on all penalised coefficients are about zero."""
    pull = samples.columns.T @ (samples.weights * samples.values) / _scale(samples) / len(samples.values)
    return 2.0 * float(np.max(np.abs(pull)))


def _lasso(samples: Sampled, penalty: float) -> Array:
    """The lasso, solved as non-negative least squares in the positive and negative parts of the coefficients."""
    scale, root = _scale(samples), np.sqrt(samples.weights / len(samples.values))
    rows = root[:, None] * samples.columns / scale
    both = np.concatenate([rows, -rows], axis=1)
    pull = both.T @ (root * samples.values) - penalty / 2 * np.tile(samples.penalised, 2)
    values, vectors = np.linalg.eigh(both.T @ both)
    sizes = np.sqrt(np.maximum(values, SMALLEST * values[-1]))
    parts, _ = scipy.optimize.nnls(sizes[:, None] * vectors.T, vectors.T @ pull / sizes, maxiter=100 * len(pull))
    return np.asarray((parts[: len(scale)] - parts[len(scale) :]) / scale)
