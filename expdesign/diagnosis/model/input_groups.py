"""Groups of inputs that share an actuator fault: all, those of one stem, single ones."""

from __future__ import annotations

import math
from collections.abc import Mapping

from expdesign.vessel import stem

RESPONSES = {"slew": "rate", "deadband": "deadband", "delay": "delay_s", "lag": "lag_s", "offset": "offset"}
"""Kind of effect of a group of inputs -> field of `vessel.Response`, in the order in which they act.

The effect of a slew rate is its inverse, the time that a change of one unit takes, so that zero changes nothing.
"""


def response_effect(kind: str, value: float) -> float:
    """From a field of `vessel.Response` to the effect or back: the inverse of a slew rate, else the same."""
    return (1.0 / value if value else math.inf) if kind == "slew" else value


def group_columns(group: str, inputs: tuple[str, ...]) -> list[int]:
    """Columns of the inputs that belong to a group."""
    return [index for index, name in enumerate(inputs) if group in ("all", name) or stem(name) == group]


def input_groups(inputs: tuple[str, ...]) -> list[str]:
    """All inputs, those of one stem, single ones; of groups with the same members the first."""
    stems = sorted({stem(name) for name in inputs})
    groups = ["all", *(stems if len(stems) > 1 else []), *inputs]
    taken: dict[tuple[int, ...], str] = {}
    for group in groups:
        taken.setdefault(tuple(group_columns(group, inputs)), group)
    return list(taken.values())


def values_by_group(values: Mapping[str, float], inputs: tuple[str, ...]) -> dict[str, float]:
    """Nonzero values of single inputs, by stem where all inputs of a stem have the same."""
    left, found = list(inputs), dict[str, float]()
    several = len({stem(name) for name in inputs}) > 1
    for group in input_groups(inputs)[several:]:
        names = [inputs[column] for column in group_columns(group, inputs)]
        shared = {values.get(name, 0.0) for name in names}
        if set(names) <= set(left) and len(shared) == 1:
            found[group] = shared.pop()
            left = [name for name in left if name not in names]
    return {group: value for group, value in found.items() if value}
