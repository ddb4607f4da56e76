"""Problem -> durations with a certificate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.durations.asymmetric import definite_start, improved, log_abs_det
from expdesign.durations.certificate import certify
from expdesign.durations.collected import Collected
from expdesign.durations.constraints import NO_CONSTRAINTS, Constraints
from expdesign.durations.criteria import Aim
from expdesign.durations.estimable import unseen
from expdesign.durations.interior import Task, climb
from expdesign.durations.objective import SHAKY
from expdesign.durations.rounding import (
    efficiency_of_runs,
    efficiency_of_shares,
    note_on_runs,
    sees_everything,
    whole_runs,
)
from expdesign.durations.task import polytope_of, start_of, task_of
from expdesign.durations.values import Certificate, DurationDesign, DurationProblem
from expdesign.errors import InputError, NoAnswer, NotInformative, UnknownName
from expdesign.information import MEAN_SUBTRACTIONS, PrimitiveInformation, check_informative
from expdesign.values import Array

LARGEST_GAP = 1e-6
"""Certificates above this, per degree, are not given out as optimal designs."""
WIDEST = 1e-7
TOLERANCES = {"smooth": (1e-10, 1e-8, WIDEST), "cornered": (1e-7, 1e-8, 1e-9)}
"""What the solver aims at, per degree, one after the other until the certificate holds."""
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
) -> DurationProblem:
    """The duration problem of a scored dictionary.

    Args:
        information: of each primitive, by the nominal model.
        parameters: p names in the order of the matrices.
        total_s: time to share out [s].
        mean_subtraction: "none", "batch" or "complete".
        aim: criterion and what it needs; D when not given.
        constraints: limits on the sharing.
        prior: (d, d) what is known already, per sample of the total time; see `prior_information`.
        sampled: the information again by every model drawn from the prior of the nominal parameters.
        robust: "nominal", or what the sampled models count for: "average" or "worst".
        equations: of each parameter; only needed for `constraints.balance`.
        nuisance: parameters of disturbances that are estimated along.

    Raises:
        UnknownName: no such mean subtraction.
        NotInformative: no shares of these primitives inform about every parameter.
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
    )


def _stack(information: Sequence[PrimitiveInformation], mean_subtraction: str) -> Array:
    return np.array([bordered(item, mean_subtraction) for item in information])


def bordered(item: PrimitiveInformation, mean_subtraction: str) -> Array:
    """B_q of one primitive, linear in time fractions: see `DurationProblem`."""
    return bordered_moments(item.X, item.Y, item.Z, item.YZ, mean_subtraction)


def bordered_moments(X: Array, Y: Array, Z: Array, YZ: Array, mean_subtraction: str) -> Array:
    """The same of moments X (p, p), means Y and Z (p, outputs) and the means' products YZ (p, p)."""
    if mean_subtraction == "none":
        return X
    if mean_subtraction == "batch":
        return X - YZ
    return np.block([[X, Y], [Z.T, np.eye(Y.shape[1])]])


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


def _certified_shares(problem: DurationProblem, within: Array | None) -> DurationDesign:
    """The optimum of the concave problem.

    Args:
        problem: whose symmetric parts count.
        within: (q,) fractions at which the information is positive definite, where equal ones are not known to be.
    """
    task = task_of(problem, within=within)
    start, best = start_of(task, within=within), None
    if not np.isfinite(task.objective.value(start)):
        raise np.linalg.LinAlgError
    cornered = problem.aim.criterion == "E" or problem.robust == "worst"
    for tolerance in TOLERANCES["cornered" if cornered else "smooth"]:
        try:
            found = climb(task, start, tolerance=tolerance)
            answer = certify(task, found, kind=THEOREMS.get(problem.aim.criterion, ""))
        except np.linalg.LinAlgError:
            continue
        if _shaky(task, found.fractions) and tolerance < WIDEST:
            continue  # the optimum is singular; a wider barrier keeps so far away that the certificate means something
        if best is None or answer[0].bound - answer[0].value < best[1][0].gap:
            best = (found, answer)
        if best[1][0].gap < 0.3 * LARGEST_GAP * best[1][0].degree:
            break
    if best is None:
        raise np.linalg.LinAlgError
    found, (certificate, slope) = best
    if not certificate.gap < LARGEST_GAP * certificate.degree:
        raise NoAnswer(
            f"the durations could not be certified: a design better by {certificate.gap / certificate.degree:.2g} "
            f"in {problem.aim.criterion}-efficiency is not excluded, at most {LARGEST_GAP:g} is accepted"
        )
    gap, count = max(certificate.gap, 0.0), len(problem.names)
    certificate = replace(certificate, bound=certificate.value + gap, prices=certificate.prices[:count])
    fractions, own = found.fractions[:count], problem.aim.criterion == "D" and problem.robust == "nominal"
    log_det = log_abs_det(problem, fractions, symmetric=within is not None)
    if problem.constraints.budgets:  # unused time: what is collected counts, with means eliminated
        log_det = certificate.value if own else Collected.of(problem, "D").value(fractions)
    return DurationDesign(
        problem=problem,
        fractions=fractions,
        sensitivities=slope[:count],
        log_det=log_det,
        gap=gap,
        repeats=(0,) * len(problem.names),
        efficiency_repeats=float("nan"),
        efficiency_uniform=_uniform_efficiency(problem, fractions),
        certificate=certificate,
    )


def _shaky(task: Task, fractions: Array) -> bool:
    """Whether rounding shows in what is computed at fractions (q,)."""
    values = [np.linalg.eigvalsh(piece.matrix(fractions)) for piece in task.objective.pieces]
    return any(item[0] < SHAKY * item[-1] for item in values)


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
    efficiency = efficiency_of_runs(design.problem, design.fractions, runs)
    return replace(design, repeats=repeats, efficiency_repeats=efficiency, note=note_on_runs(design.problem, runs))


def _uniform_efficiency(problem: DurationProblem, fractions: Array) -> float:
    return efficiency_of_shares(problem, fractions, np.full(len(problem.names), 1.0 / len(problem.names)))
