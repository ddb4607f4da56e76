"""Problem -> durations with a certificate.

Plain D goes through the working-set method for many candidates. Every other criterion and limit is stated in cvxpy; a
few Newton steps sharpen its answer. Either way the certificate is computed from the problem alone, and a design without
one is not given out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.durations.asymmetric import definite_start, improved, log_abs_det
from expdesign.durations.certificate import Certificate, DurationDesign, certify
from expdesign.durations.collected import Collected, sees_everything, unseen
from expdesign.durations.concave import (
    ConcaveProblem,
    collected_measure,
    floor_of,
    objective_of,
    polytope_of,
    with_idle,
)
from expdesign.durations.criteria import criterion
from expdesign.durations.criteria.models import Objective
from expdesign.durations.large_scale import d_optimal, rows_of
from expdesign.durations.limits import TIGHT
from expdesign.durations.problem import DurationProblem
from expdesign.durations.rounding import efficiency_of_shares, note_on_runs, whole_runs
from expdesign.errors import InputError, NoAnswer, NotInformative
from expdesign.values import Array

LARGEST_GAP = 1e-6
"""Certificates above this, per degree, are not given out as optimal designs."""
AIM = 1e-10
"""Gap per degree at which sharpening ends."""
NEWTON_STEPS = 30
"""Most steps that sharpen an answer; from the convex solver's two or three are usual."""
FLOOR_ROUNDING = 1e-6
"""A floor missed by less, as a logarithm, is rounding."""
THEOREMS = {
    "D": "Kiefer and Wolfowitz 1960",
    "D_s": "Pukelsheim 2006, general equivalence theorem",
    "A": "Pukelsheim 2006, general equivalence theorem",
    "E": "Pukelsheim 2006, general equivalence theorem with a mixture of eigenvectors",
    "V": "Pukelsheim 2006, general equivalence theorem",
}

NO_THEOREM = (
    "none: recorded primitives make the problem non-convex; the guaranteed value is that of the symmetric part "
    "(Ostrowski and Taussky 1951), the rest was found by local search"
)
NOTHING_DEFINITE = (
    "none: recorded primitives make the problem non-convex, and no sharing makes the symmetric part positive definite; "
    "found by local search from random starts"
)


def solve_durations(problem: DurationProblem) -> DurationDesign:
    """The optimal time fractions by the problem's criterion, whole runs, and the proof of both.

    Raises:
        UnknownName, InputError: the aim or the limits are wrong.
        NotInformative: no shares inform about every parameter.
        NoAnswer: no sharing meets the limits, the certificate cannot be brought below `LARGEST_GAP`, or whole runs do
            not fit.
    """
    design = optimal_shares(problem)
    return _with_runs(design, whole_runs(problem, design.fractions))


def optimal_shares(problem: DurationProblem) -> DurationDesign:
    """As `solve_durations`, but without whole runs: `repeats` are all zero and their efficiency is nan."""
    try:
        return _certified_shares(problem, None) if problem.symmetric else _improved_shares(problem)
    except np.linalg.LinAlgError:
        raise _blinded(problem) from None


