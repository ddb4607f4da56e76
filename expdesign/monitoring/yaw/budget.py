"""What each term of a yaw model contributes in a voyage, and which parameters a voyage can tell apart."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.monitoring.yaw.estimate import simulate_yaw
from expdesign.monitoring.yaw.model import YawData, YawModel
from expdesign.values import Array

RANK_TOLERANCE = 1e-6


def term_budget(model: YawModel, data: YawData, parameters: Mapping[str, float]) -> dict[str, Array]:
    """Parameter -> (n, k) moment of its term [Nm] along the measured motion."""
    values = model.terms(data)
    return {name: parameters[name] * values[..., place] for place, name in enumerate(model.parameters[1:])}


def excitation_rank(model: YawModel, data: YawData, parameters: Mapping[str, float]) -> int:
    """Number of parameters that one voyage determines: rank of the sensitivities of the simulated yaw rate."""
    scale = np.array([abs(parameters[name]) for name in model.parameters])
    values = np.array([parameters[name] for name in model.parameters])
    columns = simulate_yaw(model, data, values)[1][0] * scale
    size = np.linalg.norm(columns, axis=0)
    return int(np.linalg.matrix_rank(columns / np.where(size > 0, size, 1.0), tol=RANK_TOLERANCE))
