"""What a watch takes for the ship, and pieces of operational data as records with their inner products."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from expdesign.diagnosis.data import has_wind
from expdesign.diagnosis.model import ExtendedModel
from expdesign.errors import FileError, InputError
from expdesign.kinematics import in_stated_time
from expdesign.monitoring import (
    WHITE,
    Change,
    Grams,
    Noise,
    grams_and_noise,
    grams_of,
    later_part,
    stretch_length,
    watched_changes,
    watched_ship,
)
from expdesign.monitoring.yaw import (
    KEY,
    YAW_MODELS,
    YawShip,
    learnt_ship,
    needed_columns,
    ship_of_changes,
    yaw_changes,
    yaw_grams,
)
from expdesign.records import as_file
from expdesign.records.file import FIRST_ROW
from expdesign.records.pieces import OPTIONAL, WIND_COLUMNS
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import Vessel
from expdesign.workflows.steps.measured import measured

VESSEL = "vessel"
YAW = {f"yaw-{name}": YAW_MODELS[name] for name in ("full", "simplified")}

Ship = ExtendedModel | YawShip


def unread(name: str, changes: Sequence[Change] = ()) -> tuple[str, ...]:
    """Columns that rows may lack; not the wind, if any is measured, where changes that are watched for act by it."""
    if name != VESSEL:
        needed = needed_columns(YAW[name])
    else:
        needed = WIND_COLUMNS if not changes or any(change.air for change in changes) else ()
    return tuple(column for column in OPTIONAL if column not in needed)


def ship_and_changes(
    name: str, vessel: Vessel, record: Record, known: Sequence[Change], *, size: float, stretch_s: float
) -> tuple[Ship, tuple[Change, ...], tuple[str, ...]]:
    """The ship of a record, the changes that are watched for, and notes on a model that is learnt from it.

    Args:
        name: "vessel" or one of `YAW`.
        record: a piece of the data.
        known: changes of earlier pieces; none for the first, which a yaw model is learnt from.
        size: relative change that matters.
        stretch_s: length of a stretch of the watch [s].

    Raises:
        InputError: changes that are known are of another model.
    """
    if known and any(change.effect.startswith(KEY) for change in known) != (name != VESSEL):
        raise InputError(f"--model is {name}, but the state to go on from is of another model; expected the same one")
    if name == VESSEL:
        ship = watched_ship(vessel, record)
        return ship, tuple(known) or watched_changes(ship, size=size, wind=has_wind(record)), ()
    model = YAW[name]
    if not known:
        learnt, notes = learnt_ship(model, vessel.model, record, stretch_s=stretch_s)
        return learnt, yaw_changes(learnt, size=size), notes
    return ship_of_changes(model, vessel.model, known), tuple(known), ()


def ship_grams(
    ship: Ship,
    record: Record,
    changes: Sequence[Change],
    *,
    begins_s: Sequence[float],
    stretch_s: float,
    known: Noise | None,
    fixed: bool = False,
) -> tuple[Grams, Noise]:
    """Inner products of all stretches of a record, and the noise within: the known one where it is fixed or fits."""
    if isinstance(ship, YawShip):
        return yaw_grams(ship, record, changes, begins_s=begins_s, stretch_s=stretch_s), WHITE
    if known is not None and fixed:
        return grams_of(ship, record, changes, begins_s=begins_s, stretch_s=stretch_s, noise=known), known
    return grams_and_noise(ship, record, changes, begins_s=begins_s, stretch_s=stretch_s, known=known)


FEWEST_LINES = 4  # fewest lines of a piece that is read
PIECE = "piece.csv"  # name of a piece as a file, in notes


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What the user asked for."""

    vessel: Vessel  # the model
    size: float  # relative change that matters
    learn_s: float  # length of a reference at the beginning of the data [s]
    false_alarm_days: float  # average time between false alarms [d]
    port_s: float  # time in port after which the ship may carry another load [s]
    velocity: str  # where velocities come from, as in `estimate`
    model: str = VESSEL  # "vessel" or one of `YAW`
    told: tuple[str, ...] = ()  # notes on the vessel, as of `equipped`

    @property
    def stretch_s(self) -> float:
        """Length of a stretch [s]."""
        return stretch_length(self.vessel.length_m)


