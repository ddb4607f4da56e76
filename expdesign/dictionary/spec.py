"""Manoeuvre families, requests for members of them, and the primitives that are made."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, SupportsIndex

import numpy as np

from expdesign.conventions import to_b_frame
from expdesign.errors import InputError, UnknownName
from expdesign.signals import Commands, Trajectory
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel

SEARCHED = ("", "surge", "sway", "yaw", "time", "share", "helm", "heading", "draw")
"""Kinds of searched settings: a velocity, a time within the run, a share of 1, a helm angle, a change of heading, the
number of a random draw; "" for a setting that a search leaves at its default."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One parameter of a family."""

    name: str  # with its unit, e.g. "yaw_rate_radps".
    meaning: str  # one line for the user
    default: float | None = None  # value when not given, or None when it must be given
    # low, high: allowed range, ends included
    low: float = -np.inf
    high: float = np.inf
    searched: str = ""  # one of `SEARCHED`

    def __post_init__(self) -> None:
        if self.searched not in SEARCHED:
            raise UnknownName(f"kind of searched setting {self.name}:", self.searched, known=SEARCHED[1:])


DURATION = Setting(name="duration_s", meaning="duration of one run", low=1e-3, high=1e5)
WHOLE_PERIODS = replace(DURATION, meaning="duration of one run, best a whole number of periods")
LARGEST = {"surge": 50.0, "sway": 20.0, "yaw": 5.0}
"""Kind of a velocity -> largest size that a setting of it may have [m/s, m/s, rad/s]."""


def velocity_setting(
    kind: str, name: str, meaning: str, *, default: float | None = None, signed: bool = True
) -> Setting:
    """A velocity, or the size of one; positive ahead and to starboard."""
    most = LARGEST[kind]
    return Setting(name=name, meaning=meaning, default=default, low=-most if signed else 0.0, high=most, searched=kind)


def share_setting(name: str, meaning: str, *, default: float, low: float = 0.0, high: float = 1.0) -> Setting:
    """A share of the run, or of the engine order for full ahead."""
    return Setting(name=name, meaning=meaning, default=default, low=low, high=high, searched="share")


Reference = Callable[[Mapping[str, float], Array], Array]
"""(settings, time_s (k,)) -> (k, 3) desired u, v, r through water; the first row is the entry velocity."""


@dataclass(frozen=True, kw_only=True)
class PrimitiveSpec:
    """A request for one member of a family."""

    name: str  # unique in the dictionary
    family: str  # name of the family
    settings: Mapping[str, float]  # every setting of the family, by name
    commands: Commands | None = None  # of a "recorded" primitive; None for the other families
    place: str = ""  # file and key of the request, for messages; "" when it comes from no file


@dataclass(frozen=True, kw_only=True, eq=False)
class Excitation:
    """Commands of a run, and the steady state before it."""

    velocity: Array  # (3,) u, v, r through water at the start
    inputs: Array  # (m,) commands that hold it
    commands: Array  # (k, m)


Orders = Callable[[Vessel, PrimitiveSpec], Excitation]


@dataclass(frozen=True, kw_only=True)
class Family:
    """A kind of manoeuvre, defined either by desired velocities or by commands."""

    name: str  # as in dictionary files
    summary: str  # one line for the user
    settings: tuple[Setting, ...]  # its parameters; each family also has `duration_s`
    # one of both: desired velocities, to which the builder computes commands within the actuators' limits, or commands,
    # which suit vessels with propeller and rudder, too
    reference: Reference | None = None
    orders: Orders | None = None
    # whether its commands depend on the simulated motion; its candidates are simulated one by one
    closed_loop: bool = False

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[Any, ...]:
        """Pickled by the name under which a module holds it: its function is not there any more."""
        held = getattr(sys.modules.get(self.__module__), self.name, None) is self
        return self.name if held else super().__reduce_ex__(protocol)


def motion_family(*settings: Setting) -> Callable[[Reference], Family]:
    """Makes a family of the function that states its velocities: its name, and its docstring as the summary."""
    return lambda function: _of(function, settings=settings, reference=function)


def order_family(*settings: Setting, closed_loop: bool = False) -> Callable[[Orders], Family]:
    """Makes a family of the function that states its commands, as `motion_family` does of velocities."""
    return lambda function: _of(function, settings=settings, orders=function, closed_loop=closed_loop)


def _of(function: Callable[..., object], **parts: Any) -> Family:
    """A family that stands in its module under the name of its function."""
    made = Family(name=function.__name__, summary=_summary(function), **parts)
    object.__setattr__(made, "__module__", function.__module__)
    return made


def _summary(function: Callable[..., object]) -> str:
    text = inspect.getdoc(function) or ""
    return f"{text[:1].lower()}{text[1:].removesuffix('.')}"


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


@sealed(entry_inputs="m")
class Primitive:
    """One entry of the dictionary, simulated with the nominal vessel in calm water from the origin, heading north."""

    name: str  # unique in its dictionary
    family: str  # the manoeuvre family that made it
    settings: Mapping[str, float]  # the family's parameters, units in the names
    commands: Commands  # actuator commands (k samples)
    entry_inputs: Array  # (m,) actuator commands before the run
    trajectory: Trajectory  # simulated motion, k + 1 samples; its first velocity is the entry velocity through water

    @property
    def duration_s(self) -> float:
        """Time of one run [s]."""
        return self.commands.duration_s

    @property
    def entry_velocity(self) -> Array:
        """(3,) u, v, r through water at the start."""
        return np.asarray(self.trajectory.velocity[0])

    @property
    def exit_velocity(self) -> Array:
        """(3,) u, v, r through water at the end."""
        return np.asarray(self.trajectory.velocity[-1])

    @property
    def displacement(self) -> Array:
        """(3,) forward m, starboard m, turn rad from start to end, in the start pose's frame."""
        pose = self.trajectory.pose
        return np.array([*to_b_frame(pose[-1, :2], pose[0]), pose[-1, 2] - pose[0, 2]])
