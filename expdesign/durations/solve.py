"""From a duration problem to certified durations.

D without limits is solved by the working-set method of `large_scale`. Other smooth criteria are solved by Newton's
method under the limits, and E, or an optimum with singular information, as a conic problem. The certificate is computed
from the problem alone; a design without one is not returned.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.durations.asymmetric import definite_start, improved, log_abs_det
from expdesign.durations.certificate import Certificate, DurationDesign, certify
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
    unidentifiable,
    with_idle,
)
from expdesign.durations.criteria import criterion
from expdesign.durations.criteria.models import Indices, Objective
from expdesign.durations.large_scale import d_optimal, rows_of
from expdesign.durations.problem import DurationProblem
from expdesign.durations.rounding import efficiency_of_shares, note_on_runs, runs_above_floors, whole_runs
from expdesign.durations.tuning import TUNING
from expdesign.errors import FloorOutOfReach, InputError, NoAnswer, NotInformative
from expdesign.values import Array

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


def solve_durations(problem: DurationProblem) -> DurationDesign:
    """The optimal time fractions by the problem's criterion, their certificate, and whole runs.

    Raises:
        UnknownName, InputError: the aim or the limits are wrong.
        NotInformative: no shares inform about every parameter.
        NoAnswer: no fractions satisfy the limits, the gap stays above `Tuning.largest_gap`, or whole runs do
            not fit.
    """
    design = optimal_shares(problem)
    if not problem.floors or problem.aim.criterion == T:
        return _with_runs(design, whole_runs(problem, design.fractions))
    return _with_runs(design, runs_above_floors(problem, _tightened(problem, design.fractions), _shortfall(problem)))


def _shortfall(problem: DurationProblem) -> Callable[[Array], float]:
    """How far shares of the time (q,) fall short of every least information, as a sum of logarithms."""
    floors = [information_floor(item) for item in problem.floors]

    def missing(shares: Array) -> float:
        short = np.array([floor.value(shares) for floor in floors])
        return float(-short[short < -TUNING.floor_rounding].sum())

    return missing


def _tightened(problem: DurationProblem, fractions: Array) -> Iterator[Array]:
    """Optimal fractions (q,), then those that keep more than the least information, of which rounding takes some."""
    yield fractions
    for factor in TUNING.tightened:
        floors = tuple(replace(item, least=factor * item.least) for item in problem.floors)
        try:
            yield optimal_shares(replace(problem, floors=floors)).fractions
        except NoAnswer:
            return


def optimal_shares(problem: DurationProblem) -> DurationDesign:
    """As `solve_durations`, but without whole runs: `repeats` are all zero and their efficiency is nan."""
    try:
        return _certified_shares(problem, None) if problem.symmetric else _improved_shares(problem)
    except np.linalg.LinAlgError:
        raise _not_informative(problem) from None


def _not_informative(problem: DurationProblem) -> NotInformative:
    """The error that names the parameters without information within the limits."""
    blind = unidentifiable(problem, polytope_of(problem).most) or problem.parameters
    return NotInformative(
        f"no durations within the limits of [design] inform about every parameter, to working precision; too little or "
        f"no information about {', '.join(blind)}",
        parameters=blind,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Optimum:
    """Fractions (q,), their certificate, and the criterion's sensitivities (q,) there."""

    fractions: Array
    certificate: Certificate
    sensitivities: Array

    @property
    def gap(self) -> float:
        """Per degree."""
        return self.certificate.gap / self.certificate.degree


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
        best = _maximised(ConcaveProblem(objective=alone, polytope=polytope)).certificate.value
        floors[f"balance of equation {equation}"] = replace(
            alone, levels=np.array([best + alone.degree * np.log(balance)])
        )
    return floors


def _maximised(task: ConcaveProblem, kind: str = "") -> _Optimum:
    """The optimum with its certificate.

    Raises:
        NoAnswer: the floors cannot all be kept.
        numpy.linalg.LinAlgError: every feasible design is singular.
    """
    least = task.polytope.least
    if not 1.0 - least.sum() > TUNING.loosening:  # least times take everything
        return _proven(task, least / least.sum(), kind)
    if task.plain_d and (w := _plain_d(task)) is not None:
        return _proven(task, w, kind)
    if task.smooth and (found := _by_newton(task, kind)) is not None:
        return found
    from expdesign.durations._cvxpy import conic_optimum

    answer = conic_optimum(task)
    if task.floors:
        _check_floors(task, None if answer is None else answer[0])
    if answer is None:
        raise np.linalg.LinAlgError
    w, multipliers = answer
    return _sharpened(task, _proven(task, task.polytope.tidied(w), kind, multipliers))


def _proven(task: ConcaveProblem, w: Array, kind: str, multipliers: Sequence[Array] = ()) -> _Optimum:
    certificate, slope = certify(task, w, kind=kind, multipliers=multipliers)
    return _Optimum(fractions=w, certificate=certificate, sensitivities=slope)


def _plain_d(task: ConcaveProblem) -> Array | None:
    """The D-optimal fractions, with the least times as prior; None where a B_q is indefinite."""
    (piece,), polytope = task.objective.pieces, task.polytope
    free = np.flatnonzero(polytope.most > polytope.least)
    left = 1.0 - float(polytope.least.sum())
    rows = rows_of(piece.matrices[free])
    if rows is None:
        return None
    w = np.array(polytope.least)
    w[free] += left * d_optimal(rows, prior=piece.matrix(polytope.least) / left, tolerance=TUNING.target_gap).fractions
    return w


