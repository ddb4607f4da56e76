"""Output error: the parameters whose simulations come nearest to the measured velocities.

Every run is cut into stretches as long as the horizon, the whole run when there is none. Each stretch is simulated from
a first velocity of its own, which is estimated with the parameters. Simulated velocities carry no measurement noise, so
with noise on the sensors alone whole runs give the maximum-likelihood estimate, and no other does better: the accuracy
reference for IV. Forces outside the model add up in a simulation; a shorter horizon keeps that in bounds, as it does
for ships that are unstable on their course, whose simulations part from the measured motion exponentially. A constant
acceleration per run can be estimated besides, for steady forces outside the model. Measured wind acts through the
b-frame velocity of the air, which ship's velocity less relative wind gives without a heading.

Least squares by Levenberg and Marquardt with exact derivatives, the first velocities eliminated, from least squares'
parameters with a horizon that grows fourfold until it is the one asked for: what would run away over a whole run does
not over a few samples, and is good by the time that the horizon is long. Outputs are weighted by one over their
residual variance of the stage before. Covariance: of the simulation's slopes, robust to coloured residuals as for IV.

Source: L. Ljung, System Identification, 2nd ed. (1999), 4.2 and 9.3; H. G. Bock, in Modelling of Chemical Reaction
Systems (1981), 102-125, for the stretches; J. J. More, Lecture Notes in Mathematics 630 (1978), 105-116.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError, NoAnswer
from expdesign.estimation.regression import Integers, Layout, Regression, inputs_of
from expdesign.estimation.replay import Compiled, Integration, Stretches, compiled
from expdesign.estimation.solve import Solution, Weighting, solve_ls
from expdesign.signals import Batch, Record
from expdesign.values import Array

SHORTEST = 8
"""Samples of the first horizon."""
GROWTH = 4
"""How many times longer the next horizon is."""
MOST_STEPS = 40
SETTLED, ROUGHLY = 1e-4, 0.1
"""Fall of the cost to be expected, in squared standard deviations of an estimate, at which the last stages end, and the
earlier ones."""


@dataclass(frozen=True, kw_only=True)
class Fitting:
    """How simulations are set against the data.

    Attributes:
        integration: how the model is simulated.
        horizon_s: length of a stretch [s], None for whole runs.
        constant: whether each run has a constant acceleration of its own.
    """

    integration: Integration
    horizon_s: float | None = None
    constant: bool = False

    def __post_init__(self) -> None:
        if self.horizon_s is not None and not 0 < self.horizon_s < np.inf:
            raise InputError(f"horizon is {self.horizon_s:g} s, expected more than 0")


def minimise_output_error(
    layout: Layout, record: Record, start: Solution, fitting: Fitting
) -> tuple[Solution, Regression]:
    """The estimate of the layout's parameters; then, where asked for, one constant per run and output.

    Returns the solution and the regression of its last Gauss-Newton step, for names and rows.

    Args:
        layout: with a predictor without nuisance regressors.
        record: batches of one sample time.
        start: a regression's solution, for the first guess.
        fitting: how simulations are set against the data.

    Raises:
        InputError: batches of different sample times, or inputs or wind that are not numbers.
        NotInformative: parameters that the simulated outputs do not depend on.
        NoAnswer: every model near the best one found so far runs away over the horizon.
    """
    weights = 1.0 / _at_least(start.residuals.var(axis=0), record, layout)
    values = np.concatenate(
        [start.values[: len(layout.parameters)], np.zeros(len(record.batches) * len(layout.model.outputs))]
    )
    longest = max(len(batch) for batch in record.batches)
    full = longest if fitting.horizon_s is None else max(2, round(fitting.horizon_s / _sample_time(record)) + 1)
    horizons = _horizons(min(full, longest))
    for stage, samples in enumerate([*horizons, horizons[-1]]):
        problem = _problem(layout, record, fitting, samples, weights)
        values, starts = _minimised(problem, values, settled=ROUGHLY if stage < len(horizons) - 1 else SETTLED)
        weights = 1.0 / _at_least(_variance(problem, values, starts), record, layout)
    return _with_covariance(problem, layout, values, starts)


@dataclass(frozen=True, eq=False)
class Problem:
    """Least squares over W stretches of L samples.

    Attributes:
        compiled: the stretches, ready to be simulated.
        measured: (L, W, n), nan where missing or filled up.
        weights: (n,) one over the variance of each output.
        batch: (W,) number of the run.
        first: (W,) sample of the run at which each stretch begins.
        constant: whether constants are sought.
    """

    compiled: Compiled
    measured: Array
    weights: Array
    batch: Integers
    first: Integers
    constant: bool

    @property
    def parameters(self) -> int:
        """How many are sought, without constants."""
        return len(self.compiled.stretches.sought)

    def local(self, values: Array) -> Array:
        """(W, p + n) the values that act on each stretch."""
        p, n = self.parameters, self.measured.shape[2]
        own = values[p:].reshape(-1, n)[self.batch]
        return np.concatenate([np.broadcast_to(values[:p], (len(own), p)), own], axis=1)

    def states(self, values: Array, starts: Array) -> Array:
        """(L, W, n) simulated; not numbers where a simulation runs away."""
        return self.compiled.states(self.local(values), starts)

    def residuals(self, states: Array) -> Array:
        """(L, W, n) measured less simulated, zero where nothing is compared."""
        return np.where(np.isfinite(self.measured), self.measured - states, 0.0)


def _sample_time(record: Record) -> float:
    times = {batch.sample_time_s for batch in record.batches}
    if len(times) > 1:
        raise InputError(f"output error needs one sample time, found {', '.join(f'{t:g} s' for t in sorted(times))}")
    return times.pop()


def _horizons(full: int) -> list[int]:
    horizons = [full]
    while horizons[0] > SHORTEST * GROWTH:
        horizons.insert(0, -(-horizons[0] // GROWTH))
    return horizons


def _at_least(variance: Array, record: Record, layout: Layout) -> Array:
    """No variance so small that rounding would decide."""
    states = [OUTPUTS.index(name) for name in layout.model.outputs]
    spread = np.nanvar(np.concatenate([batch.velocity[:, states] for batch in record.batches]), axis=0)
    return np.asarray(np.maximum(variance, 1e-12 * np.where(spread > 0, spread, 1.0)))


def _problem(layout: Layout, record: Record, fitting: Fitting, samples: int, weights: Array) -> Problem:
    model, time_s = layout.model, _sample_time(record)
    states = tuple(OUTPUTS.index(name) for name in model.outputs)
    cuts = [(number, first) for number, b in enumerate(record.batches) for first in _firsts(len(b), samples)]
    drives = [_drive(layout, batch) for batch in record.batches]
    ends = [_end(first, samples, len(record.batches[number])) for number, first in cuts]
    length = max(end - first for (_, first), end in zip(cuts, ends, strict=True))

    def stacked(rows: list[Array], fill: bool) -> Array:
        parts = [rows[number][first:end] for (number, first), end in zip(cuts, ends, strict=True)]
        tails = [np.repeat(part[-1:] if fill else part[-1:] * np.nan, length - len(part), axis=0) for part in parts]
        return np.stack([np.concatenate(pair) for pair in zip(parts, tails, strict=True)], axis=1)

    return Problem(
        compiled=compiled(
            Stretches(
                model=model.with_parameters(dict.fromkeys(layout.merged, 0.0)),
                sought=tuple(model.names.index(name) for name in layout.parameters),
                states=states,
                drive=stacked(drives, fill=True),
                windy=layout.predictor.wind,
                sample_time_s=time_s,
                integrator=fitting.integration.integrator,
                substeps=fitting.integration.substeps,
            )
        ),
        measured=stacked([batch.velocity[:, states] for batch in record.batches], fill=False),
        weights=weights,
        batch=np.array([number for number, _ in cuts]),
        first=np.array([first for _, first in cuts]),
        constant=fitting.constant,
    )


def _firsts(count: int, samples: int) -> range:
    """Where stretches begin: as many as fit, the last one taking what is left over."""
    return range(0, max(1, count - samples // 2), samples)


def _end(first: int, samples: int, count: int) -> int:
    """Where a stretch ends: no remainder shorter than half a stretch is left."""
    return count if first + samples + (samples + 1) // 2 > count else first + samples


def _drive(layout: Layout, batch: Batch) -> Array:
    """(k, m) inputs, and the wind in the b-frame where it is used, the last one seen standing for those missing."""
    inputs = inputs_of(layout.model, batch)
    if not np.isfinite(inputs).all():
        raise InputError(f"{batch.name}: output error needs inputs at every sample; some are not numbers")
    if not layout.predictor.wind:
        return inputs
    assert batch.wind is not None  # the regression was built from it
    wind = batch.velocity[:, :2] - batch.wind
    seen = np.isfinite(wind).all(axis=1)
    if not seen.any():
        raise InputError(f"{batch.name}: no sample has velocity and relative wind")
    places = np.maximum.accumulate(np.where(seen, np.arange(len(batch)), int(seen.argmax())))
    return np.concatenate([inputs, wind[places]], axis=1)


def _first_states(problem: Problem) -> Array:
    """(W, n) first measured velocities, for a first guess."""
    seen = np.isfinite(problem.measured)
    first = np.take_along_axis(problem.measured, np.argmax(seen, axis=0)[None], axis=0)[0]
    return np.where(seen.any(axis=0), first, 0.0)


def _cost(problem: Problem, residuals: Array) -> float:
    cost = float(np.einsum("lwn,n->", residuals**2, problem.weights))
    return cost if np.isfinite(cost) else np.inf


def _minimised(problem: Problem, values: Array, *, settled: float) -> tuple[Array, Array]:
    """Values and starts (W, n) of least cost, from values and the measured starts."""
    starts, damping = _first_states(problem), 1e-4
    with np.errstate(over="ignore", invalid="ignore"):
        states = problem.states(values, starts)
        cost = _cost(problem, problem.residuals(states))
        if not np.isfinite(cost):
            raise NoAnswer(_RUNS_AWAY.format(seconds=len(states) * problem.compiled.stretches.sample_time_s))
        for _ in range(MOST_STEPS):
            normal = _normal(problem, values, states)
            while damping < 1e10:
                step, shift, expected = _step(normal, damping)
                if expected < settled:
                    return values, starts
                newer = problem.states(values + step, starts + shift)
                lower = _cost(problem, problem.residuals(newer))
                if lower < cost:
                    break
                damping *= 10
            else:
                return values, starts
            values, starts, states, cost, damping = values + step, starts + shift, newer, lower, damping / 10
    return values, starts


_RUNS_AWAY = "output error: the best model found diverges within {seconds:.0f} s; try a shorter horizon (--horizon)"


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations with the starts kept apart: S (W, n, n), C (W, n, q), V (q, q), and gradients."""

    S: Array
    C: Array
    V: Array
    gradient_s: Array
    gradient_v: Array


