"""From a duration problem to certified durations.

The concave problem is solved by `maximise`. The certificate is computed from the problem alone; a design without one is
not returned.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib.metadata import version

import numpy as np
import scipy

from expdesign import __version__
from expdesign.durations.certificate import Certificate, DurationDesign, Solver
from expdesign.durations.concave import (
    Collected,
    ConcaveProblem,
    T,
    collected_measure,
    floor_of,
    information_floor,
    informs_about_all,
    least_of_floors,
    objective_of,
    polytope_of,
    symmetric_part,
    unidentifiable,
    unit_scaling,
    with_idle,
)
from expdesign.durations.criteria import Objective, criterion
from expdesign.durations.limits import Polytope
from expdesign.durations.maximise import CVXPY, FLOOR_ROUNDING, LARGEST_GAP, NEWTON, maximised
from expdesign.durations.problem import DurationProblem
from expdesign.durations.rounding import efficiency_of_shares, note_on_runs, runs_above_floors, whole_runs
from expdesign.errors import InputError, NoAnswer, NotInformative
from expdesign.values import Array

STARTS = 20  # random starts of a local search
DEFINITE = 1e-10  # least eigenvalue, in scaled parameters, of a positive definite matrix
TIGHTENED = (1.05, 1.15, 1.3, 1.6)  # factors on least information with which shares are sought whose whole runs keep it


# Recorded or noisy primitives: B_q is not symmetric, and |det B(w)| is not concave in logarithm.
#
# The symmetric part gives a concave problem. Where sym B is positive definite, det(sym B) <= |det B|, so its optimum is
# a guaranteed value. A local search from there improves |det B| itself, without a certificate. Where no fractions make
# sym B positive definite, only the local search remains.
#
# Source: A. M. Ostrowski and O. Taussky, On the variation of the determinant of a positive definite matrix,
# Indagationes Math. 13 (1951), 383-385; F. Ljungberg, doctoral thesis, Linköping University, (7.57), (7.9).


def definite_start(problem: DurationProblem, polytope: Polytope) -> Array | None:
    """Fractions (q,) that make sym B positive definite, or None where there are none."""
    from expdesign.durations._cvxpy import largest_least_eigenvalue

    matrices, prior = (symmetric_part(item) for item in _unit_scaled(problem))
    w = largest_least_eigenvalue(matrices, prior, polytope)
    if w is None:
        return None
    w = polytope.tidied(w)
    return w if np.linalg.eigvalsh(prior + np.tensordot(w, matrices, axes=1))[0] > DEFINITE else None


def improved(problem: DurationProblem, polytope: Polytope, start: Array | None) -> Array:
    """Fractions (q,) with log |det B| no lower than at the start, by sequential quadratic programming.

    Args:
        problem: with matrices that need not be symmetric.
        start: (q,), or None for `STARTS` random ones.

    Raises:
        NotInformative: |det B| is zero wherever the search began.
    """
    q = len(problem.names)
    rng = np.random.default_rng(0)
    starts = [start] if start is not None else [rng.dirichlet(np.ones(q)) for _ in range(STARTS)]
    matrices, prior = _unit_scaled(problem)

    def minus(w: Array) -> tuple[float, Array]:
        M = prior + np.tensordot(w, matrices, axes=1)
        value = np.linalg.slogdet(M)[1]
        if not np.isfinite(value):
            return 1e9, np.zeros(q)
        return -float(value), -np.einsum("ij,qji->q", np.linalg.inv(M), matrices)

    found = [start] if start is not None else []
    for w in starts:
        answer = scipy.optimize.minimize(
            minus,
            w,
            jac=True,
            method="SLSQP",
            bounds=list(zip(polytope.least, polytope.most, strict=True)),
            constraints=[
                {"type": "eq", "fun": lambda v: v.sum() - 1.0, "jac": lambda v: np.ones(q)},
                *(
                    {"type": "ineq", "fun": lambda v, r=r, c=c: c - r @ v, "jac": lambda v, r=r: -r}
                    for r, c in zip(polytope.rows, polytope.limits, strict=True)
                ),
            ],
            options={"maxiter": 500, "ftol": 1e-13},
        )
        found.append(polytope.tidied(answer.x))
    values = [-minus(w)[0] if _keeps(w, polytope) else -np.inf for w in found]
    if max(values) <= -1e9:
        raise NotInformative(
            "the recorded primitives do not inform about every parameter: the determinant is zero for all fractions "
            "that were tried",
            parameters=problem.parameters,
        )
    return found[int(np.argmax(values))]


def log_abs_det(problem: DurationProblem, fractions: Array, *, symmetric: bool = False) -> float:
    """log |det B(w)| in physical scale, or of the symmetric part; -inf where that is not positive definite."""
    M = problem.prior + np.tensordot(fractions, problem.matrices, axes=1)
    size = np.sqrt(np.where(np.abs(np.diag(M)) > 0, np.abs(np.diag(M)), 1.0))
    scaled = M / np.outer(size, size)
    if symmetric:
        values = np.linalg.eigvalsh(symmetric_part(scaled))
        return float(np.log(values).sum() + 2 * np.log(size).sum()) if values[0] > 0 else -np.inf
    return float(np.linalg.slogdet(scaled)[1] + 2 * np.log(size).sum())


def _unit_scaled(problem: DurationProblem) -> tuple[Array, Array]:
    """(q, d, d) and (d, d) with unit mean magnitude on the diagonal."""
    size = unit_scaling(problem)
    return problem.matrices / np.outer(size, size), problem.prior / np.outer(size, size)


def _keeps(w: Array, polytope: Polytope) -> bool:
    return bool((w <= polytope.most + 1e-9).all() and (polytope.rows @ w <= polytope.limits + 1e-8).all())


THEOREMS = {
    "D": "Kiefer and Wolfowitz 1960",
    "D_s": "Pukelsheim 2006, general equivalence theorem",
    "A": "Pukelsheim 2006, general equivalence theorem",
    "E": "Pukelsheim 2006, general equivalence theorem with a mixture of eigenvectors",
    "V": "Pukelsheim 2006, general equivalence theorem",
    "T": "Pukelsheim 2006, general equivalence theorem with a mixture of causes",
}

NO_THEOREM = (
    "none: recorded primitives make the problem non-convex; the guaranteed value is that of the symmetric part "
    "(Ostrowski and Taussky 1951), improved by local search"
)
NOTHING_DEFINITE = (
    "none: recorded primitives make the problem non-convex, and no fractions make the symmetric part positive "
    "definite; found by local search from random starts"
)
LOCAL_SEARCH = "local search by SciPy's SLSQP"
"""Recorded primitives have no concave problem that cvxpy could state: log |det B(w)| of B that are not symmetric."""
PACKAGES = {CVXPY: ("cvxpy", "clarabel"), NEWTON: ("cvxpy", "clarabel"), LOCAL_SEARCH: ("scipy",)}
"""What each method is part of; the others are this package's own."""


