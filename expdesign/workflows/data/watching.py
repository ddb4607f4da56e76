"""A watch over a ship in operation, from piece to piece of its data."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import NotInformative
from expdesign.export.monitor_page import Moment
from expdesign.monitoring import (
    TUNING,
    Alarm,
    Calibration,
    Change,
    Grams,
    State,
    calibrate,
    estimates,
    joined,
    stretch_length,
    threshold,
    watch,
)
from expdesign.records import Piece
from expdesign.records.file import FIRST_ROW
from expdesign.signals import Record
from expdesign.vessel import Vessel
from expdesign.workflows.data.watched_ship import VESSEL, Ship, grams, ship_and_changes, unread
from expdesign.workflows.steps.measured import measured

BETWEEN_FILES_S = 3600.0
"""From the end of a file to the beginning of the next, where that has times that begin again."""
MOST_SAVED_ROWS = 7200
"""Since a change, for a diagnosis."""
MOST_MOMENTS = 1000
"""Kept for the page."""
HOUR, DAY = 3600.0, 86_400.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Watch:
    """Everything that goes on from piece to piece.

    Attributes:
        changes: watched for; none before the first piece.
        learnt: inner products of the reference so far.
        calibration: None while the reference lasts.
        state: of the watch, None before its first piece.
        reference_s, now_s: end of the reference and of the data [s].
        alarms, moments: of the watch.
        left_out_rows: that lacked a number.
        notes: on the data.
        offset_s: added to the times of the file, where they begin again in each file.
        changed: header and lines since the last alarm's change.
        pending: header, and lines that do not fill a stretch.
    """

    changes: tuple[Change, ...] = ()
    learnt: tuple[Grams, ...] = ()
    calibration: Calibration | None = None
    state: State | None = None
    reference_s: float = 0.0
    now_s: float = -np.inf
    offset_s: float = 0.0
    alarms: tuple[Alarm, ...] = ()
    moments: tuple[Moment, ...] = ()
    left_out_rows: int = 0
    notes: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    pending: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What the user asked for.

    Attributes:
        vessel: the model.
        size: relative change that matters.
        learn_s: length of a reference at the beginning of the data [s].
        false_alarm_days: average time between false alarms [d].
        velocity: where velocities come from, as in `estimate`.
        model: one of `watched_ship.MODELS`.
    """

    vessel: Vessel
    size: float
    learn_s: float
    false_alarm_days: float
    velocity: str
    model: str = VESSEL

    @property
    def unread(self) -> tuple[str, ...]:
        """Columns that rows may lack."""
        return unread(self.model)

    @property
    def stretch_s(self) -> float:
        """Length of a stretch [s]."""
        return stretch_length(self.vessel.length_m)


def read_piece(now: Watch, piece: Piece, asked: Asked) -> tuple[Watch, tuple[Reading, ...]]:
    """A piece with its inner products, none where it has no rows, and the watch at its end."""
    now = replace(now, left_out_rows=now.left_out_rows + piece.left_out, pending=(piece.header, *piece.pending))
    if not piece.lines:
        return now, ()
    if not piece.time_s[0] + now.offset_s > now.now_s:
        note = f"{piece.source.name}: its times begin again; it is taken as an hour after the data before"
        offset_s = now.now_s + BETWEEN_FILES_S - float(piece.time_s[0])
        now = replace(now, offset_s=offset_s, notes=(note, *now.notes))
    times = piece.time_s + now.offset_s
    with piece.named():
        record = measured([piece.path], asked.vessel, velocity=asked.velocity)
    ship, changes, learnt = ship_and_changes(
        asked.model, asked.vessel, record, now.changes, size=asked.size, stretch_s=asked.stretch_s
    )
    begins = [float(times[batch.first_row - FIRST_ROW]) for batch in record.batches]
    told = [text.replace(piece.path.name, piece.source.name) for text in record.notes]
    notes = tuple({re.sub(r"\d+", "", text): text for text in (*told, *learnt, *now.notes)}.values())
    now = replace(now, changes=changes, now_s=float(times[-1]), notes=notes)
    return now, (Reading(piece=piece, ship=ship, record=record, begins_s=tuple(begins), stretch_s=asked.stretch_s),)


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """A piece of the data as a record, with the model and the time at which each batch begins."""

    piece: Piece
    ship: Ship
    record: Record
    begins_s: tuple[float, ...]
    stretch_s: float

    def grams(self, now: Watch) -> Grams:
        """Inner products, linearised at the ship as it is known to have changed."""
        shift = np.zeros(len(now.changes)) if now.state is None else now.state.shift
        effects = {
            change.effect: self.ship.get(change.effect) + change.size * value
            for change, value in zip(now.changes, shift.tolist(), strict=True)
            if value
        }
        return grams(
            self.ship.with_effects(effects), self.record, now.changes, begins_s=self.begins_s, stretch_s=self.stretch_s
        )


