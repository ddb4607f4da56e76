"""Output error: the parameters whose simulation from the batch's start comes nearest to the measured velocities.

The simulated velocities carry no measurement noise, so with noise on the sensors alone this is the maximum-likelihood
estimate and no other does better: the accuracy reference for IV. Current, wind and gusts are not in its model, and it
is not consistent where they act. Outputs are weighted by one over their residual variance, found in a second pass.
Batches start from free initial velocities. Covariance: Gauss-Newton sensitivities of the simulation, robust to coloured
residuals as for IV.

Source: L. Ljung, System Identification, 2nd ed. (1999), 4.2 and 9.3; H. G. Bock (1981) for the multiple shooting.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError, NoAnswer
from expdesign.estimation._casadi import OutputErrorProblem, sensitivities, solve_output_error
from expdesign.estimation.predictors import Layout
from expdesign.estimation.regression import Integers, Regression
from expdesign.estimation.replay import Integration
from expdesign.estimation.solution import Solution, Weighting, solve_ls
from expdesign.estimation.tables import inputs_of
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import VesselModel

PASSES = 2
"""The first weights outputs by their one-step residuals, the second by the first's."""


def minimise_output_error(
    layout: Layout, record: Record, start: Solution, integration: Integration
) -> tuple[Solution, Regression]:
    """The estimate of the layout's parameters; then one nuisance value per batch and output, its initial velocity.

    Returns the solution and the regression of its last Gauss-Newton step, for names and rows.

    Args:
        layout: with the basic predictor.
        record: batches of one sample time.
        start: a regression's solution, for the first guess and for weights.
        integration: how the model is simulated.

    Raises:
        InputError: batches of different sample times, or inputs that are not numbers.
        NotInformative: parameters that the simulated outputs do not depend on.
        NoAnswer: the optimiser finds no optimum.
    """
    problem = _problem(layout, record, start, integration)
    for _ in range(PASSES):
        found = solve_output_error(problem)
        if found is None:
            raise NoAnswer("output error: the optimiser finds no optimum; try other data or start from a better model")
        values, states = found
        variance = np.nanmean((problem.measured - states) ** 2, axis=0)
        problem = replace(
            problem, start=values, weights=1.0 / np.maximum(variance, 1e-12 * np.nanvar(problem.measured, axis=0))
        )
    return _with_covariance(problem, layout, record, values, states)


def _problem(layout: Layout, record: Record, start: Solution, integration: Integration) -> OutputErrorProblem:
    model = layout.model
    times = {batch.sample_time_s for batch in record.batches}
    if len(times) > 1:
        raise InputError(f"output error needs one sample time, found {', '.join(f'{t:g} s' for t in sorted(times))}")
    inputs = np.concatenate([inputs_of(model, batch) for batch in record.batches])
    if not np.isfinite(inputs).all():
        raise InputError("output error needs inputs at every sample; some are not numbers")
    states = tuple(OUTPUTS.index(name) for name in model.outputs)
    measured = np.concatenate([batch.velocity[:, states] for batch in record.batches])
    last = np.zeros(len(inputs), dtype=bool)
    last[np.cumsum([len(batch) for batch in record.batches]) - 1] = True
    p = len(layout.parameters)
    return OutputErrorProblem(
        model=_without_merged(layout),
        sought=tuple(model.names.index(name) for name in layout.parameters),
        states=states,
        inputs=inputs,
        measured=measured,
        weights=1.0 / np.maximum(start.residuals.var(axis=0), 1e-12 * np.nanvar(measured, axis=0)),
        last=last,
        sample_time_s=times.pop(),
        integrator=integration.integrator,
        substeps=integration.substeps,
        start=np.array(start.values[:p]),
        scale=np.abs(start.values[:p]) + np.sqrt(np.diag(start.covariance)[:p]),
    )


def _without_merged(layout: Layout) -> VesselModel:
    return layout.model.with_parameters(dict.fromkeys(layout.merged, 0.0))


def _with_covariance(
    problem: OutputErrorProblem, layout: Layout, record: Record, values: Array, states: Array
) -> tuple[Solution, Regression]:
    """One Gauss-Newton step written as least squares: it adds next to nothing, and brings covariance and null space."""
    slopes = sensitivities(problem, values, states)
    batch = np.repeat(np.arange(len(record.batches)), [len(item) for item in record.batches])
    residuals = problem.measured - states
    Phi, names = _columns(slopes, batch, layout)
    whole = np.isfinite(residuals).all(axis=1)
    regression = Regression(
        parameters=names,
        Phi=Phi[whole],
        y=residuals[whole],
        batch=batch[whole],
        step=_steps(batch)[whole],
        outputs=layout.model.outputs,
    )
    step = solve_ls(regression, Weighting(output_weights=tuple(problem.weights / problem.weights.max())))
    starts = states[np.flatnonzero(np.diff(batch, prepend=-1))].ravel()
    solution = Solution(
        values=np.concatenate([values, starts]) + step.values,
        covariance=step.covariance,
        residuals=step.residuals,
        lags=step.lags,
        null_space=step.null_space,
    )
    return solution, regression


def _columns(slopes: Array, batch: Integers, layout: Layout) -> tuple[Array, tuple[str, ...]]:
    """Parameters, then the first velocities of each batch."""
    p, outputs = len(layout.parameters), layout.model.outputs
    member = (batch[:, None] == np.unique(batch)).astype(float)
    starts = np.einsum("kns,kb->knbs", slopes[:, :, p:], member).reshape(*slopes.shape[:2], -1)
    names = [f"first {name} of batch {number + 1}" for number in range(member.shape[1]) for name in outputs]
    return np.concatenate([slopes[:, :, :p], starts], axis=2), (*layout.parameters, *names)


def _steps(batch: Integers) -> Integers:
    return np.asarray(np.arange(len(batch)) - np.searchsorted(batch, batch, side="left"), dtype=np.int64)