def solve_durations(problem: DurationProblem) -> DurationDesign:
    """The optimal time fractions by the problem's criterion, their certificate, and whole runs.

    A problem of moderate size is solved as it is stated, see `maximise`; `solver` of the answer says what found it.

    Raises:
        UnknownName, InputError: the aim or the limits are wrong.
        NotInformative: no shares inform about every parameter.
        NoAnswer: no fractions satisfy the limits, the gap stays above `LARGEST_GAP`, or whole runs do
            not fit.
    """
    design = _shares(problem, as_stated=True)
    if not problem.floors or problem.aim.criterion == T:
        return _with_runs(design, whole_runs(problem, design.fractions))
    return _with_runs(design, runs_above_floors(problem, _tightened(problem, design.fractions), _shortfall(problem)))


def _shortfall(problem: DurationProblem) -> Callable[[Array], float]:
    """How far shares of the time (q,) fall short of every least information, as a sum of logarithms."""
    floors = [information_floor(item) for item in problem.floors]

    def missing(shares: Array) -> float:
        short = np.array([floor.value(shares) for floor in floors])
        return float(-short[short < -FLOOR_ROUNDING].sum())

    return missing


def _tightened(problem: DurationProblem, fractions: Array) -> Iterator[Array]:
    """Optimal fractions (q,), then those that keep more than the least information, of which rounding takes some."""
    yield fractions
    for factor in TIGHTENED:
        floors = tuple(replace(item, least=factor * item.least) for item in problem.floors)
        try:
            yield optimal_shares(replace(problem, floors=floors)).fractions
        except NoAnswer:
            return


