"""Inputs as the actuators of an extended model follow them: dead band, dead time, lag and offset, in this order."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model.extended import Extended
from expdesign.simulation import deliver
from expdesign.values import Array
from expdesign.vessel import Response, stem


def members(group: str, inputs: tuple[str, ...]) -> list[int]:
    """Columns of the inputs that belong to a group."""
    return [index for index, name in enumerate(inputs) if group in ("all", name) or stem(name) == group]


def input_groups(inputs: tuple[str, ...]) -> list[str]:
    """All inputs, those of one stem, single ones; of groups with the same members the first."""
    stems = sorted({stem(name) for name in inputs})
    groups = ["all", *(stems if len(stems) > 1 else []), *inputs]
    taken: dict[tuple[int, ...], str] = {}
    for group in groups:
        taken.setdefault(tuple(members(group, inputs)), group)
    return list(taken.values())


def grouped(values: Mapping[str, float], inputs: tuple[str, ...]) -> dict[str, float]:
    """Values of single inputs, zero where left out, said of stems where these share one; zeros are not said."""
    left, found = list(inputs), dict[str, float]()
    several = len({stem(name) for name in inputs}) > 1
    for group in input_groups(inputs)[several:]:
        names = [inputs[column] for column in members(group, inputs)]
        shared = {values.get(name, 0.0) for name in names}
        if set(names) <= set(left) and len(shared) == 1:
            found[group] = shared.pop()
            left = [name for name in left if name not in names]
    return {group: value for group, value in found.items() if value}


RESPONSES = (("deadband", "deadband"), ("delay", "delay_s"), ("lag", "lag_s"), ("offset", "offset"))
"""Kinds of effects, in the order in which they act, and the field of a response that each is."""
FINER = 4
"""Steps within an integrator step in which moving actuators are followed: forces are not linear in angles."""


def followed_inputs(ship: Extended, windows: Windows) -> tuple[tuple[Array, int], ...]:
    """Per batch, the inputs after dead band, dead time, lag and offset, and how many rows an integrator step has."""
    inputs = ship.model.inputs
    moving = any(key.startswith(("delay:", "lag:")) and value for key, value in ship.effects.items())
    parts = -(-FINER // windows.rows_per_step) if moving else 1
    acting = tuple(np.repeat(rows, parts, axis=0) for rows in windows.batch_inputs)
    finer = parts * windows.rows_per_step
    for kind, field in RESPONSES:
        for key, value in ship.effects.items():
            if key.startswith(kind + ":") and value != 0.0:
                columns, response = members(key.split(":", 1)[1], inputs), _response(field, value)
                acting = tuple(_answered(rows, columns, response, windows.step_s / finer) for rows in acting)
    return tuple((rows, finer) for rows in acting)


def _response(field: str, value: float) -> Response:
    """A response with one effect; fits may try times and dead bands below zero, which are none."""
    return Response(**{field: value if field == "offset" else max(value, 0.0)})


def _answered(rows: Array, columns: list[int], response: Response, step_s: float) -> Array:
    """Inputs (k, m) of which some columns go through actuators with this response."""
    result = np.array(rows)
    responses = (response,) * len(columns)
    result[:, columns] = deliver(responses, result[:, columns], sample_time_s=step_s)[:, 0]
    return result
