"""Inputs as the actuators of an extended model deliver them.

Dead band, dead time, lag, offset and scale, in this order.
"""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model import RESPONSES, ExtendedModel, group_columns
from expdesign.diagnosis.motion.tuning import TUNING
from expdesign.simulation import deliver
from expdesign.values import Array
from expdesign.vessel import Response


def delivered_inputs(ship: ExtendedModel, rows: Array, windows: Windows) -> tuple[Array, int]:
    """Delivered inputs (k, m, b) of batches of equal length, and how many of their rows an integrator step has.

    Args:
        ship: its actuators.
        rows: (k_b, m, b) held inputs.
        windows: that they belong to.
    """
    inputs = ship.model.inputs
    moving = any(key.startswith(("delay:", "lag:")) and value for key, value in ship.effects.items())
    parts = -(-TUNING.actuator_substeps // windows.rows_per_step) if moving else 1
    delivered = np.repeat(rows, parts, axis=0)
    finer = parts * windows.rows_per_step
    for kind, field in RESPONSES.items():
        for key, value in ship.effects.items():
            if key.startswith(kind + ":") and value != 0.0:
                columns, response = group_columns(key.split(":", 1)[1], inputs), _response(field, value)
                responses = (response,) * len(columns)
                through = deliver(responses, delivered[:, columns], sample_time_s=windows.step_s / finer)
                delivered[:, columns] = through[:, 0]
    return delivered * _scales(ship)[:, None], finer


def actuator_effects(ship: ExtendedModel) -> dict[str, float]:
    """Effects that change what actuators deliver."""
    kinds = {*RESPONSES, "scale"}
    return {key: value for key, value in ship.effects.items() if value and key.split(":", 1)[0] in kinds}


def _scales(ship: ExtendedModel) -> Array:
    """(m,) factors of the inputs."""
    factors = np.ones(len(ship.model.inputs))
    for key, value in ship.effects.items():
        if key.startswith("scale:"):
            factors[group_columns(key.split(":", 1)[1], ship.model.inputs)] *= 1.0 + value
    return factors


def _response(field: str, value: float) -> Response:
    """A response with one effect; fits may try times and dead bands below zero, which count as zero."""
    return Response(**{field: value if field == "offset" else max(value, 0.0)})