def _blinded(problem: DurationProblem) -> NotInformative:
    """What the limits leave too little time for."""
    blind = unseen(problem, polytope_of(problem).most) or problem.parameters
    return NotInformative(
        f"what the limits of [design] leave does not inform about every parameter, to working precision; too little or "
        f"nothing is told of {', '.join(blind)}",
        parameters=blind,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Optimum:
    """Fractions (q,), what they prove, and the criterion's sensitivities (q,) there."""

    fractions: Array
    certificate: Certificate
    sensitivities: Array

    @property
    def gap(self) -> float:
        """Per degree."""
        return self.certificate.gap / self.certificate.degree


def concave_problem(problem: DurationProblem, *, within: Array | None = None) -> ConcaveProblem:
    """The concave problem of a duration problem; `within` as in `objective_of`.

    Where budgets limit what is used up, some of the time may be better left unused: there is then one more primitive at
    the end, idling, which informs about nothing and costs nothing.

    Raises:
        UnknownName, InputError: the aim or the limits are wrong.
        NotInformative: equal shares do not inform about every parameter.
        NoAnswer: no sharing meets the limits.
    """
    measure = criterion(problem.aim.criterion).measure(problem.picked)
    if problem.constraints.budgets:
        problem, measure = with_idle(problem), collected_measure(problem, problem.aim.criterion)
    floors = floors_of(problem)
    return ConcaveProblem(
        objective=objective_of(problem, measure, within=within),
        polytope=polytope_of(problem),
        floors=tuple(floors.values()),
        floor_names=tuple(f"balance of equation {equation}" for equation in floors),
    )


def floors_of(problem: DurationProblem) -> dict[str, Objective]:
    """One concave function per equation: its log det above the balanced share of the best for it alone."""
    balance = problem.constraints.balance
    if not balance > 0:
        return {}
    if len(problem.equations) != len(problem.parameters):
        raise InputError("design.balance needs the equation of every parameter")
    polytope, floors = polytope_of(problem), {}
    for equation in dict.fromkeys(problem.equations):
        alone = floor_of(problem, equation)
        best = _maximised(ConcaveProblem(objective=alone, polytope=polytope)).certificate.value
        floors[equation] = replace(alone, levels=np.array([best + alone.degree * np.log(balance)]))
    return floors


def _maximised(task: ConcaveProblem, kind: str = "") -> _Optimum:
    """The optimum with its certificate.

    Raises:
        NoAnswer: the floors cannot all be kept.
        numpy.linalg.LinAlgError: what the limits leave is singular.
    """
    least = task.polytope.least
    if not 1.0 - least.sum() > TIGHT:  # least times take everything
        return _proven(task, least / least.sum(), kind)
    if task.plain_d and (w := _plain_d(task)) is not None:
        return _proven(task, w, kind)
    if (
        len(task.objective.pieces) > 1 and task.smooth and not task.floors
    ):  # Newton's method is quicker with many models
        found = _sharpened(task, _proven(task, task.polytope.middle(), kind))
        if found.gap < LARGEST_GAP:
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
    """The D-optimal fractions, what has to be spent counted as known before; None where a B_q is indefinite."""
    (piece,), polytope = task.objective.pieces, task.polytope
    free = np.flatnonzero(polytope.most > polytope.least)
    left = 1.0 - float(polytope.least.sum())
    rows = rows_of(piece.matrices[free])
    if rows is None:
        return None
    w = np.array(polytope.least)
    w[free] += left * d_optimal(rows, prior=piece.matrix(polytope.least) / left, tolerance=AIM).fractions
    return w


def _sharpened(task: ConcaveProblem, best: _Optimum) -> _Optimum:
    """The same or better by Newton's method with all limits kept, where every measure is smooth."""
    if not task.smooth:
        return best
    from expdesign.durations._cvxpy import newton_step

    here = best
    for _ in range(NEWTON_STEPS):
        if best.gap < AIM:
            break
        proof, w = here.certificate, here.fractions
        prices = [proof.multipliers[name] for name in task.floor_names]
        try:
            step = newton_step(task, w, mixture=proof.mixture, floor_prices=prices)
            moved = None if step is None else _ascended(task, w, step, prices)
            if moved is None:
                break
            here = _proven(task, moved, proof.kind)
        except np.linalg.LinAlgError:
            break
        best = min(best, here, key=lambda item: item.gap)
    return best


def _ascended(task: ConcaveProblem, w: Array, step: Array, prices: Sequence[float]) -> Array | None:
    """Fractions (q,) that gain along a step, halved until they do; None where none gain."""

    def merit(v: Array) -> float:
        missed = [min(floor.value(v), 0.0) for floor in task.floors]
        return task.objective.value(v) + sum((2 * p + 1) * short for p, short in zip(prices, missed, strict=True))

    before = merit(w)
    for length in 0.5 ** np.arange(20):
        moved = task.polytope.tidied(w + length * step)
        if merit(moved) > before - 1e-13 * abs(before):
            return moved
    return None


def _check_floors(task: ConcaveProblem, w: Array | None) -> None:
    """Raises NoAnswer where fractions (q,) miss a floor because all cannot be kept together."""
    if w is not None and all(floor.value(w) > -FLOOR_ROUNDING for floor in task.floors):
        return
    together = Objective(
        tuple(floor.pieces[0] for floor in task.floors),
        np.concatenate([floor.levels for floor in task.floors]),
        worst=True,
    )
    best = _maximised(ConcaveProblem(objective=together, polytope=task.polytope)).fractions
    kept = min(float(np.exp(floor.value(best) / floor.degree)) for floor in task.floors)
    if kept < 1.0:
        raise NoAnswer(
            "design.balance cannot be met: no sharing within the other limits informs so well about every equation; "
            f"{kept:.3g} times the asked share was found"
        )


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
    if not best.gap < LARGEST_GAP:
        raise NoAnswer(
            f"the durations could not be certified: a design better by {best.gap:.2g} "
            f"in {problem.aim.criterion}-efficiency is not excluded, at most {LARGEST_GAP:g} is accepted"
        )
    gap, count = max(best.certificate.gap, 0.0), len(problem.names)
    certificate = replace(best.certificate, bound=best.certificate.value + gap, prices=best.certificate.prices[:count])
    fractions, own = best.fractions[:count], problem.aim.criterion == "D" and problem.robust == "nominal"
    log_det = log_abs_det(problem, fractions, symmetric=within is not None)
    if problem.constraints.budgets:  # unused time: what is collected counts, with means eliminated
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
    """Recorded primitives: the best guaranteed value first, where there is one, then a local search from it."""
    if problem.aim.criterion != "D" or len(problem.sampled):
        raise InputError(
            "recorded primitives (regressors measured, instruments simulated) can only be shared out by criterion D "
            "for the nominal model; simulate their commands for the others"
        )
    if problem.constraints.balance:
        raise InputError("design.balance needs primitives that are simulated, not recorded ones")
    polytope = polytope_of(problem)
    within, _ = definite_start(problem, polytope)
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
    """The same optimum with other whole runs, their efficiency measured against it.

    Raises:
        NotInformative: the runs do not inform about every parameter.
    """
    problem, changed = design.problem, _with_runs(design, tuple(repeats))
    if not sees_everything(problem, Collected.of(problem), np.array(repeats) * problem.run_s / problem.total_s):
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
