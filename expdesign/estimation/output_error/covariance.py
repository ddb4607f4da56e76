"""The covariance of output error: from the noise that one step of the linearised ship leaves.

Errors r of the simulation last, as the ship integrates unmeasured forces. Their one-step residuals

    eps(k) = r(k + 1) - A(k) r(k)

are the noise of `noise.coupled`, whose colour does not depend on the ship's. The estimate errs by sum W(k) r(k) with
W = G^-1 J^T Q, the derivatives J of the simulation, their weights Q and G = J^T Q J. Written with the adjoint,

    sum W(k) r(k) = sum lambda(k + 1) eps(k),    lambda(k) = W(k) + lambda(k + 1) A(k)

without any share of the first error, as the first velocities are estimated: lambda(0) = 0. Output error is therefore an
estimate by instruments lambda, and its covariance that of such an estimate: exact for noise of sensors and for forces,
white or slow, with the variances that explain eps best. Standard deviations grow where the variance changes, and by
Student's t, as in `solve.sandwich`. Where the parts do not explain eps, they are those that a kernel finds in r where
these are larger. What is known of actuators' times beforehand, with precision L in units of the cost,
adds to G, and its own errors of variance S add G^-1 L S L G^-1.

Source: the adjoint after A. E. Bryson and Y.-C. Ho, Applied Optimal Control (1975), 2.2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.estimation.noise import SPECTRUM_MISFIT, Fitted, Stretch, coupled_covariance, fit_coupled, stretches
from expdesign.estimation.output_error.gauss_newton import regular, runs_away
from expdesign.estimation.output_error.problem import Problem
from expdesign.estimation.regression import STEADY_CURRENT, Integers, Layout, Regression, headings_at
from expdesign.estimation.solve import (
    Shares,
    Solution,
    Weighting,
    changing_variance,
    differing_note,
    misfit_note,
    solve_ls,
    widening,
)
from expdesign.signals import Record
from expdesign.values import Array

EVERY = -1  # key that stands for all outputs


def with_covariance(
    problem: Problem, layout: Layout, record: Record, values: Array, starts: Array, *, quick: bool = False
) -> tuple[Solution, Regression]:
    """A last Gauss-Newton step as a least-squares problem, with its covariance and null space.

    Its regressors are the derivatives, projected on the complement of the starts (Frisch and Waugh). A quick covariance
    is that of least squares with errors that do not last.

    Raises:
        NoAnswer: the model grows so fast that what the starts make up for cannot be told.
    """
    simulated, seen = _linearised(problem, values, starts), np.isfinite(problem.measured)
    batch, step, order = _places(problem)
    slopes, names = _columns(simulated.slopes, problem, layout)
    heavier = np.sqrt(problem.weight / problem.weights)  # of first samples
    n = len(layout.model.outputs)
    regression = Regression(
        parameters=names,
        Phi=(slopes * heavier[..., None]).reshape(-1, n, len(names))[order],
        y=(heavier * simulated.errors).reshape(-1, n)[order],
        batch=batch,
        step=step,
        outputs=layout.model.outputs,
    )
    weighting = Weighting(output_weights=tuple(problem.weights / problem.weights.max()), covariance="hc0")
    whole = _with_known(regression, problem, values)
    last = solve_ls(whole, weighting)
    found = None if quick else _propagated(problem, layout, record, simulated)
    P, misfit = (last.covariance, np.zeros(n)) if found is None else (found.P, found.misfit)
    if (misfit > SPECTRUM_MISFIT).any():
        robust = solve_ls(whole, replace(weighting, covariance="hac"))
        own, other = np.diag(P), np.diag(robust.covariance)
        scale = np.sqrt(np.divide(np.maximum(own, other), own, out=np.ones_like(own), where=own > 0))
        P = P * np.outer(scale, scale)
        note = misfit_note(regression.outputs, misfit)
        last = replace(last, lags=robust.lags, warnings=(*last.warnings, note))
    if found is not None:
        wider, ratio = found.shares.widened(P)
        if ratio > 1.0:
            last = replace(last, warnings=(*last.warnings, differing_note(ratio)), between_runs=wider - P)
        P = wider
    heavier = np.where(seen, heavier, 1.0).reshape(-1, n)[order]
    residuals = last.residuals[: len(regression)] / heavier
    last = replace(last, values=values[: len(names)] + last.values, residuals=residuals)
    return replace(last, covariance=P), regression


def _with_known(regression: Regression, problem: Problem, values: Array) -> Regression:
    """The regression with what is known of times beforehand as more rows, in a batch of their own."""
    count, first = problem.beyond, problem.parameters - problem.beyond
    if not count:
        return regression
    root = np.sqrt(problem.precision[first:] / problem.weights[0])
    Phi, y = np.zeros((count, *regression.Phi.shape[1:])), np.zeros((count, regression.y.shape[1]))
    Phi[np.arange(count), 0, first + np.arange(count)] = root
    y[:, 0] = -root * problem.departure(values)[first:]
    return replace(
        regression,
        Phi=np.concatenate([regression.Phi, Phi]),
        y=np.concatenate([regression.y, y]),
        batch=np.append(regression.batch_of, np.full(count, regression.batch_of[-1] + 1)),
        step=np.append(regression.step_of, np.arange(count)),
    )


@dataclass(frozen=True, eq=False)
class _Linearised:
    """A simulation around the estimate."""

    errors: Array  # (L, W, n) measured minus simulated; where nothing was measured, on the line between neighbours
    slopes: Array  # (L, W, n, q) its derivatives, without what the starts make up for
    steps: Array  # (L - 1, W, n, n) A, of each next state by the state


def _linearised(problem: Problem, values: Array, starts: Array) -> _Linearised:
    states = problem.states(values, starts)
    length, count, n = states.shape
    local = problem.local(values)
    slopes, by_start = np.zeros((length, count, n, local.shape[1])), np.zeros((length, count, n, n))
    steps = np.zeros((length, count, n, n))
    for part in problem.compiled.slope_blocks(local, states):
        at = (part.samples, part.active)
        slopes[at], by_start[at], steps[at] = part.by_values, part.by_start, part.steps
    if not problem.constant:
        slopes = slopes[..., : problem.parameters]
    weighted = by_start * problem.weight[..., None]
    S, C = (np.einsum("lwna,lwnb->wab", weighted, rows, optimize=True) for rows in (by_start, slopes))
    try:
        near = np.linalg.solve(regular(S), C)
    except np.linalg.LinAlgError:  # one growing motion hides all others of a start
        raise runs_away(problem) from None
    for sample in range(length):  # in place: these are the largest arrays
        slopes[sample] -= by_start[sample] @ near
    return _Linearised(_between_readings(problem, states), slopes, steps[1:])


def _between_readings(problem: Problem, states: Array) -> Array:
    """(L, W, n) errors; where nothing was measured they are free, as nothing is compared there."""
    errors = problem.measured - states
    for stretch, output in np.argwhere(~np.isfinite(errors).all(axis=0)):
        column = errors[:, stretch, output]
        seen = np.flatnonzero(np.isfinite(column))
        column[:] = np.interp(np.arange(len(column)), seen, column[seen]) if len(seen) else 0.0
    return errors


@dataclass(frozen=True, eq=False)
class _Propagated:
    """What the noise of one step does to an estimate."""

    P: Array  # (p, p) covariance
    misfit: Array  # (n,) how little that noise explains each output's
    shares: Shares  # of the runs


def _propagated(problem: Problem, layout: Layout, record: Record, simulated: _Linearised) -> _Propagated:
    A, slopes = simulated.steps, _columns(simulated.slopes, problem, layout)[0]
    lead = slopes * problem.weight[..., None]
    sensed = np.einsum("lwna,lwnb->nab", lead, lead, optimize=True)
    known = np.zeros((2, slopes.shape[-1]))
    known[:, : problem.parameters] = problem.precision, problem.precision * problem.spread
    G = _inverse(np.einsum("lwna,lwnb->ab", lead, slopes, optimize=True) + np.diag(known[0]))
    runs = np.unique(problem.batch)
    of = [G.T @ np.einsum("lwna,lwnb->ab", lead[:, own], slopes[:, own], optimize=True)
          for own in (problem.batch == run for run in runs)]  # fmt: skip
    scores = [np.einsum("lwna,lwn->a", lead[:, own], simulated.errors[:, own]) @ G
              for own in (problem.batch == run for run in runs)]  # fmt: skip
    for sample in range(len(lead) - 2, -1, -1):  # summed backwards to lambda, in place
        lead[sample] += A[sample].swapaxes(1, 2) @ lead[sample + 1]
    rows, errors, owner = _steps_of(problem, record), simulated.errors, _owners(problem, layout)
    W = (G.T @ rows.of(lead[1:]).transpose(1, 2, 0)).transpose(2, 0, 1)  # columns in one piece
    del lead  # as large as the derivatives
    eps = rows.of(errors[1:] - np.einsum("lwab,lwb->lwa", A, errors[:-1]))
    by = []
    for output in range(len(layout.model.outputs)):
        own = np.flatnonzero((owner == output) | (owner == EVERY))
        Phi = slopes[1:, :, output, own] - np.einsum("lwb,lwbp->lwp", A[:, :, output], slopes[:-1, :, :, own])
        by.append(Fitted(rows.of(Phi), W[:, output, own]))
    found = fit_coupled(eps, rows.of(A), rows.parts, by)
    P, doubt = coupled_covariance(W, G @ sensed @ G, found, rows.parts)
    changing = changing_variance(W, eps, rows.batch, rows.step)
    scale = changing * widening(np.diag(P), doubt)
    beforehand = G * known[1]
    P = P * np.outer(scale, scale) + beforehand @ beforehand.T
    return _Propagated(P, found.misfit, Shares(np.array(scores), np.array(of)))


def _inverse(information: Array) -> Array:
    size = np.sqrt(np.diag(information))
    return np.asarray(np.linalg.inv(information / np.outer(size, size)) / np.outer(size, size))


def _owners(problem: Problem, layout: Layout) -> Integers:
    """(p,) the output in whose equation each parameter and each constant stands; current and times act in every one."""
    model = layout.model
    equations = [model.terms[model.names.index(name)].equation for name in layout.parameters]
    found = [model.outputs.index(name) for name in equations]
    runs = int(problem.batch.max()) + 1 if problem.constant else 0
    return np.array([*found, *([EVERY] * (problem.parameters - len(found))), *(list(range(len(model.outputs))) * runs)])


@dataclass(frozen=True, eq=False)
class _Steps:
    """Steps from every sample to the next of the same stretch, one stretch after the other."""

    there: NDArray[np.bool_]  # (W, L - 1) whether a stretch lasts so long
    # batch, step: (k,) of each row
    batch: Integers
    step: Integers
    parts: list[Stretch]  # where rows stand in time

    def of(self, values: Array) -> Array:
        """Rows (k, ...) from (L - 1, W, ...)."""
        return np.asarray(values.swapaxes(0, 1)[self.there])


def _steps_of(problem: Problem, record: Record) -> _Steps:
    counts = problem.compiled.stretches.counts
    there = np.arange(len(problem.measured) - 1) < counts[:, None] - 1
    stretch, sample = np.nonzero(there)
    batch, step = problem.batch[stretch], problem.first[stretch] + sample
    heading = headings_at(record, [step[batch == number] for number in range(len(record.batches))])
    return _Steps(there, batch, step, stretches(batch, step, heading))


def _places(problem: Problem) -> tuple[Integers, Integers, Integers]:
    """Batch, sample and index of every row with a measured output, in the order of time; the others are zero in it."""
    length, count = problem.measured.shape[:2]
    whole = np.isfinite(problem.measured).any(axis=2).ravel()
    batch = np.broadcast_to(problem.batch, (length, count)).ravel()
    step = (problem.first + np.arange(length)[:, None]).ravel()
    order = np.lexsort((step, batch))
    order = order[whole[order]]
    return batch[order], step[order], order


def _columns(slopes: Array, problem: Problem, layout: Layout) -> tuple[Array, tuple[str, ...]]:
    """Parameters, a current and times, then the constants of each run."""
    p, outputs, stretches = problem.parameters, layout.model.outputs, problem.compiled.stretches
    sought = (*layout.parameters, *(STEADY_CURRENT if stretches.flowing else ()), *stretches.times)
    if not problem.constant:
        return slopes, sought
    runs = int(problem.batch.max()) + 1
    member = (problem.batch[:, None] == np.arange(runs)).astype(float)
    own = np.einsum("lwns,wb->lwnbs", slopes[..., p:], member).reshape(*slopes.shape[:3], -1)
    names = [f"constant d{name}/dt of run {number + 1}" for number in range(runs) for name in outputs]
    return np.concatenate([slopes[..., :p], own], axis=3), (*sought, *names)
