"""Inputs as the actuators of an extended model deliver them.

Slew rate, dead band, dead time, lag, offset and scale, in this order.
"""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model import RESPONSES, ExtendedModel, group_columns, response_effect
from expdesign.diagnosis.motion.tuning import TUNING
from expdesign.simulation import deliver, keeps_to, positions
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
    rows = _slewed(ship, rows, windows)
    moving = any(key.startswith(("delay:", "lag:")) and value for key, value in ship.effects.items())
    parts = -(-TUNING.actuator_substeps // windows.rows_per_step) if moving else 1
    delivered = np.repeat(rows, parts, axis=0)
    finer = parts * windows.rows_per_step
    for kind, field in RESPONSES.items():
        for key, value in ship.effects.items():
            if kind != "slew" and key.startswith(kind + ":") and value != 0.0:
                columns, response = group_columns(key.split(":", 1)[1], inputs), _response(field, value)
                responses = (response,) * len(columns)
                through = deliver(responses, delivered[:, columns], sample_time_s=windows.step_s / finer)
                delivered[:, columns] = through[:, 0]
    return delivered * _scales(ship)[:, None], finer


def _slewed(ship: ExtendedModel, rows: Array, windows: Windows) -> Array:
    """Mean positions over each sample of the data of actuators that move towards recorded commands at a slew rate."""
    held = windows.steps_per_sample if windows.rows_per_step == 1 else 1  # steps in between repeat the inputs
    sample_s = windows.step_s / windows.rows_per_step * held
    for key, value in ship.effects.items():
        if not key.startswith("slew:") or value <= 0.0:
            continue
        response = _response("rate", response_effect("slew", value))
        for column in group_columns(key.split(":", 1)[1], ship.model.inputs):
            for batch in range(rows.shape[2]):
                commands = rows[::held, [column], batch]
                if not keeps_to(_stated_rate(ship, column, response.rate), commands[:, 0], sample_time_s=sample_s):
                    given = positions((response,), commands, sample_time_s=sample_s, standing=None).means
                    rows = rows.copy()
                    rows[:, column, batch] = np.repeat(given[:, 0], held)[: len(rows)]
    return rows


def _stated_rate(ship: ExtendedModel, column: int, rate: float) -> float:
    """The rate that the vessel file states for an input, else another one: what is recorded is judged once."""
    stated = (
        value
        for key, value in ship.stated.items()
        if key.startswith("slew:") and column in group_columns(key.split(":", 1)[1], ship.model.inputs)
    )
    return response_effect("slew", next(stated, 1.0 / rate))


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
