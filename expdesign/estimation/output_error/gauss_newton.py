"""Levenberg and Marquardt for output error, with the first velocities of the stretches eliminated.

Source: J. J. More, Lecture Notes in Mathematics 630 (1978), 105-116; steps are mixed with earlier ones, see `_mixed`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.errors import NoAnswer
from expdesign.estimation.output_error.problem import Problem
from expdesign.values import Array

MOST_STEPS = 40  # of Gauss and Newton at one horizon
MOST_DAMPING = 1e10  # of such a step, relative to the diagonal; with more, nothing is left to find
REMEMBERED_STEPS = 5  # that the next one is mixed with
MOST_CORRELATED = 0.9999  # correlation of residuals from sample to sample that counts, at most


def cost(problem: Problem, values: Array, residuals: Array) -> float:
    """Weighted sum of squares of residuals (L, W, n), with what was known beforehand; infinite where they are."""
    found = float(np.einsum("lwn,lwn->", residuals**2, problem.weight))
    found += float(problem.precision @ problem.departure(values) ** 2)
    return found if np.isfinite(found) else np.inf


Step = Callable[[float], None]
"""Called at each step of Gauss and Newton, with its expected decrease over the one that ends the search."""


def minimised(
    problem: Problem, values: Array, starts: Array, *, settled: float, report: Step = lambda excess: None
) -> tuple[Array, Array]:
    """Values and starts (W, n) of least cost.

    Args:
        values, starts: to begin with.
        settled: expected decrease of the cost that ends the search, in squared standard deviations of the estimate.
        report: called at every step.

    Raises:
        NoAnswer: the model to begin with diverges, or its derivatives do.
    """
    damping = 1e-4
    before: list[tuple[Point, Move]] = []
    with np.errstate(over="ignore", invalid="ignore"):
        point = _point(problem, values, starts)
        _check_bounded(problem, np.array(point.cost))
        for _ in range(MOST_STEPS):
            normal, least = _normal(problem, point.values, point.states), settled * unit(problem, point.states)
            _check_bounded(problem, normal.S, normal.C, normal.V)
            newer = None
            while newer is None:
                move = _step(normal, damping)
                report(move.expected / least)
                if move.expected < least or damping > MOST_DAMPING:
                    return point.values, point.starts
                newer = _lower(problem, point, move, before)
                damping *= 10 if newer is None else 0.1
            before = [*before, (point, move)][-REMEMBERED_STEPS:]
            point = newer
    return point.values, point.starts


def _check_bounded(problem: Problem, *parts: Array) -> None:
    """Raise NoAnswer unless all are finite: a simulation may stay just below what a float holds, its slopes beyond."""
    if not all(np.isfinite(part).all() for part in parts):
        raise runs_away(problem)


def runs_away(problem: Problem, answered_s: float = 0.0) -> NoAnswer:
    """That the best model found diverges within a stretch, and up to which horizon there is an answer."""
    seconds = len(problem.measured) * problem.compiled.stretches.sample_time_s
    shorter = f"--horizon {answered_s:.3g}, up to which it does not" if answered_s > 0.0 else "--horizon"
    return NoAnswer(_RUNS_AWAY.format(seconds=seconds, shorter=shorter))


@dataclass(frozen=True, eq=False)
class Point:
    """Values and starts (W, n), the states (L, W, n) that they give, and their cost."""

    values: Array
    starts: Array
    states: Array
    cost: float


@dataclass(frozen=True, eq=False)
class Move:
    """A step of Gauss and Newton."""

    # values, starts: changes (q,) and (W, n)
    values: Array
    starts: Array
    expected: float  # decrease of the cost, of a linear problem
    metric: Array  # (q, q) second derivative of half the cost by the values, with the starts eliminated


def _point(problem: Problem, values: Array, starts: Array) -> Point:
    states = problem.states(values, starts)
    return Point(values, starts, states, cost(problem, values, problem.residuals(states)))


def _lower(problem: Problem, point: Point, move: Move, before: Sequence[tuple[Point, Move]]) -> Point | None:
    """A point of less cost: by the mixed step if there is one, else by the plain one; None if neither leads there."""
    changes = [_mixed(point, move, before)] if before else []
    for values, starts in (*changes, (move.values, move.starts)):
        idle = np.zeros(len(point.values) - len(values))  # constants that are not estimated
        newer = _point(problem, point.values + np.append(values, idle), point.starts + starts)
        if newer.cost < point.cost:
            return newer
    return None


def _mixed(point: Point, move: Move, before: Sequence[tuple[Point, Move]]) -> tuple[Array, Array]:
    """Changes of values and starts to where the steps before and this one would, linearly, vanish.

    Where residuals are large, steps of Gauss and Newton shrink slowly, by much the same share each.

    Source: D. G. Anderson, Journal of the ACM 12 (1965), 547-560.
    """
    D = np.stack([move.values - old.values for _, old in before], axis=1)
    share = np.linalg.lstsq(D.T @ move.metric @ D, D.T @ move.metric @ move.values, rcond=1e-12)[0]
    values, starts = move.values, move.starts
    for weight, (place, old) in zip(share, before, strict=True):
        moved = (point.values - place.values)[: len(values)]
        values = values - weight * (moved + move.values - old.values)
        starts = starts - weight * (point.starts - place.starts + move.starts - old.starts)
    return values, starts


def unit(problem: Problem, states: Array) -> float:
    """The cost of a squared standard deviation of the estimate; 1 for white residuals of the variance of the weights.

    Residuals with correlation rho from sample to sample have (1 - rho) / (1 + rho) of the information of white ones:
    errors of a simulation last for hundreds of samples. The least correlated output counts.
    """
    residuals = problem.residuals(states)
    power = np.einsum("lwn,lwn->n", residuals, residuals)
    joined = np.einsum("lwn,lwn->n", residuals[1:], residuals[:-1])
    rho = np.clip(np.divide(joined, power, out=np.zeros_like(power), where=power > 0), 0.0, MOST_CORRELATED)
    level = float(power @ problem.weights) / max(1, int(np.isfinite(problem.measured).sum()))
    return float(np.min((1 + rho) / (1 - rho))) * max(1.0, level)


_RUNS_AWAY = (
    "output error: the best model found diverges within {seconds:.0f} s; try a shorter horizon ({shorter}), fewer "
    "terms, or methods that simulate nothing (ls) or only their instruments (iv)"
)


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations by blocks: starts S (W, n, n), coupling C (W, n, q), values V (q, q), and gradients."""

    S: Array
    C: Array
    V: Array
    gradient_s: Array
    gradient_v: Array


