"""The covariance domain: primitives that are informative on their own, each with a covariance of its own estimate.

    P(w)^-1 = sum_q w_q P_q^-1,    P_q the covariance that one total time of primitive q alone would give

Estimates from separate runs are fused by their covariances. Covariances from Monte Carlo runs of the estimator count
everything that the information matrix leaves out: coloured residuals, bias of the method, weak instruments.

Source: F. Ljungberg, doctoral thesis, Linköping University, (7.59)-(7.63).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.durations.constraints import NO_CONSTRAINTS, Constraints
from expdesign.durations.criteria import Aim
from expdesign.durations.values import DurationProblem
from expdesign.errors import InputError, NotInformative
from expdesign.values import Array


def monte_carlo_covariance(estimates: Array) -> Array:
    """(p, p) sample covariance of estimates (runs, p) of the same parameters from independent runs.

    Raises:
        InputError: too few runs for a regular covariance, or numbers missing.
    """
    runs, p = estimates.shape
    if runs <= p + 1 or not np.isfinite(estimates).all():
        raise InputError(f"a covariance of {p} parameters needs more than {p + 1} finite estimates, found {runs}")
    return np.asarray(np.cov(estimates, rowvar=False).reshape(p, p))


def build_fused(
    names: Sequence[str],
    parameters: Sequence[str],
    covariances: Array,
    *,
    seconds: Array,
    run_s: Array,
    total_s: float,
    aim: Aim | None = None,
    constraints: Constraints = NO_CONSTRAINTS,
) -> DurationProblem:
    """The duration problem of fused estimates; solve it with `solve_durations`.

    Args:
        names: of the q primitives.
        parameters: p names.
        covariances: (q, p, p) of estimates from each primitive alone.
        seconds: (q,) length of the data that each covariance is for; covariances fall with time as 1/t.
        run_s: (q,) duration of one whole run [s].
        total_s: time to share out [s].
        aim: criterion; D when not given. Covariances are in physical units, so noise counts as one.
        constraints: limits.

    Raises:
        NotInformative: a primitive that is not informative on its own.
    """
    scale = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2).mean(axis=0))
    matrices = []
    for name, covariance, time_s in zip(names, covariances, seconds, strict=True):
        try:
            root = np.linalg.inv(np.linalg.cholesky(covariance / np.outer(scale, scale)))
        except np.linalg.LinAlgError:
            raise NotInformative(
                f"primitive {name!r} is not informative on its own: its covariance is not positive definite",
                parameters=tuple(parameters),
            ) from None
        matrices.append(root.T @ root / np.outer(scale, scale) * total_s / time_s)
    wish = aim or Aim()
    if wish.noise.size and not np.allclose(wish.noise, 1.0):
        raise InputError("covariances are in physical units already, expected a noise of 1 for every parameter")
    return DurationProblem(
        names=tuple(names),
        parameters=tuple(parameters),
        mean_subtraction="none",
        matrices=np.array(matrices),
        run_s=run_s,
        total_s=total_s,
        aim=wish,
        constraints=constraints,
    )
