"""The duration problem, built from scored primitives or from covariances of estimates.

In the covariance domain every primitive is informative on its own. P_q is the covariance of the estimate if the total
time is spent on primitive q alone:

    P(w)^-1 = sum_q w_q P_q^-1

Estimates from separate runs are fused by their covariances. Covariances from Monte Carlo runs of the estimator include
what the information matrix leaves out: coloured residuals, bias of the method, weak instruments.

Source: F. Ljungberg, doctoral thesis, Linköping University, (7.50)-(7.63).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from expdesign.durations.criteria import Aim, Picked
from expdesign.durations.limits import NO_CONSTRAINTS, Constraints
from expdesign.errors import InputError, NotInformative, UnknownName
from expdesign.information import MEAN_SUBTRACTIONS, PrimitiveInformation, check_informative
from expdesign.values import Array, frozen_set, seal

ROBUST = ("nominal", "average", "worst")
"""The nominal model only, the average over sampled models, or the worst of them."""
UNUSED = 1e-9
"""Share in place of zero for strata that a run has no samples of, so that designs without them stay regular."""


@dataclass(frozen=True, kw_only=True, eq=False)
class InformationFloor:
    """A least information about combinations of other parameters, such as a cause that a diagnosis is to reveal.

    With M = prior + sum_q w_q matrices_q, information 1 / trace(L^T M^-1 L) must be at least `least`. Of one
    combination that is its Schur complement; of several it is no more than the smallest eigenvalue of theirs.
    """

    name: str  # for reports
    matrices: Array  # (q, d, d) information if all of the time is spent on one primitive
    prior: Array  # (d, d)
    L: Array  # (d, k) combinations in its columns
    least: float  # what is asked for

    def __post_init__(self) -> None:
        seal(self, matrices="q d d", prior="d d", L="d k")
        if not 0 < self.least < np.inf:
            raise InputError(f"{self.name}: the least information is {self.least:g}, expected more than 0")


@dataclass(frozen=True, kw_only=True, eq=False)
class DurationProblem:
    """Maximise a criterion of B(w) = B_prior + sum_q w_q B_q over time fractions w.

    With complete mean subtraction B_q = [[X_q, Y_q], [Z_q^T, I]], of dimension p + n: its Schur complement is the
    information matrix after subtraction, because sum w = 1. Otherwise B_q has dimension p. Where equations have samples
    of their own, I is a diagonal of their shares, with a column for each stratum of samples; D is then D_s of all
    parameters.


    Source: F. Ljungberg, doctoral thesis, Linköping University, (7.50)-(7.58); Schur complement form derived here.
    """

    names: tuple[str, ...]  # of the primitives
    parameters: tuple[str, ...]  # names of the p parameters
    mean_subtraction: str  # "none", "batch" or "complete"
    matrices: Array  # (q, d, d) B_q of the nominal model, in physical parameter scale
    run_s: Array  # (q,) duration of one whole run of each primitive [s]
    total_s: float  # total time of all primitives [s]
    aim: Aim = field(default_factory=Aim)  # the criterion with its settings
    constraints: Constraints = NO_CONSTRAINTS  # limits on the durations
    # (d, d) prior information, per sample of the total time (thesis (7.58))
    prior: Array = field(default_factory=lambda: np.zeros((0, 0)))
    robust: str = "nominal"  # one of `ROBUST`
    # (m, q, d, d) B_q of models drawn from the prior of the nominal parameters; m is 0 for "nominal"
    sampled: Array = field(default_factory=lambda: np.zeros((0, 0, 0, 0)))
    # (p) equation, "u", "v" or "r", of each parameter; only `constraints.balance` needs it
    equations: tuple[str, ...] = ()
    # parameters of disturbances in the augmented predictor; where runs make two of their regressors coincide, the
    # estimator merges them, see `estimation.nuisance`
    nuisance: tuple[str, ...] = ()
    floors: tuple[InformationFloor, ...] = ()  # least information about other parameters
    excitation: str = "free"  # which samples count in each equation, see `information.excitation`
    # primitive -> equation -> whether the excitation condition holds; () where it was not looked at
    excites: tuple[Mapping[str, bool], ...] = ()

    def __post_init__(self) -> None:
        if np.size(self.prior) == 0:
            frozen_set(self, "prior", np.zeros(np.shape(self.matrices)[1:]))
        if np.size(self.sampled) == 0:
            frozen_set(self, "sampled", np.zeros((0, *np.shape(self.matrices))))
        seal(self, matrices="q d d", run_s="q", prior="d d", sampled="m q d d")
        if len(set(self.names)) < len(self.names):
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise InputError(f"two primitives are named {twice!r}, expected every name once")
        if not 0 < self.total_s < np.inf:
            raise InputError(f"total_s is {self.total_s:g}, expected more than 0")
        if self.robust not in ROBUST:
            raise UnknownName("robust", self.robust, known=ROBUST)
        if (self.robust != "nominal") != bool(len(self.sampled)):
            raise InputError(f"robust is {self.robust!r} and {len(self.sampled)} models were sampled")

    @property
    def dimension(self) -> int:
        """Size d of B: parameters, and means when they are subtracted over the complete data."""
        return int(self.matrices.shape[1])

    @property
    def picked(self) -> Picked:
        """The arguments of a criterion."""
        return Picked(aim=self.aim, parameters=self.parameters, dimension=self.dimension)

    @property
    def included(self) -> NDArray[np.bool_]:
        """(q,) primitives that the limits do not exclude by name."""
        return np.array([name not in self.constraints.excluded for name in self.names])

    @property
    def symmetric(self) -> bool:
        """Whether regressors and instruments come from the same noise-free run, so that the problem is convex."""
        stacks = (self.matrices, self.prior[None], *self.sampled)
        return all(_symmetric(stack) for stack in stacks)


def _symmetric(stack: Array) -> bool:
    size = np.sqrt(np.abs(np.diagonal(stack, axis1=1, axis2=2)).max(axis=0))
    size = np.where(size > 0, size, 1.0)
    return bool(np.all(np.abs(stack - np.swapaxes(stack, 1, 2)) <= 1e-9 * np.outer(size, size)))


def build_durations(
    information: Sequence[PrimitiveInformation],
    parameters: Sequence[str],
    *,
    total_s: float,
    mean_subtraction: str = "complete",
    aim: Aim | None = None,
    constraints: Constraints = NO_CONSTRAINTS,
    prior: Array | None = None,
    sampled: Sequence[Sequence[PrimitiveInformation]] = (),
    robust: str = "nominal",
    equations: Sequence[str] = (),
    nuisance: Sequence[str] = (),
    floors: Sequence[InformationFloor] = (),
    excitation: str = "free",
) -> DurationProblem:
    """The duration problem of a scored dictionary.

    Args:
        information: of each primitive, by the nominal model.
        parameters: p names in the order of the matrices.
        total_s: total time of all primitives [s].
        mean_subtraction: "none", "batch" or "complete".
        aim: criterion with its settings; D when not given.
        prior: (d, d) prior information, per sample of the total time; see `information.prior`.
        sampled: the information by each model drawn from the prior of the nominal parameters.
        robust: one of `ROBUST`.
        equations: of each parameter; only needed for `constraints.balance`.
        nuisance, floors, excitation: as in `DurationProblem`.

    Raises:
        UnknownName: no such mean subtraction.
        NotInformative: the primitives together do not inform about every parameter.
    """
    if mean_subtraction not in MEAN_SUBTRACTIONS:
        raise UnknownName("mean subtraction", mean_subtraction, known=MEAN_SUBTRACTIONS)
    if prior is None:
        allowed = [item for item in information if item.primitive.name not in constraints.excluded]
        check_informative(allowed or information, parameters, mean_subtraction)
    return DurationProblem(
        names=tuple(item.primitive.name for item in information),
        parameters=tuple(parameters),
        mean_subtraction=mean_subtraction,
        matrices=_stack(information, mean_subtraction),
        run_s=np.array([item.primitive.duration_s for item in information]),
        total_s=total_s,
        aim=aim or Aim(),
        constraints=constraints,
        prior=np.zeros((0, 0)) if prior is None else prior,
        robust=robust,
        sampled=np.array([_stack(items, mean_subtraction) for items in sampled]),
        equations=tuple(equations),
        nuisance=tuple(nuisance),
        floors=tuple(floors),
        excitation=excitation,
        excites=tuple(dict(item.excites) for item in information),
    )


def _stack(information: Sequence[PrimitiveInformation], mean_subtraction: str) -> Array:
    return np.array([bordered(item, mean_subtraction) for item in information])


def bordered(item: PrimitiveInformation, mean_subtraction: str) -> Array:
    """(d, d) B_q of one primitive, see `DurationProblem`."""
    return bordered_moments(item.X, item.Y, item.Z, item.YZ, mean_subtraction, item.used)


def bordered_moments(
    X: Array, Y: Array, Z: Array, YZ: Array, mean_subtraction: str, used: Array | None = None
) -> Array:
    """B_q from moments X (p, p), means Y and Z (p, n), the means' products YZ (p, p) and shares of samples (n,)."""
    if mean_subtraction == "none":
        return X
    if mean_subtraction == "batch":
        return X - YZ
    return np.block([[X, Y], [Z.T, np.eye(Y.shape[1]) if used is None else np.diag(np.maximum(used, UNUSED))]])


