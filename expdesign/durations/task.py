"""From a duration problem to the concave task that the interior-point method solves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.durations.constraints import Polytope, feasible_set
from expdesign.durations.criteria import LogDet, Measure, criterion
from expdesign.durations.interior import Task, climb, warmed
from expdesign.durations.objective import Objective, pieces_of
from expdesign.durations.values import DurationProblem
from expdesign.errors import InputError, NoAnswer
from expdesign.values import Array

IDLE = "(unused time)"


def symmetric_part(matrices: Array) -> Array:
    """(..., d, d) half the sum with the transpose."""
    return np.asarray((matrices + np.swapaxes(matrices, -1, -2)) / 2)


def objective_of(problem: DurationProblem, measure: Measure, *, within: Array | None = None) -> Objective:
    """A measure over the models that the problem asks to be robust against.

    Args:
        problem: whose symmetric parts count.
        measure: of the information matrix.
        within: (q,) fractions where the information is positive definite; equal ones when not given.

    Raises:
        NotInformative: equal shares do not inform about every parameter.
    """
    stacks = problem.sampled if len(problem.sampled) else problem.matrices[None]
    stacks, prior = symmetric_part(stacks), symmetric_part(problem.prior)
    pieces = pieces_of(stacks, [prior] * len(stacks), [measure] * len(stacks), within=within)
    return Objective(pieces, np.zeros(len(stacks)), worst=problem.robust == "worst")


def polytope_of(problem: DurationProblem) -> Polytope:
    """The linear limits.

    Raises:
        UnknownName, InputError, NoAnswer: see `feasible_set`.
    """
    return feasible_set(problem.constraints, problem.names, run_s=problem.run_s, total_s=problem.total_s)


def limits_of(problem: DurationProblem) -> Polytope:
    """The linear limits of shares (q,) that need not take all the time.

    Raises:
        UnknownName, InputError, NoAnswer: see `feasible_set`.
    """
    whole, count = polytope_of(with_idle(problem)), len(problem.names)
    return replace(whole, least=whole.least[:count], most=whole.most[:count], rows=whole.rows[:, :count])


def task_of(problem: DurationProblem, *, within: Array | None = None) -> Task:
    """The concave task of a problem; `within` as in `objective_of`.

    Where budgets limit what is used up, some of the time may be better left unused: the task then has one more
    primitive at its end, idling, which informs about nothing and costs nothing.

    Raises:
        UnknownName, InputError: the aim or the limits are wrong.
        NotInformative: equal shares do not inform about every parameter.
        NoAnswer: no sharing meets the limits.
    """
    measure = criterion(problem.aim.criterion).measure(problem.picked)
    if problem.constraints.budgets:
        problem, measure = with_idle(problem), collected_measure(problem, problem.aim.criterion)
    objective = objective_of(problem, measure, within=within)
    floors = floors_of(problem)
    return Task(
        objective=objective,
        polytope=polytope_of(problem),
        floors=tuple(floors.values()),
        floor_names=tuple(f"balance of equation {equation}" for equation in floors),
    )


def with_idle(problem: DurationProblem) -> DurationProblem:
    """The problem with a primitive of no information at its end."""
    nothing = np.zeros((1, *problem.matrices.shape[1:]))
    sampled = problem.sampled
    if len(sampled):
        sampled = np.concatenate([sampled, np.zeros((len(sampled), *nothing.shape))], axis=1)
    return replace(
        problem,
        names=(*problem.names, IDLE),
        matrices=np.concatenate([problem.matrices, nothing]),
        run_s=np.r_[problem.run_s, problem.total_s],
        sampled=sampled,
    )


def collected_measure(problem: DurationProblem, name: str) -> Measure:
    """The measure of a criterion that stays right when times do not sum to one: means are eliminated, not counted."""
    if name == "D":
        return LogDet(problem.picked.columns(problem.parameters))
    return criterion(name).measure(problem.picked)


def start_of(task: Task, *, within: Array | None = None) -> Array:
    """(q,) fractions strictly inside the limits, near `within` where that is given.

    Raises:
        NoAnswer: the floors cannot all be kept.
    """
    if task.polytope.plain:
        start: Array | None = np.full(len(task.polytope.least), 1.0 / len(task.polytope.least))
    else:
        start = task.polytope.inside()
    if start is None:  # a checked polytope has points; only rounding leaves it no inside
        start = task.polytope.loosened().inside()
    if start is None:
        start = np.array(task.polytope.least)
    if within is not None:
        nearer = (within + share * (start - within) for share in 0.5 ** np.arange(1, 60))
        return next((w for w in nearer if np.isfinite(task.objective.value(w))), within)
    if not task.floors:
        return warmed(task, start)
    least = Objective(
        tuple(piece for floor in task.floors for piece in floor.pieces),
        np.concatenate([floor.levels for floor in task.floors]),
        worst=True,
    )
    best = climb(Task(objective=least, polytope=task.polytope), start, tolerance=1e-6).fractions
    inside = 0.99 * best + 0.01 * start if least.value(0.99 * best + 0.01 * start) > 0 else best
    if not least.value(inside) > 0:
        kept = min(float(np.exp(floor.value(best) / floor.pieces[0].measure.degree)) for floor in task.floors)
        raise NoAnswer(
            "design.balance cannot be met: no sharing within the other limits informs so well about every equation; "
            f"{kept:.3g} times the asked share was found"
        )
    return inside


def floors_of(problem: DurationProblem) -> dict[str, Objective]:
    """One concave function per equation: its log det above the balanced share of the best for it alone."""
    balance = problem.constraints.balance
    if not balance > 0:
        return {}
    if len(problem.equations) != len(problem.parameters):
        raise InputError("design.balance needs the equation of every parameter")
    return {equation: _floor(problem, equation, balance) for equation in dict.fromkeys(problem.equations)}


def _floor(problem: DurationProblem, equation: str, balance: float) -> Objective:
    names = tuple(n for n, e in zip(problem.parameters, problem.equations, strict=True) if e == equation)
    measure = LogDet(problem.picked.columns(names))
    piece = pieces_of([symmetric_part(problem.matrices)], [symmetric_part(problem.prior)], [measure])
    alone = Task(objective=Objective(piece, np.zeros(1)), polytope=polytope_of(problem))
    best = alone.objective.value(climb(alone, start_of(alone), tolerance=1e-8).fractions)
    return Objective(piece, np.array([best + len(names) * np.log(balance)]))
