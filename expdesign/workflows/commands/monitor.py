"""`expdesign monitor`: whether a ship in operation still is the ship of its model."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from expdesign import __version__, requests
from expdesign.errors import InputError, NotInformative
from expdesign.export.folder import Content, write_files
from expdesign.export.monitor_content import MonitorContent
from expdesign.export.monitor_page import budget_entries, monitor_document
from expdesign.export.monitor_results import monitor_json
from expdesign.export.pages import document_html
from expdesign.export.words import counted
from expdesign.monitoring import RollWatch
from expdesign.processes import ahead
from expdesign.progress import Progress, silent
from expdesign.records import STREAM, pieces
from expdesign.requests import repeating
from expdesign.saved import restored, saved
from expdesign.workflows.outcome import Outcome, finished, left_state, results_folder, shared, workflow
from expdesign.workflows.steps.measured import data_files, equipped
from expdesign.workflows.steps.watched_ship import Asked, Read, prepared, unread
from expdesign.workflows.steps.watching import (
    HOUR,
    Learning,
    Ready,
    Watch,
    Watching,
    after_reading,
    calibrated,
    known_of,
    rules_of,
    with_piece,
    with_reference,
)

STATE, SINCE_CHANGE = "monitor-state.json", "since-change.csv"
MOST_ROWS = 20_000  # largest number of rows in a piece of a file
WRITTEN_EVERY_S = 20.0  # time between writing files, from which a watch that is ended by force goes on [s]


@workflow
def monitor(request: requests.Monitor, *, progress: Progress = silent) -> Outcome:
    """Watch a ship in operation, into `out` or runs/<first data file>."""
    _check(request)
    folder = results_folder(request, request.data[0].stem if request.data[0] != STREAM else "monitor")
    data, reference = data_files(request.data), data_files(request.reference)
    ship, told = equipped(request.vessel, [source for source in (*reference, *data) if source != STREAM])
    asked = Asked(
        vessel=ship, told=told, size=request.size, learn_s=HOUR * request.learn_h, model=request.model,
        false_alarm_days=request.false_alarm_days, port_s=HOUR * request.port_h, velocity=request.velocity,
    )  # fmt: skip
    command = repeating(request.but(data=tuple(data), reference=tuple(reference)), keep={"out"})
    now = _resumed(folder / STATE, asked) if request.resume else _with_reference(Watch(), reference, asked, progress)
    work = _Work(asked=asked, folder=folder, command=command)
    for number, source in enumerate(data):
        rows = max(1, round(request.every_s / asked.vessel.sample_time_s)) if source == STREAM else MOST_ROWS
        with shared(request, load=None):
            now = _through(now, source, rows, work, more_follow=number + 1 == len(data), progress=progress)
    if isinstance(now.phase, Learning):
        raise NotInformative(
            f"the data end before the reference does, which takes {request.learn_h:g} h: give files of a reference "
            "(--reference) or a shorter one (--learn-h)"
        )
    if isinstance(now.phase, Ready):
        raise NotInformative("the data hold no stretch under way that can be simulated, so that nothing is judged")
    content = _content(now.phase, now, asked, command)
    _without_stale(now.phase, folder)
    return finished(request, folder, _files(content, now, asked), monitor_document(content), progress)


@dataclass(frozen=True, kw_only=True)
class _Work:
    """What is asked for, and where results go."""

    asked: Asked
    folder: Path
    command: str


def _through(now: Watch, source: Path, rows: int, work: _Work, *, more_follow: bool, progress: Progress) -> Watch:
    """Watch a whole source; the state is saved now and then, and at once when there are more alarms."""
    asked, due, done = work.asked, (0, time.monotonic() + WRITTEN_EVERY_S * (source != STREAM)), 0
    size_bytes = source.stat().st_size if source != STREAM and source.is_file() else 0
    cut = pieces(
        source, inputs=asked.vessel.model.inputs, stretch_s=asked.stretch_s, most_rows=rows,
        unread=unread(asked.model, now.changes),
        before=now.reading.pending, more_follow=more_follow, taken=now.reading.taken,
    )  # fmt: skip
    tasks = ((piece, (piece.text, piece.time_s, known_of(now))) for piece in cut)
    for piece, read in ahead(prepared, (asked,), tasks):
        now = with_piece(now, piece, read, asked)
        done += len(piece.text)
        told = now.phase.alarms if isinstance(now.phase, Watching) else ()
        alarms = len({one.time_s for one in told}) - sum(one.withdrawn for one in told)
        progress(
            f"watching {source.name}, {counted(alarms, 'alarm')}", min(done / size_bytes if size_bytes else 0.0, 0.99)
        )
        if not piece.again and (len(told), time.monotonic()) >= due:
            _save(now, source, work)
            due = (len(told), time.monotonic() + WRITTEN_EVERY_S)
    return now


def _save(now: Watch, source: Path, work: _Work) -> None:
    """Results so far; of a stream that is learnt from, the rows, as they cannot be read again."""
    if isinstance(now.phase, Watching):
        _without_stale(now.phase, work.folder)
        write_files(work.folder, _files(_content(now.phase, now, work.asked, work.command), now, work.asked))
    elif isinstance(now.phase, Ready) or source == STREAM:
        write_files(work.folder, {STATE: _state(now, work.asked)})


def _check(request: requests.Monitor) -> None:
    if STREAM in request.data and len(request.data) > 1:
        raise InputError("- stands beside other data files, expected it alone")
    if request.resume and request.reference:
        raise InputError("--resume and --reference are given, expected one: a state to go on from has its reference")
    if not 0 < request.size < 1:
        raise InputError(f"--size is {request.size:g}, expected a share between 0 and 1")
    if not request.port_h > 0:
        raise InputError(
            f"--port-h is {request.port_h:g}, expected more than 0; inf for a ship whose load never changes"
        )


def _with_reference(now: Watch, reference: Sequence[Path], asked: Asked, progress: Progress) -> Watch:
    """Calibrated on files of a reference, if there are some; the times of the data begin anew."""
    for source in reference:
        for piece in pieces(
            source,
            inputs=asked.vessel.model.inputs,
            stretch_s=asked.stretch_s,
            most_rows=MOST_ROWS,
            unread=unread(asked.model, now.changes),
        ):
            progress(f"reading the reference, {source.name}", 0.0)
            read = prepared(asked, piece.text, piece.time_s, known_of(now))
            now = after_reading(now, piece, read)
            now = with_reference(now, piece, read, asked) if isinstance(read, Read) else now
    if not reference:
        return now
    reading = replace(now.reading, now_s=-np.inf, offset_s=0.0, pending=(), taken=())
    return replace(calibrated(now), reading=reading)


def _content(phase: Watching, now: Watch, asked: Asked, command: str) -> MonitorContent:
    return MonitorContent(
        vessel=asked.vessel.name,
        changes=now.changes,
        calibration=phase.calibration,
        reference_s=phase.reference_s,
        state=phase.state,
        limit=rules_of(phase.calibration, asked).limit,
        false_alarm_days=asked.false_alarm_days,
        alarms=phase.alarms,
        moments=phase.moments,
        left_out_rows=now.reading.left_out_rows,
        unread_rows=now.reading.unread_rows,
        notes=(*asked.told, *now.reading.notes),
        command=command,
        roll=None if asked.vessel.pendulum is None else now.roll,
    )


def _files(content: MonitorContent, now: Watch, asked: Asked) -> dict[str, Content]:
    assert isinstance(now.phase, Watching)
    files: dict[str, Content] = {
        "monitor.html": partial(document_html, monitor_document(content)),
        "monitor.json": monitor_json(content, budget_entries(content)),
        STATE: _state(now, asked),
    }
    if now.phase.changed:
        files[SINCE_CHANGE] = "".join(now.phase.changed)
    return files


def _without_stale(phase: Watching, folder: Path) -> None:
    """Remove the rows of a change that no alarm stands for: of one that was withdrawn, or of an earlier watch."""
    if not phase.changed:
        (folder / SINCE_CHANGE).unlink(missing_ok=True)


def _kept(asked: Asked) -> dict[str, float]:
    """Options that a watch keeps: its statistics were compared with the threshold that follows from them."""
    return {"--false-alarm-days": asked.false_alarm_days, "--size": asked.size}


def _state(now: Watch, asked: Asked) -> str:
    """The watch as a file; one that learns goes on from its rows, as if they had not been read."""
    if isinstance(now.phase, Learning):
        lines = (*now.phase.lines, *now.reading.pending[bool(now.phase.lines) :])
        reading = replace(now.reading, pending=lines, now_s=-np.inf, offset_s=0.0)
        now = replace(now, phase=Learning(), reading=reading, roll=RollWatch())
    return json.dumps({**saved(now), "version": __version__, "options": _kept(asked)})


def _resumed(path: Path, asked: Asked) -> Watch:
    """A watch from its file.

    Raises:
        FileError: there is none, or it is of another kind or version.
        InputError: it was begun with other options.
    """

    def from_table(table: dict[str, Any]) -> tuple[Watch, dict[str, float]]:
        return restored(Watch, table), {name: float(table["options"][name]) for name in _kept(asked)}

    now, begun = left_state(path, from_table)
    for name, value in _kept(asked).items():
        if begun[name] != value:
            raise InputError(f"{name} is {value:g}, but the watch was begun with {begun[name]:g}; expected the same")
    return now