def optimal_shares(problem: DurationProblem) -> DurationDesign:
    """As `solve_durations`, but by the quickest method and without whole runs.

    `repeats` are all zero and their efficiency is nan.
    """
    return _shares(problem, as_stated=False)


def _shares(problem: DurationProblem, *, as_stated: bool) -> DurationDesign:
    begun = time.perf_counter()
    try:
        if problem.symmetric:
            design, method = _certified_shares(problem, None, as_stated=as_stated)
        else:
            design, method = _improved_shares(problem), LOCAL_SEARCH
    except np.linalg.LinAlgError:
        raise _not_informative(problem) from None
    versions = {name: version(name) for name in PACKAGES.get(method, ())} or {"expdesign": __version__}
    return replace(design, solver=Solver(name=method, versions=versions, wall_s=time.perf_counter() - begun))


def _not_informative(problem: DurationProblem) -> NotInformative:
    """The error that names the parameters without information within the limits."""
    blind = unidentifiable(problem, polytope_of(problem).most) or problem.parameters
    return NotInformative(
        f"no durations within the limits of [design] inform about every parameter, to working precision; too little or "
        f"no information about {', '.join(blind)}",
        parameters=blind,
    )


def concave_problem(problem: DurationProblem, *, within: Array | None = None) -> ConcaveProblem:
    """The concave problem of a duration problem; `within` as in `objective_of`.

    With budgets it may be optimal to leave time unused: an idle primitive without information and without cost is then
    added at the end.

    Raises:
        UnknownName, InputError: the aim or the limits are wrong.
        NotInformative: equal shares do not inform about every parameter.
        NoAnswer: no fractions satisfy the limits.
    """
    if problem.aim.criterion == T:
        return _about_other_parameters(problem)
    measure = criterion(problem.aim.criterion).measure(problem.picked)
    if problem.constraints.budgets:
        problem, measure = with_idle(problem), collected_measure(problem, problem.aim.criterion)
    floors = floors_of(problem)
    return ConcaveProblem(
        objective=objective_of(problem, measure, within=within),
        polytope=polytope_of(problem),
        floors=tuple(floors.values()),
        floor_names=tuple(floors),
    )


def _about_other_parameters(problem: DurationProblem) -> ConcaveProblem:
    """The concave problem of criterion T; a balance between equations is kept."""
    problem = with_idle(problem) if problem.constraints.budgets else problem
    balances = _balances(problem)
    return ConcaveProblem(
        objective=least_of_floors(problem),
        polytope=polytope_of(problem),
        floors=tuple(balances.values()),
        floor_names=tuple(balances),
    )


def floors_of(problem: DurationProblem) -> dict[str, Objective]:
    """Concave functions that must not be negative, by name.

    One per equation with a balance: its log det above the balanced share of the best for it alone; one for every least
    information about other parameters.
    """
    return {**_balances(problem), **{item.name: information_floor(item) for item in problem.floors}}


def _balances(problem: DurationProblem) -> dict[str, Objective]:
    balance = problem.constraints.balance
    if not balance > 0:
        return {}
    if len(problem.equations) != len(problem.parameters):
        raise InputError("design.balance needs the equation of every parameter")
    polytope, floors = polytope_of(problem), {}
    for equation in dict.fromkeys(problem.equations):
        alone = floor_of(problem, equation)
        best = maximised(ConcaveProblem(objective=alone, polytope=polytope)).certificate.value
        floors[f"balance of equation {equation}"] = replace(
            alone, levels=np.array([best + alone.degree * np.log(balance)])
        )
    return floors


