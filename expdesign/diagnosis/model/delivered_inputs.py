"""Inputs as the actuators of an extended model follow them: dead band, dead time, lag and offset, in this order."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import lfilter

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model.extended import Extended
from expdesign.values import Array
from expdesign.vessel import stem


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


FINER = 4
"""Steps within an integrator step in which moving actuators are followed: forces are not linear in angles."""


def followed_inputs(ship: Extended, windows: Windows) -> tuple[tuple[Array, int], ...]:
    """Per batch, the inputs after dead band, dead time, lag and offset, and how many rows an integrator step has."""
    inputs = ship.model.inputs
    moving = any(key.startswith(("delay:", "lag:")) and value for key, value in ship.effects.items())
    parts = -(-FINER // windows.rows_per_step) if moving else 1
    acting = tuple(np.repeat(rows, parts, axis=0) for rows in windows.batch_inputs)
    finer = parts * windows.rows_per_step
    for kind, change in (("deadband", _dead_band), ("delay", _delayed), ("lag", _lagged), ("offset", _offset)):
        for key, value in ship.effects.items():
            if key.startswith(kind + ":") and value != 0.0:
                columns = members(key.split(":", 1)[1], inputs)
                acting = tuple(_changed(rows, columns, change, value, windows.step_s / finer) for rows in acting)
    return tuple((rows, finer) for rows in acting)


def _changed(rows: Array, columns: list[int], change, value: float, step_s: float) -> Array:  # type: ignore[no-untyped-def]
    result = np.array(rows)
    result[:, columns] = change(result[:, columns], value, step_s)
    return result


def _dead_band(rows: Array, width: float, step_s: float) -> Array:
    return np.where(np.abs(rows) < width, 0.0, rows)


def _offset(rows: Array, value: float, step_s: float) -> Array:
    return rows + value


def _delayed(rows: Array, delay_s: float, step_s: float) -> Array:
    """Held inputs late by any time: the mean over each step of what then acts."""
    whole, share = divmod(max(delay_s, 0.0) / step_s, 1.0)
    index = np.arange(len(rows)) - int(whole)
    near, far = rows[np.maximum(index, 0)], rows[np.maximum(index - 1, 0)]
    return (1 - share) * near + share * far


def _lagged(rows: Array, lag_s: float, step_s: float) -> Array:
    """First-order lag, the mean over each step."""
    if lag_s <= 1e-9:
        return rows
    fade = np.exp(-step_s / lag_s)
    mean_share = lag_s / step_s * (1 - fade)
    ends = lfilter([1 - fade], [1.0, -fade], rows, axis=0, zi=fade * rows[:1])[0]
    begins = np.concatenate([rows[:1], ends[:-1]])
    return np.asarray(rows + (begins - rows) * mean_share)