def _normal(problem: Problem, values: Array, states: Array) -> Normal:
    Jv, Js = _slopes(problem, values, states)
    residuals, root = problem.residuals(states), np.sqrt(problem.weights)
    p, n, count = problem.parameters, Js.shape[3], len(problem.batch)
    by_v, by_s, left = (_stretchwise(part * root[:, None]) for part in (Jv, Js, residuals[..., None]))
    S, near, V_w = by_s.swapaxes(1, 2) @ by_s, by_s.swapaxes(1, 2) @ by_v, by_v.swapaxes(1, 2) @ by_v
    g_w = (by_v.swapaxes(1, 2) @ left)[..., 0]
    C, V, g = np.zeros((count, n, len(values))), np.zeros((len(values),) * 2), np.zeros(len(values))
    for w, number in enumerate(problem.batch):
        places = np.concatenate([np.arange(p), p + number * n + np.arange(n)])
        C[w][:, places] = near[w]
        V[np.ix_(places, places)] += V_w[w]
        g[places] += g_w[w]
    return Normal(S=S, C=C, V=V, gradient_s=(by_s.swapaxes(1, 2) @ left)[..., 0], gradient_v=g)


def _stretchwise(rows: Array) -> Array:
    """(L, W, n, q) as (W, L n, q)."""
    length, count, n, q = rows.shape
    return rows.transpose(1, 0, 2, 3).reshape(count, length * n, q)


