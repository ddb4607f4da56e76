"""A watch over a ship in operation, from piece to piece of its data."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from expdesign.errors import FileError, NotInformative
from expdesign.export.monitor_content import Moment
from expdesign.monitoring import (
    WHITE,
    Again,
    Alarm,
    Calibration,
    Change,
    Grams,
    Noise,
    RollWatch,
    Rules,
    State,
    calibrate,
    estimates,
    joined,
    roll_learnt,
    roll_watched,
    threshold,
    watch,
)
from expdesign.monitoring.calibration import KNOWN_WITHIN
from expdesign.records import STREAM, Piece, Taken
from expdesign.roll import Run
from expdesign.roll.record import NEEDED, missing_columns, roll_run, with_one_source
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import Vessel
from expdesign.workflows.steps.watched_ship import PIECE, Asked, Known, Late, Read, Unread

BETWEEN_FILES_S = 3600.0  # time from the end of a file to the beginning of the next, where its times begin again [s]
CORRECTION_S = 120.0  # time by which a clock that is put back is taken to have been corrected [s]
MOST_SAVED_ROWS = 7200  # largest number of rows saved since a change, for a diagnosis
KEPT_ROWS = 7200
"""Rows before the last piece that are kept, at least where there are so many: a change may have begun in them."""
MOST_MOMENTS = 1000  # largest number of moments kept for the page
HOUR, DAY = 3600.0, 86_400.0
MOMENT_S = 600.0  # of data between two points of the page's figures, at most


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """How far the data have been read."""

    now_s: float = -np.inf  # end of the data [s]
    offset_s: float = 0.0  # added to the times of the file, where they begin again in each file
    left_out_rows: int = 0  # that lacked a number
    unread_rows: int = 0  # in pieces that could not be read
    notes: tuple[str, ...] = ()  # on the data
    pending: tuple[str, ...] = ()  # header, and lines that do not fill a stretch
    taken: tuple[Taken, ...] = ()  # rows of every source

    def after(self, piece: Piece) -> Reading:
        """The reading after the rows of a piece."""
        others = tuple(taken for taken in self.taken if not taken.continues(piece.taken))
        before = next((taken for taken in self.taken if taken.continues(piece.taken)), piece.taken)
        last_s = piece.taken.last_s if np.isfinite(piece.taken.last_s) else before.last_s
        notes = (f"{piece.source.name}: its first {piece.skipped} rows had been watched before",) * bool(piece.skipped)
        return replace(
            self.noted(*notes),
            left_out_rows=self.left_out_rows + piece.left_out,
            pending=(piece.header, *piece.pending),
            taken=(*others, replace(piece.taken, last_s=last_s)),
        )

    def noted(self, *notes: str) -> Reading:
        """The reading with more notes; of those that differ in numbers alone, the last is kept."""
        return replace(self, notes=tuple({re.sub(r"\d+", "", text): text for text in (*self.notes, *notes)}.values()))


@dataclass(frozen=True, kw_only=True, eq=False)
class Learning:
    """While the reference lasts."""

    learnt: tuple[Grams, ...] = ()  # inner products of the reference so far
    lines: tuple[str, ...] = ()  # its header and rows, of a stream, which cannot be read again


@dataclass(frozen=True, kw_only=True, eq=False)
class Ready:
    """Calibrated, before the first stretch that is judged."""

    calibration: Calibration  # of the reference
    reference_s: float  # its end [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Watching:
    """The phase after the reference."""

    calibration: Calibration  # of the reference
    reference_s: float  # its end [s]
    state: State  # after the last stretch
    # alarms, moments: so far
    alarms: tuple[Alarm, ...] = ()
    moments: tuple[Moment, ...] = ()
    changed: tuple[str, ...] = ()  # header and lines since the last alarm's change


@dataclass(frozen=True, kw_only=True, eq=False)
class Watch:
    """Everything that goes on from piece to piece."""

    changes: tuple[Change, ...] = ()  # watched for; none before the first piece
    noise: Noise = WHITE  # within stretches, as the first piece shows
    reading: Reading = Reading()  # how far the data have been read
    phase: Learning | Ready | Watching = Learning()  # what is known of the ship
    roll: RollWatch = field(default_factory=RollWatch)  # what is known of its roll
    late: tuple[Late, ...] = ()  # the last pieces


def after_reading(now: Watch, piece: Piece, read: Read | Unread | None) -> Watch:
    """The watch at the end of a piece, before it is judged.

    Raises:
        FileError: the first piece of a source could not be read; of a later one that is noted, and the watch goes on.
    """
    before, reading = now.reading, now.reading.after(piece)
    if read is None:
        return replace(now, reading=reading)
    reading = _continued(reading, piece)
    if isinstance(read, Unread):
        error = piece.problem(FileError(piece.source, read.key, read.problem))
        if not any(taken.continues(piece.taken) for taken in before.taken):
            raise error
        rows = len(piece.lines)
        reading = replace(reading.noted(f"{rows} rows are not judged: {error}"), unread_rows=reading.unread_rows + rows)
        return replace(now, reading=reading)
    # orders that stay the same for the rows of a piece are no loss: nothing is estimated from one
    idle = () if piece.whole else read.record.idle
    remarks = [text.replace(PIECE, piece.place) for text in read.record.notes if text not in idle]
    reading = replace(reading.noted(*remarks, *read.notes), now_s=float(piece.time_s[-1]) + reading.offset_s)
    known = known_of(now) if now.changes else read.known
    return replace(now, changes=known.changes, noise=known.noise, reading=reading)


def _continued(reading: Reading, piece: Piece) -> Reading:
    """The reading with times that go on where those of the piece begin again."""
    back_s = reading.now_s - float(piece.time_s[0]) - reading.offset_s
    if not back_s >= 0.0:
        return reading
    if back_s < CORRECTION_S and any(taken.continues(piece.taken) for taken in reading.taken):
        note = f"{piece.source.name}: its clock was put back by {back_s:.0f} s or so; it is taken to go on"
        return replace(reading.noted(note), offset_s=reading.offset_s + back_s + float(np.diff(piece.time_s[:2]).sum()))
    note = f"{piece.source.name}: its times begin again; it is taken as an hour after the data before"
    offset_s = reading.now_s + BETWEEN_FILES_S - float(piece.time_s[0])
    return replace(reading.noted(note), offset_s=offset_s)


def with_piece(now: Watch, piece: Piece, read: Read | Unread | None, asked: Asked) -> Watch:
    """The watch after one more piece of the data, which may belong to the reference, to the watch, or to both."""
    now = after_reading(now, piece, read)
    if not isinstance(read, Read):
        return now
    if not isinstance(now.phase, Learning):
        return _roll_watched(now, _watched(now, piece, read, asked), piece, read, asked)
    now = with_reference(now, piece, read, asked)
    learning = now.phase
    assert isinstance(learning, Learning)
    *before, grams = learning.learnt
    first = (*before, grams)[0].time_s
    inside = int(np.searchsorted(grams.time_s, (first[0] if len(first) else 0.0) + asked.learn_s))
    now = replace(now, phase=replace(learning, learnt=(*before, grams.part(slice(0, inside)))))
    if inside == len(grams):
        return now
    return _watched(calibrated(now), piece, read, asked, first_s=float(grams.time_s[inside]))


def _roll_watched(before: Watch, now: Watch, piece: Piece, read: Read, asked: Asked) -> Watch:
    """The watch with the roll of a piece judged."""
    runs = roll_runs(read.record, asked.vessel)
    if runs is None:
        return replace(now, roll=replace(now.roll, reason=f"the data do not measure {' and '.join(NEEDED)}"))
    offset_s, calls = now.reading.offset_s, [_last_call_s(watch) for watch in (before, now)]
    begin_s, end_s = (float(piece.time_s[place]) + offset_s for place in (0, -1))
    mean_time_s = roll_days(asked) * DAY
    roll = roll_watched(
        now.roll, asked.vessel, runs, begin_s=begin_s, end_s=end_s, mean_time_s=mean_time_s,
        called=calls[0] != calls[1],
    )  # fmt: skip
    return replace(now, roll=roll)


def _last_call_s(watch: Watch) -> float | None:
    """End of the last port call."""
    load = watch.phase.state.load if isinstance(watch.phase, Watching) else None
    return load.since_s if load is not None and load.stay_s else None


def roll_runs(record: Record, ship: Vessel) -> tuple[Run, ...] | None:
    """Runs of a record with roll; None where [roll] is not in the vessel file, or not measured."""
    if ship.pendulum is None or any(missing_columns(batch) for batch in record.batches):
        return None
    return with_one_source([roll_run(batch, ship=ship) for batch in record.batches])


def roll_days(asked: Asked) -> float:
    """Average time between false alarms of roll, and of the path where roll is watched: each has a half of the rate."""
    return 2.0 * asked.false_alarm_days


def with_reference(now: Watch, piece: Piece, read: Read, asked: Asked) -> Watch:
    """The watch with a piece added to the reference."""
    assert isinstance(now.phase, Learning)
    learning = now.phase
    if (runs := roll_runs(read.record, asked.vessel)) is not None:
        now = replace(now, roll=roll_learnt(now.roll, asked.vessel, runs))
    grams = read.at(known_of(now), asked, offset_s=now.reading.offset_s)
    lines = (*(learning.lines or (piece.header,)), *piece.lines) if piece.source == STREAM else ()
    return replace(now, phase=Learning(learnt=(*learning.learnt, grams), lines=lines))


def calibrated(now: Watch) -> Watch:
    """The watch at the end of the reference, with its calibration.

    Raises:
        NotInformative: it is too short, or tells too little.
    """
    assert isinstance(now.phase, Learning)
    learnt = now.phase.learnt
    if not learnt:
        raise NotInformative("the reference has no rows")
    calibration = calibrate(joined(learnt), changes=now.changes)
    if not calibration.watched.any():
        best = int(np.argmax(calibration.rate))
        larger = KNOWN_WITHIN / np.sqrt(max(float(calibration.rate[best]) * calibration.stretches, 1e-12))
        raise NotInformative(
            f"the reference of {calibration.stretches} stretches of {calibration.stretch_s:g} s determines no change "
            "well enough to watch for it: take a longer one, or one with more manoeuvres, or watch for larger "
            f"changes, {larger:.2g} times as large at least (--size), for {now.changes[best].words}"
        )
    end_s = max((float(part.time_s[-1] + part.duration_s[-1]) for part in learnt if len(part)), default=0.0)
    return replace(now, phase=Ready(calibration=calibration, reference_s=end_s))


def rules_of(calibration: Calibration, asked: Asked) -> Rules:
    """The threshold for so many days between false alarms, and the length of port calls."""
    days = asked.false_alarm_days if asked.vessel.pendulum is None else roll_days(asked)
    limit = threshold(int(calibration.watched.sum()), days * DAY / calibration.stretch_s)
    return Rules(limit=limit, port_s=asked.port_s)


def _watched(now: Watch, piece: Piece, read: Read, asked: Asked, *, first_s: float = -np.inf) -> Watch:
    """Watch the stretches of a piece that begin at a time or later."""
    assert not isinstance(now.phase, Learning)
    calibration, offset_s = now.phase.calibration, now.reading.offset_s
    grams = read.at(known_of(now), asked, offset_s=offset_s)
    first, several = int(np.searchsorted(grams.time_s, first_s)), max(1, round(MOMENT_S / calibration.stretch_s))
    if first == len(grams):
        return now
    on = now.phase if isinstance(now.phase, Watching) else _begun(now.phase, float(grams.time_s[first]))
    raised = list[Alarm]()
    late = _latest((*now.late, Late(text=piece.text, time_s=piece.time_s, offset_s=offset_s, noise=read.noise)))
    again = _again(late, known_of(now), asked)
    while first < len(grams):
        before = on.state
        on, more, used = _moment(on, grams.part(slice(first, first + several)), rules_of(calibration, asked), again)
        raised += more
        first += used
        if on.state.shift is not before.shift and first < len(grams):
            grams = read.at(replace(known_of(now), shift=on.state.shift), asked, offset_s=offset_s)
    changed = _changed(on, piece, raised, offset_s)[: MOST_SAVED_ROWS + 1]
    return replace(now, phase=replace(on, moments=_fewer(on.moments), changed=changed), late=late)


def _again(late: Sequence[Late], known: Known, asked: Asked) -> Again:
    """Stretches of the last pieces, linearised anew."""

    @cache
    def record(number: int) -> tuple[Record, tuple[float, ...]]:
        return late[number].record(asked)

    def again(shift: Array, since_s: float) -> Grams:
        ship = replace(known, shift=shift)
        parts = [one.since(since_s, *record(number), ship, asked) for number, one in enumerate(late)]
        return joined([part for part in parts if part is not None])

    return again


def _latest(late: Sequence[Late]) -> tuple[Late, ...]:
    """The last piece, and of those before as many as `KEPT_ROWS` asks for."""
    rows = np.cumsum([len(one.time_s) for one in late[-2::-1]])
    return tuple(late[-2 - int(np.searchsorted(rows, KEPT_ROWS)) :])


def known_of(now: Watch) -> Known:
    """What inner products of the next piece are for."""
    shift = now.phase.state.shift if isinstance(now.phase, Watching) else np.zeros(len(now.changes))
    return Known(changes=now.changes, shift=shift, noise=now.noise)


def _begun(ready: Ready, time_s: float) -> Watching:
    return Watching(
        calibration=ready.calibration,
        reference_s=ready.reference_s,
        state=State.begun(ready.calibration, time_s=time_s),
    )


def _moment(on: Watching, grams: Grams, rules: Rules, again: Again) -> tuple[Watching, list[Alarm], int]:
    """Watch the stretches of one moment of the page; returns the alarms raised and the number of stretches used."""
    state, alarms, steps, used = watch(on.calibration, on.state, grams, rules=rules, again=again)
    value, std = estimates(state, on.calibration)
    statistic = max((step.statistic for step in steps if step.compared), default=0.0)
    moment = Moment(time_s=state.until_s, statistic=statistic, value=value, std=std)
    on = replace(on, state=state, alarms=(*on.alarms, *alarms), moments=(*on.moments, moment))
    return on, [alarm for alarm in alarms if not (alarm.settled or alarm.withdrawn)], used


def _changed(on: Watching, piece: Piece, raised: Sequence[Alarm], offset_s: float) -> tuple[str, ...]:
    """Header and lines since the last alarm's change; none where it was withdrawn."""
    if on.alarms and on.alarms[-1].withdrawn:
        return ()
    if raised:
        since = piece.time_s + offset_s >= raised[-1].since_s
        return (piece.header, *(line for line, late in zip(piece.lines, since, strict=True) if late))
    return (*on.changed, *piece.lines) if on.changed else ()


def _fewer(moments: Sequence[Moment]) -> tuple[Moment, ...]:
    """Two of the older moments as one, where there are many: memory does not grow with the years."""
    if len(moments) <= MOST_MOMENTS:
        return tuple(moments)
    older, newer = moments[: MOST_MOMENTS // 2], moments[MOST_MOMENTS // 2 :]
    pairs = zip(older[::2], older[1::2], strict=True)
    return (*(replace(b, statistic=max(a.statistic, b.statistic)) for a, b in pairs), *newer)
