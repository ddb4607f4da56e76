"""Information of the stitched trajectory: transits inform too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.durations import DurationDesign, log_det
from expdesign.durations.certificate import scaled
from expdesign.information import moments, regressor_rows
from expdesign.plan.values import Leg
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Environment
from expdesign.values import Array
from expdesign.vessel import Vessel


def realised_efficiency(
    vessel: Vessel,
    design: DurationDesign,
    environment: Environment,
    *,
    commands: Commands,
    trajectory: Trajectory,
    legs: Sequence[Leg],
) -> float:
    """D-efficiency of the whole trial, legs included, against the optimal design in the time asked for.

    (det I_trial / det I_optimal)^(1/p) with I the information collected, not per second: above 1 when what the legs
    add outweighs what rounding and headings take.
    """
    problem = design.problem
    rows = regressor_rows(vessel.model, trajectory, commands, environment)
    batches = [rows[leg.first : leg.last] for leg in legs] if problem.mean_subtraction == "batch" else [rows]
    matrix = sum(
        (len(batch) / len(rows) * _bordered(vessel, batch, problem.parameters, problem.mean_subtraction))
        for batch in batches
    )
    matrices, offset = scaled(np.array([matrix]))
    gained = log_det(matrices, np.ones(1)) + offset
    p = len(problem.parameters)
    return float(np.exp((gained - design.log_det) / p + np.log(commands.duration_s / problem.total_s)))


def _bordered(vessel: Vessel, rows: Array, parameters: Sequence[str], mean_subtraction: str) -> Array:
    X, Y = moments(vessel.model, rows, parameters)
    if mean_subtraction == "none":
        return X
    if mean_subtraction == "batch":
        return X - Y @ Y.T
    return np.block([[X, Y], [Y.T, np.eye(Y.shape[1])]])
