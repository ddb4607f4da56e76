"""Recorded inputs are held against the limits that a vessel file states of its actuators.

A unit or a name that is wrong gives inputs which no actuator of the ship can take: 180 "revolutions per second" of 4.
A few rows beyond a limit are told; a file whose inputs mostly are is refused, as all that follows would be wrong by as
much.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from expdesign.records.file import Table, input_name
from expdesign.vessel import Actuator, Limit, column_name
from expdesign.vessel.actuators import stem

LIMIT_SLACK = 0.02  # share of an actuator's limit by which a recorded input may exceed it
MOST_BEYOND = 0.5  # share of rows beyond the limits above which a file is refused
FAR_BEYOND = 3.0  # multiple of a limit from which another unit is thought of

MISTAKES = {
    "n": (
        ("revolutions per minute belong under {rpm}", 1.0 / 60.0),
        ("is it in per cent of the highest speed?", 0.01),
    ),
    "a": (("degrees belong under {deg}", math.pi / 180.0),),
    "rudder": (("degrees belong under {deg}", math.pi / 180.0),),
    "tau": (("is it in a unit a thousand times as small as the vessel file's?", 1e-3),),
}
"""Stem of a signal -> what may be wrong, and the factor that would put it right; per cent are of the upper limit."""


def column_limits(actuators: Sequence[Actuator]) -> dict[str, Limit]:
    """Column of a file -> limits of the signal that it holds."""
    return {
        column_name(signal): limit
        for actuator in actuators
        for signal, limit in zip(actuator.signals, actuator.limits, strict=True)
    }


def check_limits(table: Table, limits: Mapping[str, Limit]) -> Table:
    """The table with a note for every input, planned and reached ones too, that is beyond its limits in some rows.

    Raises:
        FileError: one is in most rows; or wherever it is not zero, and by as much as another unit would explain.
    """
    for name, values in table.columns.items():
        signal, source = input_name(name), table.sources.get(name)
        limit = limits.get(signal, Limit())
        slack = LIMIT_SLACK * _size(limit)
        beyond = (values < limit.low - slack) | (values > limit.high + slack)
        if source is None or not beyond.any():
            continue
        most = int(np.argmax(np.where(beyond, np.abs(values), -1.0)))
        bounds = " to ".join(f"{bound / source.factor:.4g}" for bound in (limit.low, limit.high))
        where = f"beyond the vessel's limits of {bounds} in {math.ceil(100 * np.mean(beyond))} % of the rows"
        cause = _cause(signal, values[values != 0], limit, header=source.header, plain=source.factor == 1.0)
        if np.mean(beyond) > MOST_BEYOND or (cause and np.mean(beyond[values != 0]) > MOST_BEYOND):
            found = f"is {table.value(name, most)} in row {most + table.first_row}, {where}"
            raise table.error(name, "; ".join(filter(None, (found, cause))))
        found = f"{source.header} is {where} ({table.rows(beyond)}), as far as {table.value(name, most)}"
        table = table.noted(found)
    return table


def _size(limit: Limit) -> float:
    """A range that a slack is a share of."""
    bounds = [abs(bound) for bound in (limit.low, limit.high) if math.isfinite(bound)]
    return max(bounds, default=0.0)


def _cause(signal: str, values: np.ndarray, limit: Limit, *, header: str, plain: bool) -> str:
    """The mistake that puts all values within the limits, in words; "" where none does."""
    slack = LIMIT_SLACK * _size(limit)
    if not plain or np.abs(values).max() < FAR_BEYOND * _size(limit):
        return ""
    for words, factor in MISTAKES["tau" if signal.startswith("tau") else stem(signal.rpartition("_")[0])]:
        right = factor * (limit.high if factor == 0.01 else 1.0) * values
        if ((right >= limit.low - slack) & (right <= limit.high + slack)).all():
            return words.format(rpm=header.replace("rps", "rpm"), deg=header.replace("rad", "deg"))
    return ""