@dataclass(frozen=True, kw_only=True, eq=False)
class Known:
    """What inner products are for."""

    changes: tuple[Change, ...] = ()  # watched for; none where they follow from the piece
    shift: Array = field(default_factory=lambda: np.zeros(0))  # (m,) by which the ship has changed, in their sizes
    noise: Noise = WHITE  # within stretches

    def same(self, other: Known) -> bool:
        """Whether the inner products are the same."""
        return (
            self.changes == other.changes and np.array_equal(self.shift, other.shift) and self.noise.same(other.noise)
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Read:
    """A piece of the data as a record."""

    record: Record  # of the piece
    begins_s: tuple[float, ...]  # time at which each batch begins, in the clock of the file [s]
    grams: Grams  # inner products, linearised at the ship with some changes; times in the clock of the file
    known: Known  # what they are for
    noise: Noise  # within their stretches
    notes: tuple[str, ...]  # on the ship

    def at(self, known: Known, asked: Asked, *, offset_s: float) -> Grams:
        """Inner products for what is known, with times that are later."""
        same = known.same(self.known)
        grams = self.grams if same else _linearised(self.record, self.begins_s, known, asked)[0]
        return replace(grams, time_s=grams.time_s + offset_s)


@dataclass(frozen=True, kw_only=True, eq=False)
class Late:
    """The rows of a piece that was watched, in which a change may have begun that is noticed later."""

    text: str  # header and rows
    time_s: Array  # (k,) of the rows [s]
    offset_s: float  # added to these times
    noise: Noise  # within the stretches

    def record(self, asked: Asked) -> tuple[Record, tuple[float, ...]]:
        """The rows as a record, and the time at which each batch begins, in the clock of the file [s]."""
        return _record_of(asked, self.text, self.time_s)

    def since(
        self, since_s: float, record: Record, begins_s: Sequence[float], known: Known, asked: Asked
    ) -> Grams | None:
        """Inner products of the stretches of its record since a time [s]; None where there are none."""
        part, begins = later_part(record, begins_s, since_s - self.offset_s, asked.stretch_s)
        if not part.batches:
            return None
        grams = _linearised(part, begins, replace(known, noise=self.noise), asked, fixed=True)[0]
        return replace(grams, time_s=grams.time_s + self.offset_s)


@dataclass(frozen=True)
class Unread:
    """A piece that could not be read: key of the error, and the problem."""

    key: str
    problem: str


def prepared(asked: Asked, text: str, time_s: Array, known: Known) -> Read | Unread | None:
    """A piece of the data, ready to be judged; None where it has no rows.

    Args:
        text: header and rows.
        time_s: (k,) of the rows [s].
    """
    if len(time_s) < FEWEST_LINES:
        return None
    try:
        record, begins = _record_of(asked, text, time_s)
    except FileError as error:
        return Unread(error.key, error.problem)
    if any(change.air for change in known.changes) and not has_wind(record):
        return Unread("wind", "is not measured, as it is in the reference; expected it in both, or in none of them")
    grams, known, noise, notes = _linearised(record, begins, known, asked)
    return Read(record=record, begins_s=begins, grams=grams, known=known, noise=noise, notes=notes)


def _record_of(asked: Asked, text: str, time_s: Array) -> tuple[Record, tuple[float, ...]]:
    """Rows as a record, and the time at which each batch begins [s]."""
    with as_file(text) as path:
        record = measured([path], asked.vessel, velocity=asked.velocity, undo=False)
        record = in_stated_time(record, asked.vessel.sensors)
    return record, tuple(float(time_s[batch.first_row - FIRST_ROW]) for batch in record.batches)


def _linearised(
    record: Record, begins_s: Sequence[float], known: Known, asked: Asked, *, fixed: bool = False
) -> tuple[Grams, Known, Noise, tuple[str, ...]]:
    """Inner products with what they are for, the noise in them, and notes on the ship.

    Where no changes are known, those of the ship of this record, and its noise. Where another noise is clear in the
    record, as in another sea, that is the one of the inner products.
    """
    ship, changes, notes = ship_and_changes(
        asked.model, asked.vessel, record, known.changes, size=asked.size, stretch_s=asked.stretch_s
    )
    first, shift = not known.changes, known.shift if known.changes else np.zeros(len(changes))
    effects = {
        change.effect: ship.get(change.effect) + change.size * value
        for change, value in zip(changes, shift.tolist(), strict=True)
        if value
    }
    grams, noise = ship_grams(
        ship.with_effects(effects), record, changes, begins_s=begins_s, stretch_s=asked.stretch_s,
        known=None if first else known.noise, fixed=fixed,
    )  # fmt: skip
    return grams, Known(changes=changes, shift=shift, noise=noise) if first else known, noise, notes
