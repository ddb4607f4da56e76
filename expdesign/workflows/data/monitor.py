"""`expdesign monitor`: whether a ship in operation still is the ship of its model."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from expdesign import __version__
from expdesign.errors import FileError, InputError, NotInformative
from expdesign.export import write_files
from expdesign.export.monitor_page import (
    Moment,
    MonitorContent,
    monitor_html,
    monitor_json,
    monitor_tables,
    sentences,
)
from expdesign.export.monitor_page.content import HEADER
from expdesign.monitoring import (
    TUNING,
    restored_alarm,
    restored_calibration,
    restored_changes,
    restored_state,
    saved,
)
from expdesign.progress import Progress, silent
from expdesign.records import STREAM, pieces
from expdesign.scenario import load_vessel
from expdesign.workflows.command_text import command_text
from expdesign.workflows.data.watched_ship import VESSEL, check_model
from expdesign.workflows.data.watching import HOUR, Asked, Watch, calibrated, limit_of, read_piece, with_piece
from expdesign.workflows.outcome import Outcome, TextTable

STATE = "monitor-state.json"
MOST_ROWS = 20_000
"""Of a piece of a file."""
WRITTEN_EVERY_S = 10.0
"""Of a stream that comes faster than it was measured, time between writing its files [s]."""
USUAL = {
    "--learn-h": 24.0, "--false-alarm-days": 30.0, "--size": TUNING.relative_size, "--every-s": 3600.0,
    "--velocity": "auto", "--model": VESSEL,
}  # fmt: skip


def monitor(
    data: Sequence[Path],
    out: Path | None,
    *,
    vessel: Path,
    reference: Sequence[Path] = (),
    learn_h: float = 24.0,
    false_alarm_days: float = 30.0,
    size: float = TUNING.relative_size,
    every_s: float = 3600.0,
    velocity: str = "auto",
    model: str = VESSEL,
    resume: bool = False,
    progress: Progress = silent,
) -> Outcome:
    """Watch a ship in operation, into `out` or runs/<first data file>.

    Args:
        data: CSV files in the order of time, or `STREAM` for the standard input.
        out: folder, or None.
        vessel: the model.
        reference: files of a period in which the ship was as known; without them the first `learn_h` hours of the data.
        learn_h: see there [h].
        false_alarm_days: average time between false alarms [d].
        size: relative change of parameters, thrust and inertia that matters.
        every_s: of a stream, time between looks at it [s].
        velocity: where velocities come from, as in `estimate`.
        model: vessel, the vessel file's, or yaw-full or yaw-simplified, learnt from the reference.
        resume: go on from the state in `out`.
        progress: of the command.
    """
    numbers = {"--learn-h": learn_h, "--false-alarm-days": false_alarm_days, "--every-s": every_s}
    _check(data, reference, numbers, size, resume=resume)
    check_model(model)
    folder = out or Path("runs") / (Path(data[0]).stem if data[0] != STREAM else "monitor")
    asked = Asked(
        vessel=load_vessel(vessel), size=size, learn_s=HOUR * learn_h, false_alarm_days=false_alarm_days,
        velocity=velocity, model=model,
    )  # fmt: skip
    options = {
        "--vessel": vessel, "--reference": tuple(reference), "--learn-h": learn_h, "--velocity": velocity,
        "--false-alarm-days": false_alarm_days, "--size": size, "--every-s": every_s, "--model": model, "--out": out,
        "--resume": resume,
    }  # fmt: skip
    command = command_text("monitor", data, options, usual=USUAL)
    now = _resumed(folder / STATE) if resume else _with_reference(Watch(), reference, asked, progress)
    due = (0, 0.0)  # files of a stream are written at once when there are more alarms
    left = now.pending
    for number, source in enumerate(data):
        rows = max(1, round(every_s / asked.vessel.sample_time_s)) if source == STREAM else MOST_ROWS
        size_bytes = source.stat().st_size if source != STREAM and source.is_file() else 0
        read = 0
        for piece in pieces(
            source, inputs=asked.vessel.model.inputs, stretch_s=asked.stretch_s, most_rows=rows,
            unread=asked.unread, before=() if number else left, more_follow=number + 1 == len(data),
        ):  # fmt: skip
            now = with_piece(now, piece, asked)
            read += sum(map(len, piece.lines))
            share = (number + (read / size_bytes if size_bytes else 0.0)) / len(data)
            progress(f"watching {source.name}, {len(now.alarms)} alarms", min(share, 0.99))
            if source == STREAM and now.state is not None and (len(now.alarms), time.monotonic()) >= due:
                write_files(folder, _files(_content(now, asked, command), now))
                due = (len(now.alarms), time.monotonic() + WRITTEN_EVERY_S)
    if now.calibration is None or now.state is None:
        raise NotInformative(
            f"the data end before the reference does, which takes {learn_h:g} h: give files of a reference "
            "(--reference) or a shorter one (--learn-h)"
        )
    content = _content(now, asked, command)
    written = write_files(folder, _files(content, now))
    progress("done", 1.0)
    return Outcome(files=written, summary=_summary(content), tables=_tables(content))


def _check(
    data: Sequence[Path], reference: Sequence[Path], numbers: dict[str, float], size: float, *, resume: bool
) -> None:
    if not data:
        raise InputError("no data files are given, expected one or more CSV files, or - for the standard input")
    if STREAM in data and len(data) > 1:
        raise InputError("- stands beside other data files, expected it alone")
    if resume and reference:
        raise InputError("--resume and --reference are given, expected one: a state to go on from has its reference")
    for name, value in numbers.items():
        if not 0 < value < np.inf:
            raise InputError(f"{name} is {value:g}, expected more than 0")
    if not 0 < size < 1:
        raise InputError(f"--size is {size:g}, expected a share between 0 and 1")


def _with_reference(now: Watch, reference: Sequence[Path], asked: Asked, progress: Progress) -> Watch:
    """Calibrated on files of a reference, if there are some; the times of the data begin anew."""
    for source in reference:
        for piece in pieces(
            source, inputs=asked.vessel.model.inputs, stretch_s=asked.stretch_s, most_rows=MOST_ROWS,
            unread=asked.unread,
        ):  # fmt: skip
            progress(f"reading the reference, {source.name}", 0.0)
            now, parts = read_piece(now, piece, asked)
            now = replace(now, learnt=(*now.learnt, *(part.grams(now) for part in parts)))
    return replace(calibrated(now), now_s=-np.inf, pending=()) if reference else now


def _content(now: Watch, asked: Asked, command: str) -> MonitorContent:
    assert now.calibration is not None
    assert now.state is not None
    return MonitorContent(
        vessel=asked.vessel.name,
        changes=now.changes,
        calibration=now.calibration,
        reference_s=now.reference_s,
        state=now.state,
        limit=limit_of(now, asked.false_alarm_days),
        false_alarm_days=asked.false_alarm_days,
        alarms=now.alarms,
        moments=now.moments,
        left_out_rows=now.left_out_rows,
        notes=now.notes,
        command=command,
        version=__version__,
    )


def _files(content: MonitorContent, now: Watch) -> dict[str, str | bytes]:
    files: dict[str, str | bytes] = {
        "monitor.html": monitor_html(content),
        "monitor.json": monitor_json(content),
        STATE: json.dumps({**saved(replace(now, learnt=())), "version": __version__}),
    }
    if now.changed:
        files["since-change.csv"] = "".join(now.changed)
    return files


def _resumed(path: Path) -> Watch:
    """A watch from its file.

    Raises:
        FileError: there is none, or it is of another kind or version.
    """
    try:
        table: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if table.pop("version") != __version__:
            raise ValueError("of another version")
        moments = [
            Moment(**{**m, "value": np.array(m["value"], float), "std": np.array(m["std"], float)})
            for m in table["moments"]
        ]
        tuples = {name: tuple(table[name]) for name in ("notes", "changed", "pending")}
        return Watch(
            **{
                **table,
                **tuples,
                "changes": restored_changes(table["changes"]),
                "learnt": (),
                "calibration": restored_calibration(table["calibration"]),
                "state": restored_state(table["state"]),
                "alarms": tuple(map(restored_alarm, table["alarms"])),
                "moments": tuple(moments),
            }
        )
    except FileNotFoundError:
        raise FileError(path, "", "does not exist, expected the state that an earlier watch left") from None
    except (KeyError, TypeError, ValueError, AttributeError):
        raise FileError(path, "", f"is no state of a watch by version {__version__}, expected one") from None


def _summary(content: MonitorContent) -> dict[str, object]:
    return {
        "judged_h": content.state.judged * content.calibration.stretch_s / HOUR,
        "alarms": len(content.found),
        "remarks": list(sentences(content)),
    }


def _tables(content: MonitorContent) -> tuple[TextTable, ...]:
    told = tuple((sentence,) for sentence in sentences(content))
    return (
        TextTable(title="Is it still the ship of the reference?", header=("verdict",), rows=told),
        TextTable(title="Changes that are watched for", header=HEADER, rows=tuple(monitor_tables(content))),
    )