def monte_carlo_covariance(estimates: Array, nominal: Array) -> Array:
    """(p, p) mean of (estimate - nominal) (estimate - nominal)^T, so that bias counts as noise does (7.59).

    Args:
        estimates: (runs, p) of the same parameters from independent simulated runs.
        nominal: (p,) parameters that were simulated.

    Raises:
        InputError: too few runs for a regular covariance, numbers missing, or other parameters.
    """
    runs, p = estimates.shape
    if np.shape(nominal) != (p,):
        raise InputError(f"estimates of {p} parameters need as many nominal ones, found {np.size(nominal)}")
    if runs <= p + 1 or not (np.isfinite(estimates).all() and np.isfinite(nominal).all()):
        raise InputError(f"a covariance of {p} parameters needs more than {p + 1} finite estimates, found {runs}")
    errors = estimates - nominal
    return np.asarray(errors.T @ errors / runs)


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
        covariances: (q, p, p) of estimates from each primitive alone.
        seconds: (q,) length of the data behind each covariance [s]; covariances fall with time as 1/t.
        run_s: (q,) duration of one whole run [s].
        total_s: total time of all primitives [s].
        aim: criterion with its settings; D when not given. Covariances are in physical units, so noise must be 1.

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
    aim = aim or Aim()
    if aim.noise.size and not np.allclose(aim.noise, 1.0):
        raise InputError("covariances are in physical units already, expected a noise of 1 for every parameter")
    return DurationProblem(
        names=tuple(names),
        parameters=tuple(parameters),
        mean_subtraction="none",
        matrices=np.array(matrices),
        run_s=run_s,
        total_s=total_s,
        aim=aim,
        constraints=constraints,
    )
