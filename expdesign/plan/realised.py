"""Information of the stitched trajectory: transits inform too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.durations import DurationDesign
from expdesign.durations.collected import Collected
from expdesign.information import moments, regressor_rows
from expdesign.plan.values import Leg
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Environment, delivered
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
) -> float | None:
    """Efficiency of the whole trial, legs included, against the optimal design in the time asked for.

    By the design's criterion and the nominal model, of the information collected, not per second: above 1 when what the
    legs add outweighs what rounding and headings take. None where the design has nuisance regressors or recorded
    primitives, which the track alone says nothing about.
    """
    problem = replace(design.problem, robust="nominal", sampled=np.zeros((0, 0, 0, 0)))
    if not set(problem.parameters) <= set(vessel.model.names) or not problem.symmetric:
        return None
    rows = regressor_rows(vessel.model, trajectory, delivered(vessel, commands), environment)
    batches = [rows[leg.first : leg.last] for leg in legs] if problem.mean_subtraction == "batch" else [rows]
    matrix = np.sum(
        [
            len(batch) / len(rows) * _bordered(vessel, batch, problem.parameters, problem.mean_subtraction)
            for batch in batches
        ],
        axis=0,
    )
    return Collected.of(problem).efficiency_of(commands.duration_s / problem.total_s * matrix, design.fractions)


def _bordered(vessel: Vessel, rows: Array, parameters: Sequence[str], mean_subtraction: str) -> Array:
    X, Y = moments(vessel.model, rows, parameters)
    if mean_subtraction == "none":
        return X
    if mean_subtraction == "batch":
        return X - Y @ Y.T
    return np.block([[X, Y], [Y.T, np.eye(Y.shape[1])]])
