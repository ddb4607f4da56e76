"""The search space: the settings of every family as points of the unit cube, within velocity limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.dictionary import Family, PrimitiveSpec, Setting
from expdesign.errors import InputError
from expdesign.growing.tuning import TUNING
from expdesign.simulation.helm import steady_ahead
from expdesign.values import Array
from expdesign.vessel import Vessel, direct_terms


@dataclass(frozen=True, kw_only=True, eq=False)
class Axis:
    """One searched setting.

    Attributes:
        name: of the setting.
        low, high: its range.
        scale: "linear", "log" or "whole".
    """

    name: str
    low: float
    high: float
    scale: str = "linear"

    def value(self, share: float) -> float:
        """The setting at a place from 0 to 1."""
        if self.scale == "log":
            return float(self.low * (self.high / self.low) ** share)
        value = self.low + (self.high - self.low) * share
        return float(np.floor(value)) if self.scale == "whole" else float(value)


@dataclass(frozen=True, kw_only=True, eq=False)
class FamilySpace:
    """All members of a family with one duration and within velocity limits.

    Attributes:
        family: the family.
        axes: its searched settings.
        run_s: duration of a run [s].
    """

    family: Family
    axes: tuple[Axis, ...]
    run_s: float

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

    Families with a reference motion need a model with generalised forces; families of helm orders need a helm that
    turns the ship; recorded commands are not searched.

    Raises:
        InputError: no family is left.
    """
    direct, steers = bool(direct_terms(vessel.model)), _steers(vessel, limits)
    chosen = [
        item for item in families if item.name != "recorded" and (not direct if item.reference is not None else steers)
    ]
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
    low, high, scale, helm_rad = 0.0, 1.0, "linear", float(np.radians(TUNING.helm_deg))
    if setting.searched == "surge":
        low, high = (0.0, (u_high - u_low) / 2) if "swing" in setting.name else (u_low, u_high)
    elif setting.searched in widest:
        low, high = -widest[setting.searched], widest[setting.searched]
    elif setting.searched == "time":
        low, high, scale = max(4 * vessel.sample_time_s, run_s / 40), run_s, "log"
    elif setting.searched == "helm":
        low, high = -helm_rad, helm_rad
    elif setting.searched == "heading":
        low, high, scale = (*TUNING.heading_rad, "log")
    elif setting.searched == "draw":
        low, high, scale = 0.0, float(TUNING.draws), "whole"
    low, high = max(low, setting.low), min(high, setting.high)
    if setting.searched == "share":
        low = max(low, 0.02)
    return Axis(name=setting.name, low=low, high=max(high, low + 1e-9), scale=scale)