def _certified_shares(problem: DurationProblem, within: Array | None, *, as_stated: bool) -> tuple[DurationDesign, str]:
    """The optimum of the concave problem, and the method that found it.

    Args:
        problem: whose symmetric parts count.
        within: (q,) fractions at which the information is positive definite, where equal ones are not known to be.
        as_stated: as of `maximised`.
    """
    task = concave_problem(problem, within=within)
    if within is None and not np.isfinite(task.objective.value(task.polytope.middle())):
        raise np.linalg.LinAlgError
    best = maximised(task, THEOREMS.get(problem.aim.criterion, ""), as_stated=as_stated)
    if not best.gap < LARGEST_GAP:
        raise NoAnswer(
            f"the durations could not be certified: the gap in {problem.aim.criterion}-efficiency is {best.gap:.2g}, "
            f"at most {LARGEST_GAP:g} is accepted"
        )
    gap, count = max(best.gap * best.certificate.degree, 0.0), len(problem.names)
    certificate = replace(best.certificate, bound=best.certificate.value + gap, prices=best.certificate.prices[:count])
    fractions, own = best.fractions[:count], problem.aim.criterion == "D" and problem.robust == "nominal"
    log_det = log_abs_det(problem, fractions, symmetric=within is not None)
    if problem.constraints.budgets:  # with unused time, the information with means eliminated counts
        log_det = certificate.value if own else Collected.of(problem, "D").value(fractions)
    design = DurationDesign(
        problem=problem,
        fractions=fractions,
        sensitivities=best.sensitivities[:count],
        log_det=log_det,
        gap=gap,
        repeats=(0,) * len(problem.names),
        efficiency_repeats=float("nan"),
        efficiency_uniform=_uniform_efficiency(problem, fractions),
        certificate=certificate,
    )
    return design, best.method


def _improved_shares(problem: DurationProblem) -> DurationDesign:
    """Recorded primitives: the largest guaranteed value, where there is one, then a local search from it."""
    if problem.aim.criterion != "D" or len(problem.sampled):
        raise InputError(
            "recorded primitives (regressors measured, instruments simulated) need criterion D and the nominal model; "
            "simulate their commands for other criteria"
        )
    if problem.floors:
        raise InputError("design.reveal needs primitives that are simulated, not recorded ones")
    if problem.constraints.balance:
        raise InputError("design.balance needs primitives that are simulated, not recorded ones")
    polytope = polytope_of(problem)
    within = definite_start(problem, polytope)
    guaranteed = None if within is None else _certified_shares(problem, within, as_stated=False)[0]
    fractions = improved(problem, polytope, None if guaranteed is None else guaranteed.fractions)
    value = log_abs_det(problem, fractions)
    slope = np.einsum(
        "ij,qji->q",
        np.linalg.inv(problem.prior + np.tensordot(fractions, problem.matrices, axes=1)),
        problem.matrices,
    )
    return DurationDesign(
        problem=problem,
        fractions=fractions,
        sensitivities=slope,
        log_det=value,
        gap=float("inf"),
        repeats=(0,) * len(problem.names),
        efficiency_repeats=float("nan"),
        efficiency_uniform=_uniform_efficiency(problem, fractions),
        certificate=Certificate(
            kind=NO_THEOREM if guaranteed is not None else NOTHING_DEFINITE,
            value=value,
            bound=float("inf"),
            degree=problem.dimension,
            level=float(fractions @ slope),
            mixture=np.ones(1),
            prices=np.zeros(len(problem.names)),
            multipliers={},
            guaranteed=-np.inf if guaranteed is None else guaranteed.log_det,
        ),
    )


def with_repeats(design: DurationDesign, repeats: Sequence[int]) -> DurationDesign:
    """The optimum with other whole runs and their efficiency.

    Raises:
        NotInformative: the runs do not inform about every parameter.
    """
    problem, changed = design.problem, _with_runs(design, tuple(repeats))
    if not informs_about_all(problem, Collected.of(problem), np.array(repeats) * problem.run_s / problem.total_s):
        raise NotInformative("the given whole runs do not inform about every parameter", parameters=problem.parameters)
    return changed


def _with_runs(design: DurationDesign, repeats: tuple[int, ...]) -> DurationDesign:
    runs = np.array(repeats)
    efficiency = efficiency_of_shares(
        design.problem, design.fractions, runs * design.problem.run_s / design.problem.total_s
    )
    return replace(design, repeats=repeats, efficiency_repeats=efficiency, note=note_on_runs(design.problem, runs))


def _uniform_efficiency(problem: DurationProblem, fractions: Array) -> float:
    """Of equal time on every primitive that is not excluded."""
    return efficiency_of_shares(problem, fractions, problem.included / problem.included.sum())
