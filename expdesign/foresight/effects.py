"""Effects that may be hidden in a trial: one for every way in which a cause of the catalogue may act."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile

import numpy as np

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import Fit
from expdesign.diagnosis.model import ACTUATORS, ROLL, ExtendedModel, acts_on
from expdesign.diagnosis.motion import Disturbance, LinearisedMotion, disturbance_of
from expdesign.diagnosis.select import candidate_disturbances
from expdesign.diagnosis.vessel_file import public_name
from expdesign.vessel import stem


@dataclass(frozen=True, kw_only=True)
class Direction:
    """One number by which a cause may act."""

    shares: Mapping[str, float]  # effect of the extended model -> its share of the size
    fixed: Mapping[str, float] = field(default_factory=dict)  # effects that say which candidate it is

    def at(self, size: float) -> dict[str, float]:
        """Effects of the extended model at a size."""
        return {**self.fixed, **{key: size * share for key, share in self.shares.items()}}

    @property
    def key(self) -> str:
        """Its first effect."""
        return next(iter(self.shares))


@dataclass(frozen=True, kw_only=True, eq=False)
class HiddenEffect:
    """One way in which a cause may act."""

    candidate: Candidate  # of the catalogue, whose test looks for it
    directions: tuple[Direction, ...]  # its numbers; of several the worst mixture counts

    @property
    def cause(self) -> str:
        """Name in the catalogue."""
        return self.candidate.cause


def hidden_effects(candidates: Sequence[Candidate], base: Fit, windows: Windows) -> tuple[HiddenEffect, ...]:
    """The effects that these candidates look for.

    Single effects are hidden one by one, and a heavier ship as a whole. Effects that no candidate has alone, such as
    both parts of a current, are hidden in the mixture that shows least. Faults of actuators are hidden in all of a kind
    at once, changes of the ship in the middle of the trial.
    """
    alone = {(item.cause, *item.free) for item in candidates if len(item.free) == 1}
    middle = float(windows.time_s.max()) / 2.0
    found: dict[tuple[object, ...], HiddenEffect] = {}
    for item in sorted(candidates, key=lambda one: _distance(one, middle, base.ship)):
        keys = tuple(item.free)
        together = len(keys) > 1 and not any((item.cause, key) in alone for key in keys)
        heavier = item.cause == "load_change" and len(keys) == len(base.ship.model.outputs) > 1
        if not (len(keys) == 1 or together or heavier) or _is_one_of_a_kind(keys[0], base.ship):
            continue
        parts = [dict.fromkeys(keys, 1.0)] if heavier else [{key: 1.0} for key in keys]
        directions = tuple(Direction(shares=part, fixed=item.fixed) for part in parts)
        found.setdefault((item.cause, keys), HiddenEffect(candidate=item, directions=directions))
    order = {id(item): number for number, item in enumerate(candidates)}
    return tuple(sorted(found.values(), key=lambda effect: order[id(effect.candidate)]))


def _distance(item: Candidate, middle: float, ship: ExtendedModel) -> float:
    """How far a candidate's time is from the middle of the trial, or its period from a usual roll period."""
    if "change:time" in item.fixed:
        return abs(item.fixed["change:time"] - middle)
    if "roll:period" in item.fixed:
        return abs(math.log(item.fixed["roll:period"] / usual_roll_period(ship)))
    return 0.0


def usual_roll_period(ship: ExtendedModel) -> float:
    """2 C B / sqrt(GM) with C 0.4, a beam of three and a half draughts and GM a tenth of the beam [s].

    Source: IMO, Intact Stability Code (2008), 2.3, for the formula; the ratios are those of common hulls.
    """
    beam_m = 3.5 * ship.draught_m
    return 0.8 * beam_m / math.sqrt(0.1 * beam_m)


def _is_one_of_a_kind(key: str, ship: ExtendedModel) -> bool:
    """A fault of one actuator of several of the same kind."""
    group = key.partition(":")[2]
    if not acts_on(key, ACTUATORS) or group not in ship.model.inputs:
        return False
    return sum(stem(name) == stem(group) for name in ship.model.inputs) > 1


def lasting(direction: Direction) -> Direction:
    """The effect where a change of the ship has happened from the beginning."""
    fixed = {key: 0.0 if key == "change:time" else value for key, value in direction.fixed.items()}
    return replace(direction, fixed=fixed)


def disturbance_at(linear: LinearisedMotion, direction: Direction, size: float) -> Disturbance:
    """The change of rates and sensors along a path by an effect of some size, as a whole.

    A ship that is heavier by a tenth accelerates by an eleventh less: sizes that matter are not always small. A roll
    mode that the path lacks acts in proportion to its size.
    """
    if any(key in ROLL for key in direction.fixed):
        item = Candidate(cause="", free=dict.fromkeys(direction.shares, 0.0), fixed=direction.fixed)
        parts = [disturbance() for _, disturbance in candidate_disturbances(linear, item)]
        forces = [
            part.force * size * share
            for part, share in zip(parts, direction.shares.values(), strict=True)
            if part.force is not None
        ]
        return Disturbance(force=np.sum(forces, axis=0) if forces else None, sensor=None)
    ship = linear.motion.ship
    free = {key: ship.get(key) + size * share for key, share in direction.shares.items()}
    return disturbance_of(linear, ship.with_effects({**direction.fixed, **free}), 1.0)


def described(direction: Direction, ship: ExtendedModel) -> tuple[str, float, str]:
    """(name in results, change of that number per unit of size, its unit)."""
    names = [public_name(key, ship) for key in direction.shares]
    _, factor, _, unit = names[0]
    return joined([item[0] for item in names]), factor * next(iter(direction.shares.values())), unit


def joined(names: Sequence[str]) -> str:
    """Several names as one: inertia_factor_u and inertia_factor_v as inertia_factor_u/v."""
    parts = [name.split("_") for name in dict.fromkeys(names)]
    if len(parts) == 1:
        return names[0]
    front = _shared(parts)
    back = _shared([rest[front:][::-1] for rest in parts])
    middle = "/".join("_".join(rest[front : len(rest) - back]) for rest in parts)
    return "_".join([*parts[0][:front], middle, *parts[0][len(parts[0]) - back :]])


def _shared(parts: Sequence[Sequence[str]]) -> int:
    """How many words all begin with."""
    return sum(1 for _ in takewhile(lambda words: len(set(words)) == 1, zip(*parts, strict=False)))
