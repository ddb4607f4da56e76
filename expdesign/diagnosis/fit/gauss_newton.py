"""Gauss-Newton fits of effects and uncertain parameters to all windows, the colour of the remainder found along."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis.data import Noise, Windows, fit_colour, spread, wander_covariance, white_noise, whitened
from expdesign.diagnosis.fit.linear_model import Columns, Grams, answers, grams, likeliest_wander, marginal
from expdesign.diagnosis.fit.step_limits import moved
from expdesign.diagnosis.model import Extended, Linear, Motion, linearise, simulate_windows
from expdesign.values import Array

CLOSE = 0.05
"""A fit has converged when the next step would lower twice the negative log likelihood by less than this."""
RISE = 1.0
"""A step may raise twice the negative log likelihood by this: the colour it is measured with is an estimate."""
HALVINGS = 5
"""Of a step that costs more."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """A model with effects fitted to all windows.

    Attributes:
        ship: with the fitted effects.
        keys: the free numbers, in order; uncertain parameters last.
        free: how many of them have no prior.
        covariance: (c, c).
        starts: (w, n) initial states.
        noise: colour of the remainder.
        cost: weighted squared error at the end, while fitting.
        linear, columns: at the end.
        precision: (c,) prior precision of the numbers.
        move: (c,) from the numbers to the best of the linear model.
        converged: a further step would hardly lower the cost.
    """

    ship: Extended
    keys: tuple[str, ...]
    free: int
    covariance: Array
    starts: Array
    noise: Noise
    cost: float
    linear: Linear
    columns: Columns
    precision: Array
    move: Array
    converged: bool

    def value(self, key: str) -> float:
        """Estimate."""
        return self.ship.get(key)

    def std(self, key: str) -> float:
        """Standard error."""
        index = self.keys.index(key)
        return float(np.sqrt(max(self.covariance[index, index], 0.0)))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Task:
    """What stays the same from step to step."""

    windows: Windows
    keys: tuple[str, ...]
    free: int
    precision: Array
    colour_order: int | None
    given_weights: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class _Point:
    """A model simulated and linearised, before it is weighed."""

    ship: Extended
    starts: Array
    linear: Linear
    columns: Columns


def uncertain_keys(ship: Extended) -> tuple[str, ...]:
    """Parameters that are not known exactly."""
    model = ship.model
    return tuple(f"theta:{n}" for n, std in zip(model.names, model.parameter_std, strict=True) if std > 0)


def prior_precision(ship: Extended, keys: tuple[str, ...]) -> Array:
    """(c,) of the numbers: 1 / std^2 of uncertain parameters, else zero."""
    model = ship.model
    std = {f"theta:{n}": s for n, s in zip(model.names, model.parameter_std.tolist(), strict=True)}
    return np.array([1.0 / std[key] ** 2 if std.get(key, 0.0) > 0 else 0.0 for key in keys])


def fit(
    ship: Extended,
    windows: Windows,
    free: tuple[str, ...],
    *,
    starts: Array,
    noise: Noise | None = None,
    steps: int = 8,
    colour_order: int | None = None,
    near: Linear | None = None,
    given_weights: bool = False,
) -> Fit:
    """Gauss-Newton with steps halved until they cost less; the colour is found at the start, early on and at the end.

    Args:
        ship: where to start; its effects not in `free` stay.
        windows: data.
        free: effects to estimate without a prior.
        starts: (w, n) first guess of the initial states.
        noise: first guess of the colour.
        steps: Gauss-Newton steps.
        colour_order: of the autoregressions, or None to choose.
        near: linearised motion of a ship alike over the same windows, for speed.
        given_weights: judge a step by what starts and the wandering current took away where it began. That depends on
            the parameters, and a step is one of weighted least squares that does not know: it may raise the cost with
            weights of its own. Fits that are compared with each other are to have the least of the latter.

    Raises:
        FloatingPointError: the ship cannot be simulated where the fit would start.
    """
    keys = (*free, *(key for key in uncertain_keys(ship) if key not in free))
    precision = prior_precision(ship, keys)
    precision[: len(free)] = 0.0
    task = _Task(
        windows=windows,
        keys=keys,
        free=len(free),
        precision=precision,
        colour_order=colour_order,
        given_weights=given_weights,
    )
    starts = _fitting_starts(starts, ship.states)
    start = _linearised(task, ship, starts, simulate_windows(ship, windows, starts, near=near))
    if start is None:
        raise FloatingPointError
    best, coloured = _weighed(task, start, _colours(task, start, noise)), True
    for step in range(steps):
        ahead = _searched_along(task, best)
        if ahead is None:
            break
        best, coloured = ahead, False
        if best.converged:
            break
        if step == 0:
            best, coloured = _recoloured(task, best), True
    return best if coloured else _recoloured(task, best)


def _linearised(task: _Task, ship: Extended, starts: Array, motion: Motion) -> _Point | None:
    """None where the motion diverges, or its answers grow beyond all bounds."""
    if motion.diverged:
        return None
    linear = linearise(motion)
    columns = answers(linear, task.keys)
    return None if columns.lost else _Point(ship=ship, starts=starts, linear=linear, columns=columns)


def _weighed(task: _Task, point: _Point | Fit, noise: Noise) -> Fit:
    """Cost, covariance and the step on from there, under some noise."""
    m = marginal(grams(point.columns, noise), point.columns, noise)
    now = _numbers(point.ship, task.keys)
    pull = m.s - task.precision * now
    A = m.A + np.diag(task.precision)
    gain = float(pull @ np.linalg.lstsq(A, pull, rcond=None)[0]) if task.keys else 0.0
    covariance = _inverse(A)
    return Fit(
        ship=point.ship, keys=task.keys, free=task.free, covariance=covariance, starts=point.starts, noise=noise,
        cost=m.quadratic + float(task.precision @ now**2), linear=point.linear, columns=point.columns,
        precision=task.precision, move=covariance @ pull, converged=gain < CLOSE,
    )  # fmt: skip


def _recoloured(task: _Task, found: Fit) -> Fit:
    """The same numbers weighed under the colour of their own remainder; converged if they were."""
    return replace(_weighed(task, found, _colours(task, found, found.noise)), converged=found.converged)


def _searched_along(task: _Task, best: Fit) -> Fit | None:
    """The fit after a step, halved until it costs little more at most; None where that gets nowhere."""
    turn = _fitting_starts(_start_moves(best.columns, best.noise, best.move), best.ship.states)
    for share in 0.5 ** np.arange(HALVINGS + 1):
        ship, starts = best.ship.having(moved(best.ship, best.keys, share * best.move)), best.starts + share * turn
        motion = simulate_windows(ship, task.windows, starts, near=best.linear)
        if motion.diverged or (task.given_weights and _cost(task, best, ship, motion.error) > best.cost + RISE):
            continue
        point = _linearised(task, ship, starts, motion)
        ahead = None if point is None else _weighed(task, point, best.noise)
        if ahead is not None and (task.given_weights or ahead.cost <= best.cost + RISE):
            return ahead
    return None


def _cost(task: _Task, best: Fit, ship: Extended, error: Array) -> float:
    """Of another ship's error, weighed as that of the best so far."""
    columns = replace(best.columns, error=error)
    quadratic = marginal(grams(columns, best.noise), columns, best.noise).quadratic
    return quadratic + float(task.precision @ _numbers(ship, task.keys) ** 2)


