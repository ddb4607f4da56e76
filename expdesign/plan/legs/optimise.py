"""Optimised legs: the fastest motion first, then the smoothest commands on whole samples in that time."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from expdesign.memory import recalled
from expdesign.plan.legs._casadi import FREE_SAMPLES, program
from expdesign.plan.legs.problem import LegProblem
from expdesign.plan.legs.water import LegWater, nearest_turns, through_water
from expdesign.values import Array

NODES = (12, 18, 24, 32, 44, 60, 80, 110, 160)  # numbers of nodes tried while the time is free
# legs may be faster between nodes than at them by this factor, else they are sought again so many times, slower there;
# with `BEYOND_ENDS` at nodes that is within the 3 % that verification allows beyond a leg's faster end
FASTER, SLOWED = 1.009, 2
UNLIMITED = 0.999  # share of the largest from which on a transition would last for ever


def solve_transition(problem: LegProblem) -> tuple[float, Array] | None:
    """Time on whole samples and end pose (3,) of the leg with least time less the value of displacement.

    None where no such leg is found, or none is best: displacement at the speed of a fast end is worth more than time.
    """
    sample_s, duration_s = problem.vessel.sample_time_s, problem.duration_s
    nodes, block = _size(problem, duration_s)
    fastest = program(problem.vessel, problem.environment, nodes, block, True)
    for guess in (problem, _even(problem)):
        found = fastest.solve(_respaced(guess, nodes), duration_s / (nodes * block))
        if found is None:
            continue
        if found[1] > UNLIMITED * FREE_SAMPLES[1] * sample_s:
            return None
        count = max(2, int(np.ceil(nodes * found[1] / sample_s - 1e-6)))
        smooth = program(problem.vessel, problem.environment, count, block, False)
        exact = smooth.solve(_respaced(found[0], count), sample_s)
        if exact is not None:
            return count * block * sample_s, exact[0].states[-1, :3]
    return None


def _even(problem: LegProblem) -> LegProblem:
    """The same leg with commands that change evenly as a first guess, azimuths by less than half a turn."""
    last = nearest_turns(problem.vessel, problem.end_inputs, problem.inputs[0])
    return replace(problem, end_inputs=last, inputs=np.linspace(problem.inputs[0], last, len(problem.inputs)))


def _size(problem: LegProblem, duration_s: float) -> tuple[int, int]:
    """Number of nodes for a leg of some time, and samples between two of them."""
    sample_s = problem.vessel.sample_time_s
    nodes = next((n for n in NODES if n >= duration_s / max(sample_s, problem.node_s)), NODES[-1])
    return nodes, max(1, round(duration_s / (nodes * sample_s)))


def solve_leg(problem: LegProblem, water: LegWater) -> Array | None:
    """Commands (k, m) at the vessel's sample time, or None when IPOPT finds none.

    First the fastest motion is sought with the sample time free, then the smoothest one on whole samples in that
    time. Where commands that would give the guessed motion lead nowhere, evenly changing ones often do. Speed is
    limited at the nodes; where the ship is faster between them, slower nodes are sought. The answer is for the caller
    to check by simulation.
    """
    values, problem.budget.spent_s = recalled(_solved, problem)
    limit_mps = problem.top_speed_mps  # at the nodes
    for _ in range(SLOWED):
        if values is None:
            break
        states = water.states(problem.start, values, problem.past)
        if (faster := _fastest_mps(water, states) / problem.top_speed_mps) <= FASTER:
            break
        limit_mps /= faster
        inputs = np.vstack([problem.start_inputs, values])
        slow = replace(problem, states=states, inputs=inputs, duration_s=len(values) * problem.vessel.sample_time_s)
        slow = replace(slow, top_speed_mps=limit_mps)
        slower, problem.budget.spent_s = recalled(_solved, slow)
        if slower is None:
            break
        values = slower
    return values


def _fastest_mps(water: LegWater, states: Array) -> float:
    """Largest speed through water of states (k, 6)."""
    return float(np.hypot(*through_water(water.environment, states)[:, :2].T).max())


def _solved(problem: LegProblem) -> tuple[Array | None, float]:
    """Commands of a leg, or None, and the work spent after it."""
    values = _fastest_and_smooth(problem)
    return values, problem.budget.spent_s


def _fastest_and_smooth(problem: LegProblem) -> Array | None:
    sample_s = problem.vessel.sample_time_s
    guesses = (problem, 1.0), (_even(problem), 1.0), (problem, 1.6), (problem, 3.0)
    for guess, stretch in guesses[: problem.guesses]:
        guess_s = stretch * problem.duration_s
        nodes, block = _size(problem, guess_s)
        fastest = program(problem.vessel, problem.environment, nodes, block, True)
        found = fastest.solve(_respaced(guess, nodes), guess_s / (nodes * block))
        if found is None:
            continue
        time_s = nodes * block * found[1]
        least = max(2, int(np.ceil(time_s / (block * sample_s) - 0.1)))
        for count in (least, least + 1, least + 3, least + 8, least + 16):
            smooth = program(problem.vessel, problem.environment, count, block, False)
            exact = smooth.solve(_respaced(found[0], count), sample_s)
            if exact is not None:
                return _samples(exact[0].inputs, block)
    return None


def _spread(rows: Array, count: int) -> Array:
    """Rows (j + 1, ...) linearly resampled to count + 1."""
    old, new = np.linspace(0, 1, len(rows)), np.linspace(0, 1, count + 1)
    return np.stack([np.interp(new, old, column) for column in np.atleast_2d(rows.T)], axis=-1).reshape(
        count + 1, *rows.shape[1:]
    )


def _respaced(problem: LegProblem, count: int) -> LegProblem:
    """The same leg with another number of nodes."""
    return replace(
        problem,
        states=_spread(problem.states, count),
        inputs=_spread(problem.inputs, count),
        path=_spread(problem.path, count),
        room_port_m=_spread(problem.room_port_m, count),
        room_starboard_m=_spread(problem.room_starboard_m, count),
    )


def _samples(nodes: Array, block: int) -> Array:
    """(count x block, m) commands, linear from node to node; the first node is what stands before the leg."""
    shares = (np.arange(1, block + 1) / block)[:, None]
    return np.concatenate([a + (b - a) * shares for a, b in pairwise(nodes)])
