"""`expdesign watch-steps`: a step trial while it is sailed, or a record of one that was broken off."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from expdesign import __version__, requests
from expdesign.errors import FileError, NotInformative
from expdesign.export.document import Document, tabled
from expdesign.export.document import Table as TextTable
from expdesign.export.folder import write_files
from expdesign.export.step_trial_page import (
    TO_DO_HEADER,
    LiveContent,
    event_line,
    live_json,
    live_sentences,
    to_do_csv,
    to_do_table,
)
from expdesign.progress import Progress, silent
from expdesign.records import STREAM, Piece, Taken, check_limits, column_limits, pieces
from expdesign.records.file import Inputs, Table, choose_columns
from expdesign.requests import repeating
from expdesign.saved import restored, saved
from expdesign.step_trials import controls_of
from expdesign.step_trials.live import Row, Setup, State, StepList, after_row, beginning, expected_constants
from expdesign.vessel import Actuator, Limit, column_name
from expdesign.workflows.outcome import Outcome, Told, finished, left_state, results_folder, silently, workflow
from expdesign.workflows.steps.measured import equipped
from expdesign.workflows.steps.step_list import listed_steps

STATE = "watch-steps-state.json"
TO_DO = "steps-to-do.csv"
LEARN_S, LEARN_SHARE = 120.0, 0.8
"""Time of the first hold from which the noise is learnt [s], and its largest share of the planned one."""
WRITTEN_EVERY_S = 20.0  # time between writing the state where nothing happens [s]
READ = ("u_mps", "r_radps")
COMPARED_ROWS = 50  # first rows, whose inputs are compared with the limits of the vessel file


@dataclass(frozen=True, kw_only=True)
class _Work:
    """What is asked for, and where results go."""

    setup: Setup
    folder: Path
    command: str
    actuators: tuple[Actuator, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Watch:
    """What goes on from row to row."""

    state: State  # of the trial
    taken: tuple[Taken, ...] = ()  # rows of every source
    notes: tuple[str, ...] = ()  # on the data
    events: int = 0  # told so far


@workflow
def watch_steps(request: requests.WatchSteps, *, tell: Told = silently, progress: Progress = silent) -> Outcome:
    """Tell when each step of a trial is over and which is next, and write what is left, into `out` or runs/<data file>.

    Raises:
        InputError: arguments or files that are wrong.
        NotInformative: the data hold no step of the list.
    """
    folder = results_folder(request, "watch-steps" if request.data == STREAM else request.data.stem)
    ship, told = equipped(request.vessel, [] if request.data == STREAM else [request.data])
    controls = controls_of(ship.model.inputs, request.throttle, request.rudder)
    wanted = listed_steps(request.steps, ship.model.inputs, controls, ship)
    learnt_s = min(LEARN_S, LEARN_SHARE * wanted.first_s) if request.learn_s is None else request.learn_s
    setup = Setup(steps=wanted, constants_s=expected_constants(ship, wanted), learn_s=learnt_s, seed=request.seed)
    command = repeating(request, keep={"out"})
    work = _Work(setup=setup, folder=folder, command=command, actuators=ship.model.actuators)
    now = _resumed(folder / STATE, wanted) if request.resume else _Watch(state=beginning(setup))
    now = replace(now, notes=tuple(dict.fromkeys((*told, *now.notes))))
    now = _through(now, request.data, work, tell, progress)
    _check_learnt(now.state, setup)
    content = _content(now, work)
    return finished(request, folder, _files(now, work), _document(content), progress)


def _through(now: _Watch, data: Path, work: _Work, tell: Told, progress: Progress) -> _Watch:
    """Watch all rows of a source; the state is written at every event, and now and then between."""
    due = time.monotonic() + WRITTEN_EVERY_S
    size = data.stat().st_size if data != STREAM and data.is_file() else 0
    done, columns = 0, None
    for piece in pieces(
        data, inputs=work.setup.steps.names, stretch_s=math.ulp(0.0), most_rows=1, more_follow=True, taken=now.taken
    ):
        columns = columns or _Columns(data, piece, work.setup.steps, column_limits(work.actuators))
        events_before = now.events
        for row in columns.rows(piece):
            state, events = after_row(now.state, row, work.setup)
            for event in events:
                tell(event_line(event, work.setup.steps))
            now = replace(now, state=state, events=now.events + len(events))
        now = _read(now, piece, columns)
        done += len(piece.text)
        if size:
            progress(f"watching {data.name}", min(done / size, 0.99))
        if now.events > events_before or time.monotonic() >= due:
            write_files(work.folder, _files(now, work))
            due = time.monotonic() + WRITTEN_EVERY_S
    return now


def _read(now: _Watch, piece: Piece, columns: _Columns) -> _Watch:
    others = tuple(taken for taken in now.taken if not taken.continues(piece.taken))
    before = next((taken for taken in now.taken if taken.continues(piece.taken)), piece.taken)
    last_s = piece.taken.last_s if math.isfinite(piece.taken.last_s) else before.last_s
    skipped = (f"{piece.source.name}: its first {piece.skipped} rows had been watched before",) * bool(piece.skipped)
    left_out = (f"{piece.source.name}: rows that lack a number were left out",) * bool(piece.left_out)
    notes = tuple(dict.fromkeys((*now.notes, *columns.notes, *skipped, *left_out)))
    return replace(now, taken=(*others, replace(piece.taken, last_s=last_s)), notes=notes)


class _Columns:
    """Where time, motion and commands stand in the rows of a source."""

    def __init__(self, path: Path, piece: Piece, steps: StepList, limits: Mapping[str, Limit]) -> None:
        names = tuple(name.strip() for name in piece.header.rstrip("\r\n").split(","))
        inputs = Inputs(tuple(column_name(name) for name in steps.names), "the vessel")
        chosen, notes = choose_columns(path, names, inputs=inputs)
        if missing := [name for name in READ if name not in chosen]:
            raise FileError(
                path, "row 1", f"names no {' '.join(missing)}, expected measured speed and yaw rate in every row"
            )
        self.path, self.notes = path, tuple(f"{path.name}: {note}" for note in notes)
        self.time, self.u, self.r = chosen["time_s"], chosen["u_mps"], chosen["r_radps"]
        self.v = chosen.get("v_mps")
        self.inputs = [chosen[name] for name in inputs.columns]
        self.limits, self.first = limits, list[Row]()

    def rows(self, piece: Piece) -> Iterator[Row]:
        """Samples of a piece."""
        for line in piece.lines:
            cells = line.rstrip("\r\n").split(",")
            row = Row(
                time_s=self._value(cells, self.time),
                motion=(
                    self._value(cells, self.u),
                    math.nan if self.v is None else self._value(cells, self.v),
                    self._value(cells, self.r),
                ),
                inputs=tuple(self._value(cells, source) for source in self.inputs),
            )
            self._compare(row)
            yield row

    def _compare(self, row: Row) -> None:
        """Compare the inputs of the first rows with their limits, once there are enough of them."""
        self.first.append(row)
        if len(self.first) != COMPARED_ROWS:
            return
        values = np.array([row.inputs for row in self.first]).T
        columns = {source.name: own for source, own in zip(self.inputs, values, strict=True)}
        table = Table(
            path=self.path, header=(), columns={"time_s": np.array([row.time_s for row in self.first]), **columns},
            sources={source.name: source for source in self.inputs},
        )  # fmt: skip
        self.notes += tuple(f"{self.path.name}: {note}" for note in check_limits(table, self.limits).notes)

    def _value(self, cells: Sequence[str], source: Any) -> float:
        text = cells[source.column] if source.column < len(cells) else ""
        try:
            value = source.factor * float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise FileError(self.path, source.header, f"is {text!r}, expected a number")
        return float(value)


def _check_learnt(state: State, setup: Setup) -> None:
    """Raise where the data gave nothing."""
    steps = setup.steps
    if state.tests is None:
        raise NotInformative(
            f"the data never hold {_commands(steps)} for {setup.learn_s:g} s without a gap, from which the noise is "
            "learnt: begin with the first commands of the list, or give a shorter --learn-s"
        )
    untouched = not state.finished and not state.left_out and not any(step.attempts for step in state.left)
    if untouched and (state.held is None or state.held.step is None):
        raise NotInformative(
            f"the data hold no step of the list, which begins with {_commands(steps)}; expected commands that change "
            "from one row of the list to the next"
        )


def _commands(steps: StepList) -> str:
    return ", ".join(f"{column_name(name)} = {value:.4g}" for name, value in zip(steps.names, steps.start, strict=True))


def _content(now: _Watch, work: _Work) -> LiveContent:
    return LiveContent(
        steps=work.setup.steps, state=now.state, constants_s=work.setup.constants_s, notes=now.notes,
        command=work.command,
    )  # fmt: skip


def _files(now: _Watch, work: _Work) -> dict[str, str | bytes]:
    content = _content(now, work)
    return {
        TO_DO: to_do_csv(content),
        "watch-steps.json": live_json(content),
        STATE: json.dumps({**saved(now), "steps": saved(work.setup.steps), "version": __version__}),
    }


def _resumed(path: Path, steps: StepList) -> _Watch:
    """A watch from its file.

    Raises:
        FileError: there is none, or it is of another kind, version or list.
    """

    def from_table(table: dict[str, Any]) -> _Watch:
        if table["steps"] != json.loads(json.dumps(saved(steps))):
            raise FileError(path, "steps", "are of another list, expected that of --steps")
        return restored(_Watch, table)

    return left_state(path, from_table)


def _document(content: LiveContent) -> Document:
    state, found = content.state, live_sentences(content)
    facts = {
        "steps": len(content.steps.steps),
        "steps_that_count": len(state.finished),
        "steps_to_do": [step.number for step in state.left],
        "steps_left_out": [step.number for step in state.left_out],
    }
    to_do = TextTable(title="Still to be sailed", header=TO_DO_HEADER, rows=tuple(to_do_table(content)))
    return Document(
        findings=tuple(found), facts=facts, sections=tabled(*([to_do] if state.left else [])), notes=content.notes
    )
