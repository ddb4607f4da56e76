"""What a watch takes for the ship, and pieces of operational data as records with their inner products."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.errors import FileError, InputError
from expdesign.kinematics import in_stated_time
from expdesign.monitoring import Change, Grams, grams_of, stretch_length, watched_changes
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
from expdesign.records.pieces import OPTIONAL
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import Vessel
from expdesign.workflows.steps.measured import measured

# What a watch takes for the ship: the vessel file's model, or a yaw model learnt from the reference.

VESSEL = "vessel"
YAW = {f"yaw-{name}": YAW_MODELS[name] for name in ("full", "simplified")}
MODELS = (VESSEL, *YAW)
"""Values of `--model`."""

Ship = ExtendedModel | YawShip


def check_model(name: str) -> None:
    """Raise InputError for an unknown --model."""
    if name not in MODELS:
        raise InputError(f"--model is {name}, expected one of {', '.join(MODELS)}")


def unread(name: str) -> tuple[str, ...]:
    """Columns that rows may lack."""
    return tuple(column for column in OPTIONAL if name == VESSEL or column not in needed_columns(YAW[name]))


def ship_and_changes(
    name: str, vessel: Vessel, record: Record, known: Sequence[Change], *, size: float, stretch_s: float
) -> tuple[Ship, tuple[Change, ...], tuple[str, ...]]:
    """The ship of a record, the changes that are watched for, and notes on a model that is learnt from it.

    Args:
        name: one of `MODELS`.
        vessel: of the vessel file.
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
        ship = extended_model(vessel, record)
        return ship, tuple(known) or watched_changes(ship, size=size), ()
    model = YAW[name]
    if not known:
        learnt, notes = learnt_ship(model, vessel.model, record, stretch_s=stretch_s)
        return learnt, yaw_changes(learnt, size=size), notes
    return ship_of_changes(model, vessel.model, known), tuple(known), ()


def ship_grams(
    ship: Ship, record: Record, changes: Sequence[Change], *, begins_s: Sequence[float], stretch_s: float
) -> Grams:
    """Inner products of all stretches of a record."""
    if isinstance(ship, YawShip):
        return yaw_grams(ship, record, changes, begins_s=begins_s, stretch_s=stretch_s)
    return grams_of(ship, record, changes, begins_s=begins_s, stretch_s=stretch_s)


# Pieces of operational data as records with their inner products, which processes may prepare ahead of the watch.

FEWEST_LINES = 4
"""Fewest lines of a piece that is read."""
PIECE = "piece.csv"
"""Name of a piece as a file, in notes."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What the user asked for."""

    vessel: Vessel  # the model
    size: float  # relative change that matters
    learn_s: float  # length of a reference at the beginning of the data [s]
    false_alarm_days: float  # average time between false alarms [d]
    port_s: float  # time in port after which the ship may carry another load [s]
    velocity: str  # where velocities come from, as in `estimate`
    model: str = VESSEL  # one of `watched_ship.MODELS`

    @property
    def unread(self) -> tuple[str, ...]:
        """Columns that rows may lack."""
        return unread(self.model)

    @property
    def stretch_s(self) -> float:
        """Length of a stretch [s]."""
        return stretch_length(self.vessel.length_m)


@dataclass(frozen=True, kw_only=True, eq=False)
class Read:
    """A piece of the data as a record."""

    record: Record  # of the piece
    begins_s: tuple[float, ...]  # time at which each batch begins, in the clock of the file [s]
    grams: Grams  # inner products, linearised at the ship with some changes; times in the clock of the file
    changes: tuple[Change, ...]  # watched for; shift: (m,) by which the ship was changed, in their sizes
    shift: Array
    notes: tuple[str, ...]  # on the ship

    def at(self, changes: tuple[Change, ...], shift: Array, asked: Asked, *, offset_s: float) -> Grams:
        """Inner products, linearised at the ship with changes (m,), with times that are later."""
        same = changes == self.changes and np.array_equal(shift, self.shift)
        grams = self.grams if same else _linearised(self.record, self.begins_s, changes, shift, asked)[0]
        return replace(grams, time_s=grams.time_s + offset_s)


@dataclass(frozen=True)
class Unread:
    """A piece that could not be read: key of the error, and the problem."""

    key: str
    problem: str


def prepared(asked: Asked, text: str, time_s: Array, changes: tuple[Change, ...], shift: Array) -> Read | Unread | None:
    """A piece of the data, ready to be judged; None where it has no rows.

    Args:
        asked: of the command.
        text: header and rows.
        time_s: (k,) of the rows [s].
        changes: watched for; none where they follow from this piece.
        shift: (m,) by which the ship is known to have changed.
    """
    if len(time_s) < FEWEST_LINES:
        return None
    try:
        with as_file(text) as path:
            record = measured([path], asked.vessel, velocity=asked.velocity, undo=False)
            record = in_stated_time(record, asked.vessel.sensors)
    except FileError as error:
        return Unread(error.key, error.problem)
    begins = tuple(float(time_s[batch.first_row - FIRST_ROW]) for batch in record.batches)
    grams, changes, shift, notes = _linearised(record, begins, changes, shift, asked)
    return Read(record=record, begins_s=begins, grams=grams, changes=changes, shift=shift, notes=notes)


def _linearised(
    record: Record, begins_s: Sequence[float], known: tuple[Change, ...], shift: Array, asked: Asked
) -> tuple[Grams, tuple[Change, ...], Array, tuple[str, ...]]:
    """Inner products with the changes and the shift (m,) they are for, and notes on the ship.

    Where no changes are known, those of the ship of this record.
    """
    ship, changes, notes = ship_and_changes(
        asked.model, asked.vessel, record, known, size=asked.size, stretch_s=asked.stretch_s
    )
    shift = shift if known else np.zeros(len(changes))
    effects = {
        change.effect: ship.get(change.effect) + change.size * value
        for change, value in zip(changes, shift.tolist(), strict=True)
        if value
    }
    found = ship_grams(ship.with_effects(effects), record, changes, begins_s=begins_s, stretch_s=asked.stretch_s)
    return found, changes, shift, notes