def _slopes(problem: Problem, values: Array, states: Array) -> tuple[Array, Array]:
    """Slopes where something is compared, zero elsewhere; those of constants zero when none are sought."""
    Jv, Js = problem.compiled.sensitivities(problem.local(values), states)
    unseen = ~np.isfinite(problem.measured)
    Jv[unseen], Js[unseen] = 0.0, 0.0
    if not problem.constant:
        Jv[..., problem.parameters :] = 0.0
    return Jv, Js


def _step(normal: Normal, damping: float) -> tuple[Array, Array, float]:
    """Damped Gauss-Newton step, starts eliminated, and the fall of the cost to be expected.

    Damping counts in units of each diagonal entry.
    """
    inverse = np.linalg.inv(_regular(normal.S) * (1 + damping * np.eye(normal.S.shape[1])))
    carried = inverse @ normal.C  # (W, n, q)
    scale = np.sqrt(np.where(np.diag(normal.V) > 0, np.diag(normal.V), 1.0))
    reduced = normal.V + damping * np.diag(scale**2) - np.tensordot(normal.C, carried, axes=((0, 1), (0, 1)))
    right = normal.gradient_v - np.einsum("wna,wn->a", carried, normal.gradient_s)
    step = np.linalg.lstsq(reduced / np.outer(scale, scale), right / scale, rcond=1e-14)[0] / scale
    shift = np.einsum("wab,wb->wa", inverse, normal.gradient_s) - carried @ step
    return step, shift, float(normal.gradient_v @ step + (normal.gradient_s * shift).sum())