def with_piece(now: Watch, piece: Piece, asked: Asked) -> Watch:
    """After one more piece of the data, which may belong to the reference, to the watch, or to both."""
    now, parts = read_piece(now, piece, asked)
    for part in parts:
        if now.calibration is not None:
            return _watched(now, part, asked)
        grams = part.grams(now)
        first = (*now.learnt, grams)[0].time_s
        inside = int(np.searchsorted(grams.time_s, (first[0] if len(first) else 0.0) + asked.learn_s))
        now = replace(now, learnt=(*now.learnt, grams.part(slice(0, inside))))
        if inside < len(grams):
            return _watched(calibrated(now), part, asked, first_s=float(grams.time_s[inside]))
    return now


def calibrated(now: Watch) -> Watch:
    """At the end of the reference.

    Raises:
        NotInformative: it is too short, or tells too little.
    """
    if not now.learnt:
        raise NotInformative("the reference has no rows")
    calibration = calibrate(joined(now.learnt))
    if not calibration.watched.any():
        best = int(np.argmax(calibration.rate))
        larger = TUNING.known_within / np.sqrt(max(float(calibration.rate[best]) * calibration.stretches, 1e-12))
        raise NotInformative(
            f"the reference of {calibration.stretches} stretches of {calibration.stretch_s:g} s tells no change well "
            f"enough to watch for it: take a longer one, or one with more manoeuvres, or watch for larger changes, "
            f"{larger:.2g} times as large at least (--size), for {now.changes[best].words}"
        )
    end_s = float(now.learnt[-1].time_s[-1]) + calibration.stretch_s
    return replace(now, calibration=calibration, learnt=(), reference_s=end_s)


def limit_of(now: Watch, days: float) -> float:
    """The threshold for so many days between false alarms."""
    assert now.calibration is not None
    return threshold(int(now.calibration.watched.sum()), days * DAY / now.calibration.stretch_s)


def _watched(now: Watch, read: Reading, asked: Asked, *, first_s: float = -np.inf) -> Watch:
    """After the stretches of a piece that begin at a time or later were watched."""
    assert now.calibration is not None
    limit, hour = limit_of(now, asked.false_alarm_days), round(HOUR / now.calibration.stretch_s)
    moments, raised = list(now.moments), list[Alarm]()
    grams = read.grams(now)
    first = int(np.searchsorted(grams.time_s, first_s))
    while first < len(grams):
        state = now.state or State.begun(now.calibration, time_s=float(grams.time_s[first]))
        part = grams.part(slice(first, first + hour))
        state, alarms, steps, used = watch(now.calibration, state, part, limit=limit)
        value, std = estimates(state, now.calibration)
        statistic = max((step.statistic for step in steps), default=0.0)
        moments.append(Moment(time_s=state.judged_s, statistic=statistic, value=value, std=std))
        now = replace(now, state=state, alarms=(*now.alarms, *alarms))
        raised += [alarm for alarm in alarms if not alarm.settled]
        first += used
        if used < len(part):
            grams = read.grams(now)
    return replace(now, moments=_fewer(moments), changed=_changed(now, read.piece, raised)[: MOST_SAVED_ROWS + 1])


def _changed(now: Watch, piece: Piece, raised: Sequence[Alarm]) -> tuple[str, ...]:
    """Header and lines since the last alarm's change."""
    if raised:
        since = piece.time_s + now.offset_s >= raised[-1].since_s
        return (piece.header, *(line for line, late in zip(piece.lines, since, strict=True) if late))
    return (*now.changed, *piece.lines) if now.changed else ()


def _fewer(moments: Sequence[Moment]) -> tuple[Moment, ...]:
    """Two of the older moments as one, where there are many: memory does not grow with the years."""
    if len(moments) <= MOST_MOMENTS:
        return tuple(moments)
    older, newer = moments[: MOST_MOMENTS // 2], moments[MOST_MOMENTS // 2 :]
    pairs = zip(older[::2], older[1::2], strict=True)
    return (*(replace(b, statistic=max(a.statistic, b.statistic)) for a, b in pairs), *newer)