def _normal(problem: Problem, values: Array, states: Array) -> Normal:
    root, residuals = np.sqrt(problem.weight), problem.residuals(states)
    p, count, n = problem.parameters, len(problem.batch), states.shape[2]
    q, runs = p + n * problem.constant, int(problem.batch.max()) + 1
    S, near, g_s = np.zeros((count, n, n)), np.zeros((count, n, q)), np.zeros((count, n))
    V_b, g_b = np.zeros((runs, q, q)), np.zeros((runs, q))
    for part in problem.compiled.slope_blocks(problem.local(values), states):
        at = (part.samples, part.active)
        weights = root[at][..., None]
        by_v, by_s, left = (
            stretchwise(rows * weights) for rows in (part.by_values[..., :q], part.by_start, residuals[at][..., None])
        )
        S[part.active] += by_s.swapaxes(1, 2) @ by_s
        near[part.active] += by_s.swapaxes(1, 2) @ by_v
        g_s[part.active] += (by_s.swapaxes(1, 2) @ left)[..., 0]
        for number in np.unique(problem.batch[part.active]) if problem.constant else (None,):
            own = slice(None) if number is None else problem.batch[part.active] == number
            rows, misfit = by_v[own].reshape(-1, q), left[own].reshape(-1)
            V_b[number or 0] += rows.T @ rows
            g_b[number or 0] += rows.T @ misfit
    known, towards = np.diag(problem.precision), -problem.precision * problem.departure(values)
    if not problem.constant:
        return Normal(S=S, C=near, V=V_b[0] + known, gradient_s=g_s, gradient_v=g_b[0] + towards)
    C, V, g = np.zeros((count, n, len(values))), np.zeros((len(values),) * 2), np.zeros(len(values))
    for number in range(runs):
        places = np.concatenate([np.arange(p), p + number * n + np.arange(n)])
        own = np.flatnonzero(problem.batch == number)
        C[np.ix_(own, np.arange(n), places)] = near[own]
        V[np.ix_(places, places)] += V_b[number]
        g[places] += g_b[number]
    V[:p, :p] += known
    g[:p] += towards
    return Normal(S=S, C=C, V=V, gradient_s=g_s, gradient_v=g)


def stretchwise(rows: Array) -> Array:
    """(L, W, n, q) as (W, L n, q)."""
    length, count, n, q = rows.shape
    return rows.transpose(1, 0, 2, 3).reshape(count, length * n, q)


def _step(normal: Normal, damping: float) -> Move:
    """Damped step with the starts eliminated; the damping is relative to each diagonal entry."""
    inverse = np.linalg.inv(regular(normal.S) * (1 + damping * np.eye(normal.S.shape[1])))
    carried = inverse @ normal.C  # (W, n, q)
    scale = np.sqrt(np.where(np.diag(normal.V) > 0, np.diag(normal.V), 1.0))
    reduced = normal.V + damping * np.diag(scale**2) - np.tensordot(normal.C, carried, axes=((0, 1), (0, 1)))
    right = normal.gradient_v - np.einsum("wna,wn->a", carried, normal.gradient_s)
    step = np.linalg.lstsq(reduced / np.outer(scale, scale), right / scale, rcond=1e-14)[0] / scale
    shift = np.einsum("wab,wb->wa", inverse, normal.gradient_s) - carried @ step
    return Move(step, shift, float(normal.gradient_v @ step + (normal.gradient_s * shift).sum()), reduced)


def regular(S: Array) -> Array:
    """Second moments of starts, made regular for outputs without data in a stretch."""
    diagonal = np.einsum("wnn->wn", S)
    return np.asarray(S + np.eye(S.shape[1]) * np.where(diagonal > 0, 0.0, 1.0)[:, None, :])