def _regular(S: Array) -> Array:
    """Second moments of starts, with a little added to those of outputs that a stretch never compares."""
    diagonal = np.einsum("wnn->wn", S)
    return np.asarray(S + np.eye(S.shape[1]) * np.where(diagonal > 0, 0.0, 1.0)[:, None, :])


def _variance(problem: Problem, values: Array, starts: Array) -> Array:
    """(n,) of the residuals, one degree of freedom less for each start."""
    residuals = problem.residuals(problem.states(values, starts))
    count = np.isfinite(problem.measured).sum(axis=(0, 1)) - len(starts)
    return np.asarray((residuals**2).sum(axis=(0, 1)) / np.maximum(count, 1))


def _with_covariance(problem: Problem, layout: Layout, values: Array, starts: Array) -> tuple[Solution, Regression]:
    """One Gauss-Newton step written as least squares: it adds next to nothing, and brings covariance and null space.

    Its regressors are the slopes less what a change of the stretch's start explains of them (Frisch and Waugh).
    """
    states = problem.states(values, starts)
    Jv, Js = _slopes(problem, values, states)
    residuals, root = problem.residuals(states), np.sqrt(problem.weights)[:, None]
    by_v, by_s = _stretchwise(Jv * root), _stretchwise(Js * root)
    near = np.linalg.solve(_regular(by_s.swapaxes(1, 2) @ by_s), by_s.swapaxes(1, 2) @ by_v)
    slopes = Jv - Js @ near
    batch, step, order = _places(problem)
    n = Js.shape[3]
    Phi, names = _columns(slopes, problem, layout)
    regression = Regression(
        parameters=names,
        Phi=Phi.reshape(-1, n, Phi.shape[-1])[order],
        y=residuals.reshape(-1, n)[order],
        batch=batch,
        step=step,
        outputs=layout.model.outputs,
    )
    last = solve_ls(regression, Weighting(output_weights=tuple(problem.weights / problem.weights.max())))
    return replace(last, values=values[: len(names)] + last.values), regression


def _places(problem: Problem) -> tuple[Integers, Integers, Integers]:
    """Batch, sample and place of every whole row, in the order of time."""
    length, count = problem.measured.shape[:2]
    whole = np.isfinite(problem.measured).all(axis=2).ravel()
    batch = np.broadcast_to(problem.batch, (length, count)).ravel()
    step = (problem.first + np.arange(length)[:, None]).ravel()
    order = np.lexsort((step, batch))
    order = order[whole[order]]
    return batch[order], step[order], order


def _columns(slopes: Array, problem: Problem, layout: Layout) -> tuple[Array, tuple[str, ...]]:
    """Parameters, then the constants of each run."""
    p, outputs = problem.parameters, layout.model.outputs
    if not problem.constant:
        return slopes[..., :p], layout.parameters
    runs = int(problem.batch.max()) + 1
    member = (problem.batch[:, None] == np.arange(runs)).astype(float)
    own = np.einsum("lwns,wb->lwnbs", slopes[..., p:], member).reshape(*slopes.shape[:3], -1)
    names = [f"constant d{name}/dt of run {number + 1}" for number in range(runs) for name in outputs]
    return np.concatenate([slopes[..., :p], own], axis=3), (*layout.parameters, *names)