def _inverse(A: Array) -> Array:
    return np.asarray(np.linalg.pinv(A, rcond=1e-14, hermitian=True), dtype=float) if len(A) else np.zeros((0, 0))


def _numbers(ship: Extended, keys: tuple[str, ...]) -> Array:
    return np.array([ship.get(key) for key in keys])


def profile_cost(found: Fit, noise: Noise) -> float:
    """Quadratic cost of a fit under some noise, every number moved to its best in the linear model."""
    m = marginal(grams(found.columns, noise), found.columns, noise)
    now = _numbers(found.ship, found.keys)
    pull = m.s - found.precision * now
    best = pull @ np.linalg.lstsq(m.A + np.diag(found.precision), pull, rcond=None)[0] if len(now) else 0.0
    return float(m.quadratic + found.precision @ now**2 - best)


def _fitting_starts(starts: Array, n: int) -> Array:
    if starts.shape[1] < n:
        return np.column_stack([starts, np.zeros((len(starts), n - starts.shape[1]))])
    return starts[:, :n]


def _start_moves(columns: Columns, noise: Noise, move: Array) -> Array:
    """(w, 3) change of the initial velocities that goes with a change of the numbers."""
    rest = columns.error - np.tensordot(move, columns.values[: columns.numbers], axes=(0, 0))
    error = whitened(rest, noise)
    seen = np.isfinite(error)
    w = len(error)
    e = np.where(seen, error, 0.0).reshape(w, -1)
    S = np.moveaxis((whitened(columns.starts, noise) * seen).reshape(len(columns.starts), w, -1), 0, -1)
    return np.stack([np.linalg.lstsq(B, b, rcond=None)[0] for B, b in zip(S, e, strict=True)])


