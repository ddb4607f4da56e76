"""What a watch takes for the ship: the vessel file's model, or a yaw model learnt from the reference."""

from __future__ import annotations

from collections.abc import Sequence

from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.errors import InputError
from expdesign.monitoring import Change, Grams, grams_of, watched_changes
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
from expdesign.records.pieces import OPTIONAL
from expdesign.signals import Record
from expdesign.vessel import Vessel

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
