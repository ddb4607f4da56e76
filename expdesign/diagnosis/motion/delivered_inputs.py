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


def delivered_inputs(ship: ExtendedModel, windows: Windows) -> tuple[tuple[Array, int], ...]:
    """Per batch, the delivered inputs (k, m) and how many of their rows an integrator step has."""
    inputs = ship.model.inputs
    moving = any(key.startswith(("delay:", "lag:")) and value for key, value in ship.effects.items())
    parts = -(-TUNING.actuator_substeps // windows.rows_per_step) if moving else 1
    delivered = tuple(np.repeat(rows, parts, axis=0) for rows in windows.batch_inputs)
    finer = parts * windows.rows_per_step
    for kind, field in RESPONSES.items():
        for key, value in ship.effects.items():
            if key.startswith(kind + ":") and value != 0.0:
                columns, response = group_columns(key.split(":", 1)[1], inputs), _response(field, value)
                delivered = tuple(_through(rows, columns, response, windows.step_s / finer) for rows in delivered)
    return tuple((rows * _scales(ship), finer) for rows in delivered)


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


def _through(rows: Array, columns: list[int], response: Response, step_s: float) -> Array:
    """Inputs (k, m) of which some columns go through actuators with this response."""
    result = np.array(rows)
    responses = (response,) * len(columns)
    result[:, columns] = deliver(responses, result[:, columns], sample_time_s=step_s)[:, 0]
    return result