def _colours(task: _Task, point: _Point | Fit, noise: Noise | None) -> Noise:
    """Colour of what is left after the best linear answer; from nothing it takes a few passes."""
    columns, passes = point.columns, 1
    if noise is None:
        size = spread(columns.error)
        noise, passes = white_noise(np.where(size > 0, size, np.inf)), 3
    now = _numbers(point.ship, task.keys)
    for _ in range(passes):
        g = grams(columns, noise)
        noise = likeliest_wander(g, columns, noise, task.precision)
        colour = fit_colour(remainder(columns, g, noise, task.precision, now), order=task.colour_order)
        noise = replace(colour, wander_mps=noise.wander_mps, wander_time_s=noise.wander_time_s)
    return noise


def remainder(columns: Columns, g: Grams, noise: Noise, precision: Array, now: Array) -> Array:
    """(w, s, 4) error less the best linear answer of numbers and initial states, and a likely wandering current.

    The likeliest current would take noise along with it and leave too little; one drawn from its posterior does not
    (stochastic EM: G. Celeux and J. Diebolt, Computational Statistics Quarterly 2 (1985), 73-82). What is drawn with is
    always the same, so that fits of candidates differ by what they explain and not by chance.
    """
    m = marginal(g, columns, noise)
    c = columns.numbers
    move = np.linalg.lstsq(m.A + np.diag(precision), m.s - precision * now, rcond=None)[0] if c else np.zeros(0)
    rest = columns.error - np.tensordot(move, columns.values[:c], axes=(0, 0))
    hats_count = (len(columns.values) - c) // 2
    if noise.wander_mps > 0 and hats_count:
        prior = noise.wander_mps**2 * wander_covariance(hats_count, columns.spacing_s, noise.wander_time_s)
        ZZ = g.XX[:, c:, c:] + np.linalg.inv(prior)
        b = np.linalg.solve(ZZ, (g.Xe[:, c:] - g.XX[:, c:, :c] @ move)[..., None])[..., 0]
        chance = np.random.default_rng(0).standard_normal((*b.shape, 1))
        b = b + np.linalg.solve(np.swapaxes(np.linalg.cholesky(ZZ), 1, 2), chance)[..., 0]
        rest = rest - np.einsum("wz,zwsn->wsn", b, columns.values[c:])
    trimmed = replace(columns, error=rest)
    starts = _start_moves(trimmed, noise, np.zeros(c))
    return np.asarray(rest - np.einsum("wn,nwsk->wsk", starts, columns.starts))
