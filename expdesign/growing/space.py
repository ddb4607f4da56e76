"""The search space: the settings of every family as points of the unit cube, within velocity limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from expdesign.dictionary import Family, PrimitiveSpec, Setting
from expdesign.errors import InputError
from expdesign.information import PrimitiveInformation
from expdesign.simulation.helm import steady_ahead
from expdesign.values import Array, seal
from expdesign.vessel import Vessel

DRAWS = 100_000  # random draws of a family among which the search chooses
HEADING_RAD = (0.05, 1.0)  # range of searched heading changes
HELM_DEG = 35.0  # largest searched helm angle


@dataclass(frozen=True, kw_only=True, eq=False)
class Axis:
    """One searched setting."""

    name: str  # of the setting
    # low, high: its range
    low: float
    high: float
    scale: str = "linear"  # "linear", "log" or "whole"

    def value(self, share: float) -> float:
        """The setting at a place from 0 to 1."""
        if self.scale == "log":
            return float(self.low * (self.high / self.low) ** share)
        value = self.low + (self.high - self.low) * share
        return float(np.floor(value)) if self.scale == "whole" else float(value)


@dataclass(frozen=True, kw_only=True, eq=False)
class FamilySpace:
    """All members of a family with one duration and within velocity limits."""

    family: Family  # the family
    axes: tuple[Axis, ...]  # its searched settings
    run_s: float  # duration of a run [s]

    def spec(self, point: Array) -> PrimitiveSpec:
        """The member at a point (a,) of the unit cube."""
        given = {axis.name: axis.value(float(share)) for axis, share in zip(self.axes, point, strict=True)}
        settings = {"duration_s": self.run_s, **given}
        for setting in self.family.settings:
            if setting.name not in settings:
                assert setting.default is not None  # every setting without a default is searched
                settings[setting.name] = setting.default
        return PrimitiveSpec(name=self.family.name, family=self.family.name, settings=settings)


def family_spaces(vessel: Vessel, families: tuple[Family, ...], limits: Array, run_s: float) -> tuple[FamilySpace, ...]:
    """The search spaces of the families that the vessel can run.

    Families of helm orders need a helm that turns the ship; recorded commands are not searched.

    Raises:
        InputError: no family is left.
    """
    steers = _steers(vessel, limits)
    chosen = [item for item in families if item.name != "recorded" and (item.reference is not None or steers)]
    if not chosen:
        raise InputError(f"vessel {vessel.name!r} can run no searched manoeuvre family within the limits")
    return tuple(_space(vessel, item, limits, run_s) for item in chosen)


def _steers(vessel: Vessel, limits: Array) -> bool:
    """Whether the vessel can hold a straight approach at half the largest speed and turn by its helm."""
    try:
        return limits[0, 1] > 0 and steady_ahead(vessel, float(limits[0, 1]) / 2).starboard != 0
    except InputError:
        return False


def _space(vessel: Vessel, family: Family, limits: Array, run_s: float) -> FamilySpace:
    axes = (_axis(vessel, setting, limits, run_s) for setting in family.settings if setting.searched)
    return FamilySpace(family=family, axes=tuple(axis for axis in axes if axis is not None), run_s=run_s)


def _axis(vessel: Vessel, setting: Setting, limits: Array, run_s: float) -> Axis:
    (u_low, u_high), sway, yaw = limits.tolist()
    widest = {"sway": max(map(abs, sway)), "yaw": max(map(abs, yaw))}
    low, high, scale, helm_rad = 0.0, 1.0, "linear", float(np.radians(HELM_DEG))
    if setting.searched == "surge":
        low, high = (0.0, (u_high - u_low) / 2) if "swing" in setting.name else (u_low, u_high)
    elif setting.searched in widest:
        low, high = -widest[setting.searched], widest[setting.searched]
    elif setting.searched == "time":
        low, high, scale = max(4 * vessel.sample_time_s, run_s / 40), run_s, "log"
    elif setting.searched == "helm":
        low, high = -helm_rad, helm_rad
    elif setting.searched == "heading":
        low, high, scale = (*HEADING_RAD, "log")
    elif setting.searched == "draw":
        low, high, scale = 0.0, float(DRAWS), "whole"
    low, high = max(low, setting.low), min(high, setting.high)
    if setting.searched == "share":
        low = max(low, 0.02)
    return Axis(name=setting.name, low=low, high=max(high, low + 1e-9), scale=scale)


# Settings and results of the growth of a dictionary.


@dataclass(frozen=True, kw_only=True)
class GrowSettings:
    """Settings of the search for manoeuvres that add information to a dictionary."""

    families: tuple[str, ...] = ()  # names of the searched families; () for all that the vessel can do
    rounds: int = 12  # most primitives to add
    # the search ends when no candidate found has a sensitivity above (1 + tolerance) x dimension
    tolerance: float = 0.01
    # key -> (low, high) of u [m/s], v [m/s] and r [rad/s] of an addition in calm water; without a key, the range of the
    # present dictionary
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    free_form: bool = False  # whether the commands of the best candidate are optimised
    run_s: float | None = None  # duration of an added run [s], or None for the median duration of the present runs
    pool: int = 256  # initial candidates of every family
    seed: int | None = None  # of the search; None for the command's

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise InputError(f"rounds is {self.rounds}, expected 1 or more")
        if not self.tolerance > 0:
            raise InputError(f"tolerance is {self.tolerance:g}, expected more than 0")
        if self.pool < 8:
            raise InputError(f"pool is {self.pool}, expected 8 or more")


@dataclass(frozen=True, kw_only=True)
class GrowRound:
    """One primitive that was added."""

    # name, family, settings: of the addition
    name: str
    family: str
    settings: Mapping[str, float]
    sensitivity: float  # its d = trace(B(w)^-1 B) at the optimum without it
    searched: float  # the largest d among candidates of the families, before commands were optimised
    log_det_gain: float  # increase of the optimal log det
    efficiency: float  # ratio of the new optimum to the first, determinant to the power 1/p
    excitation_condition: bool  # as in `PrimitiveInformation`


@dataclass(frozen=True, kw_only=True, eq=False)
class Growth:
    """A grown dictionary."""

    specs: tuple[PrimitiveSpec, ...]  # of the additions, in order
    information: tuple[PrimitiveInformation, ...]  # of the whole dictionary, additions last
    rounds: tuple[GrowRound, ...]  # one for each addition
    limits: Array  # (3, 2) low and high of u, v, r of all additions
    evaluated: int  # number of evaluated candidates
    dimension: int  # p, plus means with complete mean subtraction
    parameters: int  # p
    best_left: float  # largest sensitivity found at the end

    def __post_init__(self) -> None:
        seal(self, limits="3 2")

    @property
    def efficiency_left(self) -> float:
        """Least efficiency against any design over the evaluated candidates: exp(-(d - dimension) / p).

        Other manoeuvres may be more informative.
        """
        return float(np.exp(-max(self.best_left - self.dimension, 0.0) / self.parameters))
