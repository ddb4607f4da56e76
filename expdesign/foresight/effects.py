"""Effects that may be hidden in a trial, one for every way in which a cause may act, and sizes at which they matter.

A size matters by what it changes in the vessel's own standard trials.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.accuracy import squared_sums
from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows, cut_windows
from expdesign.diagnosis.fit import Fit
from expdesign.diagnosis.model import ROLL, ExtendedModel
from expdesign.diagnosis.motion import (
    Disturbance,
    LinearisedMotion,
    disturbance_of,
    linearise,
    responses,
    simulate_from_measured,
)
from expdesign.diagnosis.select import candidate_disturbances
from expdesign.diagnosis.vessel_file import extend, extended_model, public_name
from expdesign.errors import InputError, NoAnswer
from expdesign.foresight.trial import exact_record
from expdesign.indices import outcomes
from expdesign.indices.outcomes import ZIGZAGS
from expdesign.memory import in_order
from expdesign.progress import Progress, silent
from expdesign.simulation import Conduct, Environment, simulate, steady_ahead, stopping, turning_circle, zigzag
from expdesign.values import Array
from expdesign.vessel import Vessel, stem
from expdesign.vessel.quantities import ACTUATORS, EFFECTS, SENSOR, WEATHER, acts_on


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


OUTCOME_SHARE = 0.05  # change of an outcome of the standard trials that matters, as a share of it
LEAST_ANGLE_RAD = 0.00873  # smallest change of an overshoot that matters: trials are read no finer
FIT_POINTS = 5.0  # loss of simulated fit that matters, mean over the outputs [points]
SIZE_ROUNDS = 4  # of the search for the size of an effect that is not proportional to its number
SIZE_REACH = 100.0  # sizes stay within this factor of the default
BEYOND_STD = 3.0  # a parameter matters from so many of its stated standard deviations on
OUTCOMES = ("advance_m", "tactical_diameter_m", "overshoot_10_10_rad", "overshoot_20_20_rad")
"""Of the standard trials, whose change matters."""
WORDS = dict(zip(OUTCOMES, ("advance", "tactical diameter", "10/10 overshoot", "20/20 overshoot"), strict=True))
PROPORTIONAL = ("theta:", "term:")  # effects in proportion to their size
NEGLIGIBLE = 1e-6  # loss of fit [points] that counts as none


@dataclass(frozen=True, kw_only=True)
class Size:
    """A size that matters."""

    value: float  # in the unit of the effect; nan where no size is known
    rule: str  # why, in words


@dataclass(frozen=True, kw_only=True, eq=False)
class StandardTrials:
    """Turning circle, zig-zags and stop of the vessel in use, without noise."""

    vessel: Vessel  # the ship
    speed_mps: float  # approach speed
    ship: ExtendedModel  # its extended model; linear: its motion in them, in the mean wind of the trial
    linear: LinearisedMotion
    deviation: Array  # (n,) sum of squares of each output about its means
    outcomes: Mapping[str, float]  # of `OUTCOMES`


def standard_trials(vessel: Vessel, weather: Environment) -> StandardTrials | None:
    """The standard trials of a vessel; None where it cannot sail them."""
    try:
        speed = float(steady_ahead(vessel).velocity[0])
        conduct = Conduct(speed_mps=speed)
        orders = {
            "turning circle": turning_circle(vessel, conduct=conduct),
            **{
                f"zig-zag {math.degrees(angle):.0f}": zigzag(vessel, heading_rad=angle, helm_rad=angle, conduct=conduct)
                for angle in ZIGZAGS
            },
            "stop": stopping(vessel, conduct=conduct),
        }
        known = outcomes(vessel, speed_mps=speed, names=OUTCOMES)
        wind = Environment(wind_to=weather.wind_to)
        runs = [
            (name, commands, simulate(vessel, commands, velocity=motion.velocity[0], environment=wind))
            for name, (commands, motion) in orders.items()
        ]
    except (InputError, NoAnswer):
        return None
    record = exact_record(runs, weather.wind_to)
    ship = extended_model(vessel, record)
    windows = cut_windows(ship.model, record)
    motion = simulate_from_measured(ship, windows)
    if motion.diverged:
        return None
    columns = [OUTPUTS.index(name) for name in ship.model.outputs]
    measured = windows.measured[..., columns]
    return StandardTrials(
        vessel=vessel,
        speed_mps=speed,
        ship=ship,
        linear=linearise(motion),
        deviation=squared_sums(np.zeros_like(measured), measured)[1].sum(axis=0),
        outcomes=known,
    )


def sizes_that_matter(
    directions: Sequence[Direction],
    trials: StandardTrials | None,
    stated_std: Mapping[str, float],
    defaults: Mapping[str, float],
    progress: Progress = silent,
) -> tuple[Size, ...]:
    """The smallest size of each effect that costs points of fit or changes an outcome of the standard trials.

    Args:
        trials: standard trials; None where there are none, so that defaults count.
        stated_std: standard deviations of effects in the vessel file; what is within them is no cause.
        defaults: size by kind of effect, where the rule gives none.
    """
    found = [_by_fit(item, trials, _default(item, defaults)) for item in directions]
    found = [_beyond_std(item, size, stated_std) for item, size in zip(directions, found, strict=True)]
    if trials is not None:
        asked = [
            (item, size.value)
            for item, size in zip(directions, found, strict=True)
            if np.isfinite(size.value)
            and size.value > _least(item, stated_std)
            and not acts_on(item.key, SENSOR, WEATHER)  # which change no motion, or that of no trial in calm water
        ]
        changes = in_order(outcome_changes, (trials.vessel, trials.speed_mps, trials.ship), asked)
        changed = {}
        for number, (item, _) in enumerate(asked):
            progress("sizes that matter", number / len(asked))
            changed[id(item)] = next(changes)
        found = [
            _smaller(size, changed.get(id(item), {}), trials) for item, size in zip(directions, found, strict=True)
        ]
    return tuple(_beyond_std(item, size, stated_std) for item, size in zip(directions, found, strict=True))


def _default(item: Direction, defaults: Mapping[str, float]) -> float:
    return defaults.get(item.key, defaults.get(item.key.split(":")[0], math.nan))


def _by_fit(item: Direction, trials: StandardTrials | None, default: float) -> Size:
    """The size that costs `FIT_POINTS` in the standard trials, else the default."""
    usual = Size(value=default, rule="default" if math.isfinite(default) else "no size is known")
    if trials is None:
        return usual
    there = lasting(item)
    size = default if math.isfinite(default) else 1.0
    for _ in range(1 if item.key.startswith(PROPORTIONAL) else SIZE_ROUNDS):
        lost = fit_loss(trials, there, size)
        if not lost > NEGLIGIBLE:
            return usual
        size *= FIT_POINTS / lost
    if math.isfinite(default) and not 1.0 / SIZE_REACH < size / default < SIZE_REACH:
        return usual
    return Size(value=size, rule=f"{FIT_POINTS:g} points of fit")


def fit_loss(trials: StandardTrials, item: Direction, size: float) -> float:
    """Loss of simulated fit [points], mean over the outputs, by an effect of some size.

    The effect is whole, the motion is linear in the forces that it changes.
    """
    answer = responses(trials.linear, [disturbance_at(trials.linear, item, size)])[0]
    columns = [OUTPUTS.index(name) for name in trials.ship.model.outputs]
    lost = (answer[..., columns] ** 2 * np.isfinite(trials.linear.motion.windows.measured[..., columns])).sum(
        axis=(0, 1)
    )
    return float(np.mean(100.0 * np.sqrt(lost / np.maximum(trials.deviation, 1e-300))))


def outcome_changes(
    vessel: Vessel, speed_mps: float, ship: ExtendedModel, item: Direction, size: float
) -> dict[str, float]:
    """Outcome -> value with an effect of some size; empty where the ship cannot sail the trials with it."""
    if any(key in ROLL for key in (*item.shares, *item.fixed)):
        return {}
    try:
        changed = with_effect(vessel, ship, lasting(item), size)
        return outcomes(changed, speed_mps=speed_mps, names=OUTCOMES)
    except (InputError, NoAnswer):
        return {}


def with_effect(vessel: Vessel, ship: ExtendedModel, item: Direction, size: float) -> Vessel:
    """The vessel with an effect of some size; one that is changed during a trial as it is after the change.

    Args:
        ship: its extended model for the records of a trial.
    """
    present = {key: ship.get(key) + value if key in item.shares else value for key, value in item.at(size).items()}
    return extend(vessel, ship.with_effects(present), {})[0]


def _smaller(size: Size, changed: Mapping[str, float], trials: StandardTrials) -> Size:
    """The size in proportion at which the outcome that changes most changes by as much as matters, where smaller."""
    most, which = 1.0, ""
    for name, value in changed.items():
        known = trials.outcomes[name]
        matters = OUTCOME_SHARE * abs(known)
        if name.endswith("_rad"):
            matters = max(matters, LEAST_ANGLE_RAD)
        ratio = abs(value - known) / matters
        most, which = (ratio, name) if ratio > most else (most, which)
    if not which:
        return size
    return Size(value=size.value / most, rule=f"{100 * OUTCOME_SHARE:g} % of the {WORDS[which]}")


def _beyond_std(item: Direction, size: Size, stated_std: Mapping[str, float]) -> Size:
    """No less than what the vessel file expects."""
    least = _least(item, stated_std)
    if not least > 0.0 or size.value >= least:
        return size
    return Size(value=least, rule=f"{BEYOND_STD:g} stated standard deviations")


def _least(item: Direction, stated_std: Mapping[str, float]) -> float:
    return BEYOND_STD * max(stated_std.get(key, 0.0) / abs(share) for key, share in item.shares.items())


def default_sizes(length_m: float, speed_mps: float) -> dict[str, float]:
    """Kind of effect -> size where the standard trials give none; times and speeds go with the ship's own.

    Args:
        length_m: of the ship [m].
        speed_mps: at which it sails [m/s].
    """
    sizes = {kind: row.size(length_m, speed_mps) for kind, row in EFFECTS.items()}
    return {kind: size for kind, size in sizes.items() if math.isfinite(size)}
