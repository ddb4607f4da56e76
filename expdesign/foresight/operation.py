"""Which changes of a ship in operation a watch would find, after how long, and what it would take them for.

Voyages of the vessel file are simulated with its sensors, in weather drawn from a forecast for each: speeds held for
minutes, turns now and then. A watch learns noise and unmeasured forces from a reference of such voyages. Then voyages
are watched from their beginning, without a change and with every change there from the start.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.diagnosis.model import ExtendedModel, is_coriolis, is_damping
from expdesign.diagnosis.vessel_file import extend, extended_model
from expdesign.errors import InputError
from expdesign.foresight.trial import TrialRun, simulated_record
from expdesign.memory import in_order
from expdesign.monitoring import (
    Alarm,
    Calibration,
    Change,
    Grams,
    Rules,
    State,
    calibrate,
    grams_of,
    joined,
    later_part,
    stretch_length,
    threshold,
    watch,
    watched_changes,
)
from expdesign.progress import Progress, silent
from expdesign.signals import Commands, Record
from expdesign.simulation import Environment, draw_environment
from expdesign.values import Array
from expdesign.vessel import Actuator, Vessel

SIZES = (0.02, 0.05, 0.1, 0.2)  # relative changes of the ship that are simulated
REFERENCES, REFERENCE_S = 8, 7200.0  # voyages of the reference, and their length [s]
LARGEST_ANGLE_RAD, LARGEST_TURN = 0.6, 0.3  # of rudders and azimuths on voyages, and share of the largest turning force
DAY_S, LEVEL = 86_400.0, 0.95
FALSE_ALARM_DAYS = 30.0  # average time between false alarms, at least, as `monitor` has it without an option [d]
MOST_VOYAGES = 10_000  # seeds apart between changes


@dataclass(frozen=True, kw_only=True)
class HiddenChange:
    """A way in which a ship may change in operation."""

    name: str  # in words, e.g. "more mass".
    effects: Mapping[str, float]  # effect -> value per share of the change
    right: tuple[str, ...]  # effects that name it rightly


@dataclass(frozen=True, kw_only=True)
class Watched:
    """One voyage that was watched."""

    delay_s: float | None  # from its beginning to the alarm [s]; None without one
    named: str = ""  # effect that the alarm names last; as_likely: others that explain the data as well
    as_likely: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Detectability:
    """What a watch makes of a change of some size."""

    change: str  # in words
    size: float  # share
    voyages: int  # simulated
    found: int  # of them with an alarm; named: of those found, rightly named; likely: right among what is as likely
    named: int
    likely: int
    delay_s: float  # median time to the alarm of all voyages, infinite where less than half are found [s]
    taken_for: tuple[tuple[str, int], ...]  # other changes that alarms name, most frequent first, with their numbers


@dataclass(frozen=True, kw_only=True)
class OperationForesight:
    """What a watch over a ship would find."""

    rows: tuple[Detectability, ...]  # by change and size
    voyage_s: float  # length of the voyages [s]
    nominal: int  # voyages without a change; false_alarms: of them with an alarm
    false_alarms: int
    false_alarm_days: float  # average time between false alarms that the threshold allows at most [d]
    watched: tuple[str, ...]  # changes that the reference determines well enough; not_watched: the others, in words
    not_watched: tuple[str, ...]
    reference_s: float  # length of the reference [s]


def interval(count: int, trials: int) -> tuple[float, float]:
    """Exact 95 % interval of a share.

    Source: C. J. Clopper and E. S. Pearson, Biometrika 26 (1934), 404-413.
    """
    tail = (1.0 - LEVEL) / 2.0
    low = float(scipy.special.betaincinv(count, trials - count + 1, tail)) if count else 0.0
    high = float(scipy.special.betaincinv(count + 1, trials - count, 1.0 - tail)) if count < trials else 1.0
    return low, high


def hidden_changes(ship: ExtendedModel) -> tuple[HiddenChange, ...]:
    """More inertia in yaw, more mass, more damping in each equation, less thrust."""
    model = ship.model
    found = []
    if "r" in model.outputs:
        found.append(HiddenChange(name="more inertia in yaw", effects={"inertia:r": 1.0}, right=("inertia:r",)))
    mass = tuple(f"inertia:{name}" for name in ("u", "v") if name in model.outputs)
    found.append(HiddenChange(name="more mass", effects=dict.fromkeys(mass, 1.0), right=mass))
    for name, words in (
        ("u", "more resistance ahead"),
        ("v", "more damping in sway"),
        ("r", "more damping in yaw"),
    ):
        resists = {
            f"theta:{term.name}": value
            for term, expression, value in zip(model.terms, model.expressions, model.parameters.tolist(), strict=True)
            if term.equation == name and is_damping(term, expression, model) and not is_coriolis(term) and value
        }
        if resists:
            found.append(HiddenChange(name=words, effects=resists, right=tuple(resists)))
    return (*found, HiddenChange(name="less thrust", effects={"gain": -1.0}, right=("gain",)))


def changed(vessel: Vessel, ship: ExtendedModel, change: HiddenChange, size: float) -> Vessel:
    """The vessel after a change by a share."""
    return extend(vessel, ship.with_effects({k: ship.get(k) + size * v for k, v in change.effects.items()}), {})[0]


def ordinary_orders(vessel: Vessel, samples: int, *, stretch_s: float, rng: np.random.Generator) -> Array:
    """(k, m) commands of a voyage: speeds held for one to six stretches, a third each straight and to either side."""
    table, row = np.zeros((samples, len(vessel.model.inputs))), 0
    while row < samples:
        held = max(1, round(float(rng.uniform(1.0, 6.0)) * stretch_s / vessel.sample_time_s))
        speed, side, turn = rng.uniform(0.4, 0.9), rng.choice([-1.0, 0.0, 1.0]), rng.uniform(0.1, 0.8)
        table[row : row + held] = [
            value for actuator in vessel.actuators for value in _order(actuator, float(speed), float(side * turn))
        ]
        row += held
    return table


def _order(actuator: Actuator, speed: float, turn: float) -> tuple[float, ...]:
    """Commands of one actuator, for shares of its speed and angle."""
    limits = actuator.limits
    if actuator.kind == "azimuth":
        aft = -1.0 if actuator.forward_m < 0 else 1.0
        return speed * limits[0].high, aft * turn * min(LARGEST_ANGLE_RAD, limits[1].high)
    if actuator.kind == "propeller":
        return (speed * limits[0].high,)
    if actuator.kind == "rudder":
        return (turn * min(LARGEST_ANGLE_RAD, limits[0].high),)
    if actuator.kind == "force":
        return speed * limits[0].high, 0.0, LARGEST_TURN * turn * limits[2].high
    return (0.0,)


def voyage(vessel: Vessel, forecast: Environment, *, length_s: float, seed: int) -> Record:
    """Measured data of an ordinary voyage in weather of its own."""
    rng = np.random.default_rng(seed)
    samples = round(length_s / vessel.sample_time_s)
    orders = ordinary_orders(vessel, samples, stretch_s=stretch_length(vessel.length_m), rng=rng)
    commands = Commands(sample_time_s=vessel.sample_time_s, names=vessel.model.inputs, values=orders)
    run = TrialRun(name="voyage", commands=commands, pose=np.zeros(3), velocity=np.zeros(3))
    record = simulated_record(vessel, [run], draw_environment(forecast, rng), rng)
    if vessel.model.reads_air:
        return record
    return replace(record, batches=tuple(replace(batch, wind=None) for batch in record.batches))


def watched_voyage(
    vessel: Vessel,
    forecast: Environment,
    calibration: Calibration,
    changes: tuple[Change, ...],
    limit: float,
    length_s: float,
    hidden: HiddenChange | None,
    size: float,
    seed: int,
) -> Watched:
    """A voyage of the changed ship, watched from its beginning; the watch is begun anew at every shift of the ship."""
    stretch_s = calibration.stretch_s
    true = vessel
    if hidden is not None:
        short = voyage(vessel, forecast, length_s=2.0 * stretch_s, seed=seed)
        true = changed(vessel, extended_model(vessel, short), hidden, size)
    record = voyage(true, forecast, length_s=length_s, seed=seed)
    ship = extended_model(vessel, record)

    def linearised(shift: Array, since_s: float = 0.0) -> Grams:
        effects = {
            change.effect: ship.get(change.effect) + change.size * value
            for change, value in zip(changes, shift.tolist(), strict=True)
            if value
        }
        part, begins_s = later_part(record, [0.0], since_s, stretch_s)
        return grams_of(ship.with_effects(effects), part, changes, begins_s=begins_s, stretch_s=stretch_s)

    state, alarms, first = State.begun(calibration, time_s=0.0), list[Alarm](), 0
    grams, rules = linearised(state.shift), Rules(limit=limit)
    while first < len(grams):
        part = grams.part(slice(first, None))
        state, more, _, used = watch(calibration, state, part, rules=rules, again=linearised)
        alarms, first = [*alarms, *more], first + used
        if first < len(grams):
            grams = linearised(state.shift)
    alarms += [] if state.alarm is None else [state.alarm]
    if not alarms:
        return Watched(delay_s=None)
    last = [alarm for alarm in alarms if alarm.time_s == alarms[0].time_s][-1]
    return Watched(
        delay_s=alarms[0].time_s,
        named=changes[last.change].effect,
        as_likely=tuple(changes[place].effect for place in last.as_likely),
    )


def foresee_operation(
    vessel: Vessel,
    forecast: Environment,
    *,
    voyages: int,
    hours: float = 2.0,
    sizes: Sequence[float] = SIZES,
    references: int = REFERENCES,
    seed: int = 0,
    progress: Progress = silent,
) -> OperationForesight:
    """What a watch over a ship would find, by simulated voyages.

    Args:
        forecast: weather; each voyage draws its means and how they vary.
        voyages: of each change and size, and as many without a change for each.
        hours: length of a voyage [h].
        sizes: shares of the changes.
        references: voyages of `REFERENCE_S` that the watch learns from.

    Raises:
        NotInformative: the reference has no information.
        Diverged: the ship cannot sail such voyages.
    """
    stretch_s, length_s = stretch_length(vessel.length_m), 3600.0 * hours
    parts, changes, hidden = [], tuple[Change, ...](), tuple[HiddenChange, ...]()
    for number in range(references):
        progress("sailing the reference", 0.16 * number / references)
        record = voyage(vessel, forecast, length_s=REFERENCE_S, seed=seed + 100 * MOST_VOYAGES + number)
        ship = extended_model(vessel, record)
        changes, hidden = watched_changes(ship), hidden_changes(ship)
        begin_s = 1.5 * REFERENCE_S * number
        parts.append(grams_of(ship, record, changes, begins_s=[begin_s], stretch_s=stretch_s))
    progress("learning from the reference", 0.16)
    calibration = calibrate(joined(parts))
    if not calibration.watched.any():
        raise InputError("with these sensors the reference determines no change well enough to watch for it")
    limit = threshold(int(calibration.watched.sum()), FALSE_ALARM_DAYS * DAY_S / stretch_s)
    kinds = [(item, size) for item in hidden for size in sizes]
    tasks: list[tuple[HiddenChange | None, float, int]] = [
        (item, size, seed + MOST_VOYAGES * place + number)  # the same voyages for every size
        for place, item in enumerate(hidden)
        for size in sizes
        for number in range(voyages)
    ]
    first = seed + MOST_VOYAGES * len(hidden)
    tasks += [(None, 0.0, first + number) for number in range(voyages * len(sizes))]
    found: list[Watched] = []
    for item in in_order(watched_voyage, (vessel, forecast, calibration, changes, limit, length_s), tasks):
        found.append(item)
        progress("watching voyages", 0.2 + 0.8 * len(found) / len(tasks))
    own = [found[voyages * place : voyages * (place + 1)] for place in range(len(kinds))]
    rest = found[voyages * len(kinds) :]
    words = {change.effect: change.words for change in changes}
    return OperationForesight(
        rows=tuple(_row(kind, size, part, words) for (kind, size), part in zip(kinds, own, strict=True)),
        voyage_s=length_s,
        nominal=len(rest),
        false_alarms=sum(item.delay_s is not None for item in rest),
        false_alarm_days=FALSE_ALARM_DAYS,
        watched=tuple(c.words for c, seen in zip(changes, calibration.watched, strict=True) if seen),
        not_watched=tuple(c.words for c, seen in zip(changes, calibration.watched, strict=True) if not seen),
        reference_s=references * REFERENCE_S,
    )


def _row(kind: HiddenChange, size: float, part: Sequence[Watched], words: Mapping[str, str]) -> Detectability:
    seen = [item for item in part if item.delay_s is not None]
    wrong = Counter(words[item.named] for item in seen if item.named not in kind.right)
    delays = sorted(math.inf if item.delay_s is None else item.delay_s for item in part)
    return Detectability(
        change=kind.name,
        size=size,
        voyages=len(part),
        found=len(seen),
        named=sum(item.named in kind.right for item in seen),
        likely=sum(bool({item.named, *item.as_likely} & {*kind.right}) for item in seen),
        delay_s=delays[(len(delays) - 1) // 2],
        taken_for=tuple(wrong.most_common(2)),
    )
