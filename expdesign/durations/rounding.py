"""From time fractions to whole runs."""

from __future__ import annotations

import numpy as np

from expdesign.durations.certificate import log_det
from expdesign.durations.values import DurationProblem
from expdesign.errors import NoAnswer
from expdesign.values import Array


def whole_runs(problem: DurationProblem, matrices: Array, fractions: Array) -> tuple[int, ...]:
    """Numbers of whole runs within the total time, by greedy addition and exchange on the determinant itself.

    The value of a set of runs is log det of B at its time shares plus p log of its time: information adds with time.
    Every primitive that is alone in informing about a parameter stays, since without it the value is minus infinity.

    Args:
        problem: gives run lengths and the total time.
        matrices: (q, d, d) scaled B_q.
        fractions: (q,) optimal fractions, where the search starts.

    Raises:
        NoAnswer: no set of whole runs within the total time informs about every parameter.
    """
    runs = np.floor(fractions * problem.total_s / problem.run_s + 1e-9).astype(int)
    runs = _grow(problem, matrices, runs, fractions)
    while (better := _exchange(problem, matrices, runs, fractions)) is not None:
        runs = better
    if not np.isfinite(value(problem, matrices, runs)):
        raise NoAnswer(
            f"design.total_s is {problem.total_s:g}: whole runs that inform about every parameter do not fit; the "
            f"shortest run takes {problem.run_s.min():g} s, the optimal design uses {int((fractions > 1e-6).sum())} "
            "primitives"
        )
    return tuple(int(n) for n in runs)


def value(problem: DurationProblem, matrices: Array, runs: Array) -> float:
    """log det of the information collected by whole runs, up to a constant; -inf when singular."""
    times = runs * problem.run_s
    used = float(times.sum())
    if used <= 0:
        return -np.inf
    return log_det(matrices, times / used) + len(problem.parameters) * float(np.log(used / problem.total_s))


def _guide(problem: DurationProblem, matrices: Array, runs: Array, fractions: Array) -> float:
    """As `value`, but finite for singular sets: a millionth of the optimal design is thrown in."""
    times = runs * problem.run_s + 1e-6 * problem.total_s * fractions
    used = float(times.sum())
    return log_det(matrices, times / used) + len(problem.parameters) * float(np.log(used / problem.total_s))


def _grow(problem: DurationProblem, matrices: Array, runs: Array, fractions: Array) -> Array:
    """Add the run with the largest gain per second while one fits."""
    while True:
        room = problem.total_s - float(runs @ problem.run_s)
        fits = [q for q in range(len(runs)) if problem.run_s[q] <= room + 1e-9]
        if not fits:
            return runs
        here = _guide(problem, matrices, runs, fractions)
        gains = [(_guide(problem, matrices, runs + _unit(q, runs), fractions) - here) / problem.run_s[q] for q in fits]
        runs = runs + _unit(fits[int(np.argmax(gains))], runs)


def _exchange(problem: DurationProblem, matrices: Array, runs: Array, fractions: Array) -> Array | None:
    """The best set that swaps one run for others, or None when no swap helps."""
    here = _guide(problem, matrices, runs, fractions)
    best, best_value = None, here + 1e-9
    for out in np.flatnonzero(runs):
        left = runs - _unit(int(out), runs)
        for into in range(len(runs)):
            trial = left + _unit(into, runs)
            if into == out or float(trial @ problem.run_s) > problem.total_s + 1e-9:
                continue
            trial = _grow(problem, matrices, trial, fractions)
            if (worth := _guide(problem, matrices, trial, fractions)) > best_value:
                best, best_value = trial, worth
    return best


def _unit(index: int, runs: Array) -> Array:
    step = np.zeros_like(runs)
    step[index] = 1
    return step