def _by_newton(task: ConcaveProblem, kind: str) -> _Optimum | None:
    """The optimum of smooth measures by Newton's method from the middle, or None where that does not lead there."""
    try:
        found = _sharpened(task, _proven(task, task.polytope.middle(), kind))
    except np.linalg.LinAlgError:
        return None
    return found if found.gap < TUNING.largest_gap and _floors_kept(task, found.fractions) else None


def _sharpened(task: ConcaveProblem, best: _Optimum) -> _Optimum:
    """An optimum with a gap no wider, by Newton's method under all limits, where every measure is smooth."""
    if not task.smooth:
        return best
    from expdesign.durations._cvxpy import newton_step

    here = best
    for _ in range(TUNING.newton_steps):
        if best.gap < TUNING.target_gap:
            break
        proof, w = here.certificate, here.fractions
        prices = [proof.multipliers[name] for name in task.floor_names]
        try:
            step = newton_step(task, w, chosen=_working_set(task, here), mixture=proof.mixture, floor_prices=prices)
            moved = None if step is None else _ascended(task, w, step, prices)
            if moved is None:
                break
            here = _proven(task, moved, proof.kind)
        except np.linalg.LinAlgError:
            break
        before, best = best.gap, min(best, here, key=lambda item: item.gap)
        if before / 2 < best.gap < TUNING.rounding_gap:
            break
    return best


def _working_set(task: ConcaveProblem, here: _Optimum) -> Indices:
    """(c,) fractions above their least value, and those whose net sensitivity lets them rise."""
    proof = here.certificate
    rising = here.sensitivities - proof.prices > proof.level - TUNING.margin * proof.degree
    return np.flatnonzero(rising | (here.fractions > task.polytope.least))


def _ascended(task: ConcaveProblem, w: Array, step: Array, prices: Sequence[float]) -> Array | None:
    """Fractions (q,) along a step that raise the merit, by backtracking; None where none do."""

    def merit(v: Array) -> float:
        missed = [min(floor.value(v), 0.0) for floor in task.floors]
        return task.objective.value(v) + sum((2 * p + 1) * short for p, short in zip(prices, missed, strict=True))

    before = merit(w)
    for length in 0.5 ** np.arange(20):
        moved = task.polytope.tidied(w + length * step)
        if merit(moved) > before - 1e-13 * abs(before):
            return moved
    return None


def _floors_kept(task: ConcaveProblem, w: Array) -> bool:
    return all(floor.value(w) > -TUNING.floor_rounding for floor in task.floors)


def _check_floors(task: ConcaveProblem, w: Array | None) -> None:
    """Raises NoAnswer where fractions (q,) violate a floor because the floors contradict each other."""
    if w is not None and _floors_kept(task, w):
        return
    together = Objective(
        tuple(floor.pieces[0] for floor in task.floors),
        np.concatenate([floor.levels for floor in task.floors]),
        worst=True,
    )
    best = _maximised(ConcaveProblem(objective=together, polytope=task.polytope)).fractions
    kept = min(float(np.exp(floor.value(best) / floor.degree)) for floor in task.floors)
    balances = tuple(name for name in task.floor_names if name.startswith("balance"))
    if kept < 1.0 and len(balances) < len(task.floors):
        _check_each(task)
        raise NoAnswer(
            f"no durations within the other limits keep {', '.join(task.floor_names)} together, though each alone; at "
            f"most {kept:.3g} times what is asked of each is possible"
        )
    if kept < 1.0:
        raise NoAnswer(
            "design.balance cannot be met: no durations within the other limits are this informative about every "
            f"equation; at most {kept:.3g} times the required share is possible"
        )


def _check_each(task: ConcaveProblem) -> None:
    """Raises FloorOutOfReach for the first floor that cannot be kept even alone."""
    for name, floor in zip(task.floor_names, task.floors, strict=True):
        alone = replace(floor, levels=np.zeros(1))
        most = _maximised(ConcaveProblem(objective=alone, polytope=task.polytope)).certificate.value
        if most < floor.levels[0]:
            raise FloorOutOfReach(name, share=float(np.exp((most - floor.levels[0]) / floor.degree)))


def _certified_shares(problem: DurationProblem, within: Array | None) -> DurationDesign:
    """The optimum of the concave problem.

    Args:
        problem: whose symmetric parts count.
        within: (q,) fractions at which the information is positive definite, where equal ones are not known to be.
    """
    task = concave_problem(problem, within=within)
    if within is None and not np.isfinite(task.objective.value(task.polytope.middle())):
        raise np.linalg.LinAlgError
    best = _maximised(task, THEOREMS.get(problem.aim.criterion, ""))
    if not best.gap < TUNING.largest_gap:
        raise NoAnswer(
            f"the durations could not be certified: the gap in {problem.aim.criterion}-efficiency is {best.gap:.2g}, "
            f"at most {TUNING.largest_gap:g} is accepted"
        )
    gap, count = max(best.certificate.gap, 0.0), len(problem.names)
    certificate = replace(best.certificate, bound=best.certificate.value + gap, prices=best.certificate.prices[:count])
    fractions, own = best.fractions[:count], problem.aim.criterion == "D" and problem.robust == "nominal"
    log_det = log_abs_det(problem, fractions, symmetric=within is not None)
    if problem.constraints.budgets:  # with unused time, the information with means eliminated counts
        log_det = certificate.value if own else Collected.of(problem, "D").value(fractions)
    return DurationDesign(
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
    guaranteed = None if within is None else _certified_shares(problem, within)
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
    """The same optimum with other whole runs and their efficiency.

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
    return efficiency_of_shares(problem, fractions, np.full(len(problem.names), 1.0 / len(problem.names)))
