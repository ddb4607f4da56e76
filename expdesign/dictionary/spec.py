"""Manoeuvre families and requests for members of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from expdesign.errors import InputError, UnknownName
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One parameter of a family.

    Attributes:
        name: with its unit, e.g. "yaw_rate_radps".
        default: value when not given, or None when it must be given.
        low, high: allowed range, ends included.
        meaning: one line for the user.
    """

    name: str
    meaning: str
    default: float | None = None
    low: float = -np.inf
    high: float = np.inf


Reference = Callable[[Mapping[str, float], Array], Array]
"""(settings, time_s (k,)) -> (k, 3) wished u, v, r through water; the row at time 0 is the entry velocity."""


@dataclass(frozen=True, kw_only=True)
class Family:
    """A kind of manoeuvre.

    Attributes:
        name: as in dictionary files.
        summary: one line for the user.
        settings: its parameters; each family also has `duration_s`.
        reference: the velocities it wishes for; the builder turns them into commands within the actuators' limits.
    """

    name: str
    summary: str
    settings: tuple[Setting, ...]
    reference: Reference


@dataclass(frozen=True, kw_only=True)
class PrimitiveSpec:
    """A request for one member of a family.

    Attributes:
        name: unique in the dictionary.
        family: name of the family.
        settings: every setting of the family, by name.
    """

    name: str
    family: str
    settings: Mapping[str, float]


def complete_settings(family: Family, given: Mapping[str, float]) -> dict[str, float]:
    """All settings of a family, defaults filled in.

    Raises:
        UnknownName: a setting the family does not have.
        InputError: one is missing or out of range; the message names it.
    """
    known = {setting.name: setting for setting in family.settings}
    for name in given:
        if name not in known:
            raise UnknownName(f"setting of family {family.name!r}", name, known=known)
    values: dict[str, float] = {}
    for name, setting in known.items():
        value = given.get(name, setting.default)
        if value is None:
            raise InputError(f"{name} is missing: {setting.meaning}")
        if not setting.low <= value <= setting.high:
            raise InputError(f"{name} is {value:g}, expected {setting.low:g} to {setting.high:g}")
        values[name] = float(value)
    return values
