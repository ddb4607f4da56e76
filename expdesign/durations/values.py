"""The duration problem and its certified answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from expdesign.durations.constraints import NO_CONSTRAINTS, Constraints
from expdesign.durations.criteria import Aim, Picked
from expdesign.errors import InputError, UnknownName
from expdesign.values import Array, frozen_set, seal

ROBUST = ("nominal", "average", "worst")
"""What several models of the ship count for: only the nominal one, their average, or the least of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DurationProblem:
    """Maximise a criterion of B(w) = B_prior + sum_q w_q B_q over time fractions w.

    With complete mean subtraction B_q = [[X_q, Y_q], [Z_q^T, I]], of dimension p + n: its Schur complement is the
    information matrix after subtraction, because sum w = 1. Otherwise B_q has dimension p.

    Attributes:
        names: of the primitives.
        parameters: names of the p parameters.
        mean_subtraction: "none", "batch" or "complete".
        matrices: (q, d, d) B_q of the nominal model, in physical parameter scale.
        run_s: (q,) duration of one whole run of each primitive [s].
        total_s: time to share out [s].
        aim: the criterion and what it needs to know.
        constraints: limits on the sharing.
        prior: (d, d) what is known already, per sample of the total time (thesis (7.58)).
        robust: one of `ROBUST`.
        sampled: (m, q, d, d) B_q of models drawn from the prior of the nominal parameters; m is 0 for "nominal".
        equations: (p) equation, "u", "v" or "r", of each parameter; only `constraints.balance` needs it.
        nuisance: parameters of disturbances that are estimated along; where runs make two of their regressors coincide,
            the estimator merges them, see `estimable`.

    Source: F. Ljungberg, doctoral thesis, Linköping University, (7.50)-(7.58); Schur complement form derived here.
    """

    names: tuple[str, ...]
    parameters: tuple[str, ...]
    mean_subtraction: str
    matrices: Array
    run_s: Array
    total_s: float
    aim: Aim = field(default_factory=Aim)
    constraints: Constraints = NO_CONSTRAINTS
    prior: Array = field(default_factory=lambda: np.zeros((0, 0)))
    robust: str = "nominal"
    sampled: Array = field(default_factory=lambda: np.zeros((0, 0, 0, 0)))
    equations: tuple[str, ...] = ()
    nuisance: tuple[str, ...] = ()

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
        """What a criterion works on."""
        return Picked(aim=self.aim, parameters=self.parameters, dimension=self.dimension)

    @property
    def symmetric(self) -> bool:
        """Whether regressors and instruments come from the same noise-free run, so that the problem is convex."""
        stacks = (self.matrices, self.prior[None], *self.sampled)
        return all(_symmetric(stack) for stack in stacks)


def _symmetric(stack: Array) -> bool:
    size = np.sqrt(np.abs(np.diagonal(stack, axis1=1, axis2=2)).max(axis=0))
    size = np.where(size > 0, size, 1.0)
    return bool(np.all(np.abs(stack - np.swapaxes(stack, 1, 2)) <= 1e-9 * np.outer(size, size)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Certificate:
    """Why no other sharing can be better by more than the gap, as numbers that anyone can check.

    For any feasible v the criterion is at most `value` + slope (v - w), with the slope mixed from the models and the
    limits at their prices; the largest value of that over all feasible v is the bound.

    Attributes:
        kind: the theorem in a few words, or why there is none.
        value: the criterion at the design, as a logarithm; `degree` of it are one unit of information.
        bound: no feasible sharing has more; inf when there is no certificate.
        degree: value of twice the information is higher by degree x log 2.
        level: what every sensitivity less its price is at most, and where time is free to move, exactly.
        mixture: (m,) weights of the sampled models.
        prices: (q,) what the limits take off each sensitivity.
        multipliers: price of every limit by name; a limit whose price is zero does not matter.
        guaranteed: for recorded primitives, the log det that the symmetric part guarantees; -inf when it is nowhere
            positive definite; nan where the problem is convex.
    """

    kind: str
    value: float
    bound: float
    degree: int
    level: float
    mixture: Array
    prices: Array
    multipliers: Mapping[str, float]
    guaranteed: float = float("nan")

    def __post_init__(self) -> None:
        seal(self, mixture="m", prices="q")

    @property
    def gap(self) -> float:
        """bound - value."""
        return self.bound - self.value


@dataclass(frozen=True, kw_only=True, eq=False)
class DurationDesign:
    """How long to run each primitive, with the proof.

    Attributes:
        problem: what was asked.
        fractions: (q,) optimal time fractions, sum 1; less where budgets make it better to leave time unused.
        sensitivities: (q,) slope of the criterion; for D trace(B(w)^-1 B_q), at the optimum at most `dimension`, equal
            where w_q > 0.
        log_det: log det B at `fractions`, by the nominal model.
        gap: what any other design may be better by, in the criterion's logarithm (for D in log det).
        repeats: (q,) whole runs.
        efficiency_repeats: of the whole runs against the optimum, by the criterion: share of the time that the optimum
            would need for the same.
        efficiency_uniform: the same for equal time on every primitive, whether that is allowed or not.
        certificate: the proof.
        note: what has to be known of the whole runs, in a sentence, or "".
    """

    problem: DurationProblem
    fractions: Array
    sensitivities: Array
    log_det: float
    gap: float
    repeats: tuple[int, ...]
    efficiency_repeats: float
    efficiency_uniform: float
    certificate: Certificate
    note: str = ""

    def __post_init__(self) -> None:
        seal(self, fractions="q", sensitivities="q")

    @property
    def log_det_bound(self) -> float:
        """Upper bound on the log det of any design; inf when the certificate is about something else."""
        own = self.problem.aim.criterion == "D" and self.problem.robust == "nominal"
        return self.log_det + self.gap if own else float("inf")

    @property
    def gap_relative(self) -> float:
        """The gap per degree of the criterion: the share of information that may be missing."""
        return self.gap / self.certificate.degree

    @property
    def durations_s(self) -> Array:
        """(q,) time of each primitive before rounding [s]."""
        return np.asarray(self.fractions * self.problem.total_s)
