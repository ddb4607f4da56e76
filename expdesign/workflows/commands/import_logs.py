"""`expdesign import`: logs as they are recorded become runs that the other commands read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from expdesign import requests
from expdesign.assessment import to_fix
from expdesign.conventions import OUTPUTS, whole_turns
from expdesign.errors import FileError, InputError, NoAnswer
from expdesign.export.folder import Content, write_files
from expdesign.export.import_page import (
    VESSEL,
    ImportContent,
    earlier_files,
    import_document,
    import_json,
    instruments_toml,
    mapping_toml,
)
from expdesign.export.pages import document_html
from expdesign.export.routes import read_plan
from expdesign.importing import (
    COMPUTER,
    GNSS,
    NONE,
    OWN,
    Channel,
    FileClock,
    Log,
    NothingToWrite,
    Run,
    Sampled,
    bow_signals,
    cut,
    cut_by_plan,
    family,
    file_name,
    fitted,
    followed,
    guess,
    inputs_of,
    joined,
    lag_of,
    length_of_speed_m,
    presumed,
    read_log,
    sampled,
    sensor_keys,
    sides,
    typical_length_m,
    zone_lag_of,
)
from expdesign.importing.mapping import SOG
from expdesign.importing.mapping import Mapping as Decisions
from expdesign.kinematics import checked
from expdesign.progress import Progress, silent, within
from expdesign.records import load_records, mirrored_heading
from expdesign.reduction import reduced
from expdesign.requests import repeating
from expdesign.scenario import INSTRUMENTS, load_mapping, load_vessel
from expdesign.signals import Batch, Record
from expdesign.values import closed
from expdesign.vessel import Vessel
from expdesign.workflows.outcome import Outcome, results_folder, workflow

TRUSTED = (GNSS, COMPUTER, OWN, NONE)
MOST_COMPARED = 200_000
"""Rows in which instruments are compared with each other: more tell nothing new, and would fill the memory."""
WRITTEN_AT_ONCE = 20_000  # rows
MOVED = 3.0  # standard errors from which a computer's clock is set by what another file saw
FORMATS = {"time_s": "%.6f", "lat_deg": "%.9f", "lon_deg": "%.9f"}
PRESUMED = (
    ("what the vessel file's model gives", "what a ship of her kind would do"),
    ("than the vessel file's model gives", "than a ship of her kind would"),
    (", or a sign wrong in [model.parameters]?", "?"),
)
"""Words about a vessel file, and what is said where there is none."""
OF_FRAMES = ("north_m and east_m are metres from",)
FIRST = ("time_s", "lat_deg", "lon_deg", "north_m", "east_m", "heading_rad", "u_mps", "v_mps", "r_radps")


@workflow
def import_logs(request: requests.Import, *, progress: Progress = silent) -> Outcome:
    """Runs as CSV files, the mapping, and a page, into `out` or runs/<first log>-runs.

    Raises:
        InputError: arguments or files that are wrong.
        NoAnswer: the logs hold nothing that makes a record.
    """
    folder = results_folder(request, f"{request.logs[0].stem}-runs")
    names = [path.name for path in request.logs]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise InputError(f"two logs are named {twice}, expected names that differ, as the mapping calls logs by them")
    ship = None if request.vessel is None else load_vessel(request.vessel)
    given = None if request.map_file is None else load_mapping(request.map_file)
    track = None if request.plan is None else read_plan(request.plan)
    rates = {} if given is None else {clock.file: clock.sample_time_s for clock in given.files}
    read: list[Log] = []
    for k, path in enumerate(request.logs):
        progress(f"reading {path.name}", 0.6 * k / len(request.logs))
        beside = sum(log.size for log in read)
        read.append(read_log(path, sample_time_s=rates.get(path.name, 0.0), beside=beside))
    read = joined(read, apart=rates)
    mapping = (
        guess(read, () if ship is None else ship.actuators)
        if given is None
        else _checked(given, read, request.map_file)
    )
    mapping = replace(
        mapping,
        sample_time_s=request.sample_time_s or mapping.sample_time_s,
        length_m=request.length_m or mapping.length_m or (ship.length_m if ship is not None else 0.0),
    )
    notes = [f"{log.source}: {note}" for log in read for note in log.notes]
    used = {use.file for use in mapping.uses if use.column}
    notes += [
        f"{log.source}: nothing of it is used: its channels are none that are read, or those of other logs"
        for log in read if log.channels and log.source not in used
    ]  # fmt: skip
    command = repeating(request, keep={"out"})
    try:
        columns = _columns(read, mapping)
        read = [log.without_readings() for log in read]
        progress("setting clocks", 0.62)
        mapping, table, more = _one_time_scale(read, columns, mapping, given is not None)
        del columns
        notes += more
        progress("resampling", 0.66)
        found = sampled(table, mapping)
    except NothingToWrite as error:
        _leave_mapping(error, folder, mapping, read, notes, command)
        raise
    notes += found.notes
    answers, sensors = followed(table), sensor_keys(found)
    found = replace(found, channels={})
    del table  # readings are not needed any more, and a day of them is large
    size_m = mapping.length_m or typical_length_m(found.stretches)
    runs, more = _runs(found, track, size_m)
    notes += more
    progress("checking the runs", 0.75)
    with TemporaryDirectory(prefix="expdesign-") as scratch:
        within_s = within(progress, 0.75, 0.95)
        tables, kept, rejected, record, more = _tried(runs, found, ship, mapping, size_m, Path(scratch), within_s)
        notes += more
        if not kept:
            places: dict[str, list[str]] = {}
            for where, reason in rejected:
                places.setdefault(reason, []).append(where)
            why = "; ".join(
                f"{at[0]}{f' and {len(at) - 1} more' if len(at) > 1 else ''}: {reason}" for reason, at in places.items()
            )
            why = f"{why}{_turned_over(why)}" if why else "no helm or engine order acts in it"
            none = NothingToWrite(f"no run of the record can be used. {why}")
            _leave_mapping(none, folder, mapping, read, notes, command)
            raise none
        estimates, more = _estimates(request, ship, record)
        notes += more
        content = ImportContent(
            logs=tuple(read), mapping=mapping, sampled=found, runs=tuple(kept), files=tuple(tables),
            rejected=tuple(rejected), followed=answers, sensors=sensors, notes=tuple(notes),
            origin_s=_origin_s(found), dated=any(log.clock in (GNSS, COMPUTER) for log in read), command=command,
            estimates=estimates,
        )  # fmt: skip
        progress("writing", 0.95)
        document = import_document(content, folder)
        files: dict[str, Content] = {
            **tables,
            "mapping.toml": mapping_toml(mapping, read, command=command),
            INSTRUMENTS: instruments_toml(content),
            "import.json": import_json(content),
            "import.html": partial(document_html, document),
        }
        before = earlier_files(folder)
        written = write_files(folder, files)
    for name in before - set(files):
        with suppress(OSError):
            (folder / name).unlink()
    progress("done", 1.0)
    return Outcome(files=written, document=document)


def _checked(mapping: Decisions, logs: Sequence[Log], path: Path | None) -> Decisions:
    """The mapping, all of whose channels are there; those it does not name are not used."""
    assert path is not None
    there = {log.source: [channel.name for channel in log.channels] for log in logs}
    for number, clock in enumerate(mapping.files, start=1):
        if clock.file not in there:
            raise FileError(path, f"file[{number}].name", f"is {clock.file!r}, expected one of {', '.join(there)}")
    for number, use in enumerate(mapping.uses, start=1):
        if use.file not in there:
            raise FileError(path, f"channel[{number}].file", f"is {use.file!r}, expected one of {', '.join(there)}")
        if use.channel not in there[use.file]:
            listed = ", ".join(there[use.file][:12]) or "no channel with a time"
            raise FileError(
                path, f"channel[{number}].channel", f"is {use.channel!r}, which {use.file} has not; it has {listed}"
            )
    named = {(use.file, use.channel) for use in mapping.uses}
    rest = [
        replace(mapping.uses[0], file=log.source, channel=channel.name, column="", unit="", scale=1.0, offset=0.0,
                why="the mapping does not name it")
        for log in logs for channel in log.channels if (log.source, channel.name) not in named
    ]  # fmt: skip
    return replace(mapping, uses=(*mapping.uses, *rest))


def _columns(logs: Sequence[Log], mapping: Decisions) -> dict[str, dict[str, Channel]]:
    """File -> column -> channel in the column's unit."""
    table = {(channel.source, channel.name): channel for log in logs for channel in log.channels}
    found: dict[str, dict[str, Channel]] = {log.source: {} for log in logs}
    for use in mapping.uses:
        if use.column:
            found[use.file][use.column] = use.applied(table[use.file, use.channel])
    if not any(found.values()):
        names = ", ".join(channel.name for log in logs for channel in log.channels) or "none"
        raise NothingToWrite(
            f"no channel is a quantity that is read, so that there is no record to write; channels are {names[:400]}"
        )
    return found


def _one_time_scale(
    logs: Sequence[Log], columns: Mapping[str, Mapping[str, Channel]], mapping: Decisions, stated: bool
) -> tuple[Decisions, dict[str, Channel], list[str]]:
    """The mapping with clocks, all columns on the most trusted clock, and notes on what was moved."""
    clocks = {clock.file: clock for clock in mapping.files}
    speeds = [own[name].values for own in columns.values() for name in (SOG, "u_mps") if name in own]
    typical_m = length_of_speed_m(np.concatenate(speeds) if speeds else np.zeros(0))
    length_m = (mapping.length_m, 0.0) if mapping.length_m else (typical_m, typical_m)
    order = sorted(logs, key=lambda log: TRUSTED.index(log.clock))
    table: dict[str, Channel] = {}
    notes = []
    placed = [log for log in order if log.clock != NONE or not columns[log.source]]
    if not placed or not any(columns[log.source] for log in placed):
        names = ", ".join(log.source for log in order)
        raise NothingToWrite(
            f"{names}: rows have no clock, so that they are no record; where they are evenly spaced, give "
            "sample_time_s under [[file]] in the mapping"
        )
    for log in order:
        if log not in placed:
            notes.append(
                f"{log.source}: not used, as its rows have no clock (sample_time_s under [[file]] in the mapping)"
            )
            continue
        own, clock = columns[log.source], clocks.get(log.source, FileClock(file=log.source))
        if table and own and not (stated and log.source in clocks):
            near = log.clock != OWN and order[0].clock != OWN
            lag = lag_of(own, table, near=near, length_m=length_m)
            zone = zone_lag_of(own, table, length_m=length_m) if lag is None and near else None
            if zone is not None:
                lag, what = zone
                notes.append(f"{log.source}: its clock is {what}")
                near = False
            if lag is None and not near:
                raise NothingToWrite(
                    f"{log.source} has {log.clock} and saw nothing that another log saw (turn, speed, roll, rudder), "
                    f"so that its times cannot be set: expected offset_s under [[file]] in the mapping"
                )
            if lag is None:
                notes.append(f"{log.source}: {log.clock}, taken as it stands: nothing that both logs saw checks it")
            elif not near or abs(lag.offset_s) > MOVED * lag.std_s:
                words = f"{lag.offset_s:.3f} \N{PLUS-MINUS SIGN} {lag.std_s:.2g} s are added to its times, by {lag.by}"
                notes.append(f"{log.source}: {words}, which both saw ({lag.explained:.0%} explained)")
                clock = replace(clock, offset_s=round(lag.offset_s, 4), offset_std_s=float(f"{lag.std_s:.2g}"))
            else:
                notes.append(f"{log.source}: its clock agrees with the others within {lag.std_s:.2g} s, by {lag.by}")
        elif clock.offset_s:
            notes.append(f"{log.source}: {clock.offset_s:g} s are added to its times, as the mapping says")
        elif not table:
            notes.append(f"times are those of {log.source}: {log.clock}")
        clocks[log.source] = clock
        table |= {name: channel for name, channel in _moved(own, clock.offset_s).items() if name not in table}
    return replace(mapping, files=tuple(clocks[log.source] for log in logs)), table, notes


def _moved(own: Mapping[str, Channel], offset_s: float) -> dict[str, Channel]:
    """Channels at later times; those that share times go on to."""
    if not offset_s:
        return dict(own)
    times = {id(channel.time_s): channel.time_s for channel in own.values()}
    later = {key: closed(time_s + offset_s) for key, time_s in times.items()}
    return {name: replace(channel, time_s=later[id(channel.time_s)]) for name, channel in own.items()}


def _leave_mapping(
    error: NothingToWrite, folder: Path, mapping: Decisions, logs: Sequence[Log], notes: Sequence[str], command: str
) -> None:
    """The mapping beside a refusal, to be edited, and what was read in notes."""
    for note in notes:
        error.add_note(note)
    for log in logs:
        if log.unused:
            error.add_note(f"{log.source}: not used: {', '.join(log.unused)}")
    for use in mapping.uses:
        if use.column:
            error.add_note(f"{use.file}: {use.channel} is {use.column} in {use.unit or 'its unit'} ({use.why})")
    (path,) = write_files(folder, {"mapping.toml": mapping_toml(mapping, logs, command=command)})
    error.add_note(f"the mapping so far is {path}: change it, and give it as --map")


def _runs(found: Sampled, track: object, length_m: float) -> tuple[list[Run], list[str]]:
    if track is None:
        return cut(found, length_m=length_m), []
    legs = [(leg.name, leg.first, leg.last) for leg in track.legs if leg.kind == "primitive"]  # type: ignore[attr-defined]
    runs, words = cut_by_plan(found, track.commands, legs, length_m=length_m)  # type: ignore[attr-defined]
    if not runs:
        raise NothingToWrite(words)
    return runs, [words]


def _tried(
    runs: Sequence[Run], found: Sampled, ship: Vessel | None, mapping: Decisions, length_m: float, scratch: Path,
    progress: Progress,
) -> tuple[dict[str, Path], list[Run], list[tuple[str, str]], Record, list[str]]:  # fmt: skip
    """The runs' files as other commands accept them, these runs with families, those refused, the data, and notes."""
    notes: list[str] = []
    if not runs:
        return {}, [], [], Record(batches=()), []
    if not inputs_of(runs[0].stretch.columns):
        kept = [replace(run, name="track") for run in runs]
        tracks = {
            file_name(k, run): _written(scratch / f"run {k}.csv", run, found) for k, run in enumerate(kept, start=1)
        }
        notes.append(
            "no channel is an order or a position of a rudder or a propeller: the track is written as it is, and "
            "estimate and diagnose need such inputs"
        )
        return tracks, kept, [], Record(batches=()), notes
    taken = ship
    if ship is None:
        bow = bow_signals(mapping)
        taken = presumed(
            [run.stretch for run in runs], length_m=length_m, sample_time_s=found.sample_time_s, bow=bow,
            sides=sides(mapping),
        )  # fmt: skip
    assert taken is not None
    batches: list[Batch] = []
    kept, refused = [], []
    tables: dict[str, Path] = {}
    said: dict[str, list[str]] = {}
    outputs = OUTPUTS if "heading_rad" in runs[0].stretch.columns else ()
    rows = sum(len(run.stretch) for run in runs)
    share, compared = min(1.0, MOST_COMPARED / rows), 0
    for k, run in enumerate(runs, start=1):
        progress(f"checking run {k} of {len(runs)}", k / (len(runs) + 1))
        path = _written(scratch / f"run {k}.csv", run, found)
        begins = run.stretch.time_s[0] - _origin_s(found)
        try:
            record = load_records(
                path, vessel_inputs=taken.model.inputs, heading_std_rad=taken.sensors.heading_rad or None,
                outputs=outputs, actuators=taken.model.actuators if ship is not None else (),
            )  # fmt: skip
        except (FileError, InputError) as error:
            what = f"{error.key} {error.problem}" if isinstance(error, FileError) else str(error)
            refused.append((f"from {begins:.0f} s on, {len(run.stretch) * found.sample_time_s:.0f} s", what.strip()))
            continue
        kept.append(replace(run, family=run.name or family(taken, record.batches[0])))
        name = file_name(len(kept), kept[-1])
        tables[name] = path
        if len(kept) * share >= compared + 1 or not batches:
            compared += 1
            batches += [replace(batch, name=batch.name.replace(path.name, name)) for batch in record.batches]
        for line in record.notes:
            if not (note := line.partition(": ")[2]).startswith(OF_FRAMES):
                said.setdefault(note, []).append(name)
    if compared < len(kept):
        notes.append(
            f"instruments are compared with each other in {compared} of {len(kept)} runs, evenly over the log, as "
            f"its {rows} rows are more than are needed"
        )
    whole = Record(batches=tuple(batches))
    if batches:
        poses = [batch.pose for batch in batches if batch.pose is not None]
        if how := mirrored_heading(poses, found.sample_time_s):
            why = f"heading_rad: {how}, as the positions show; expected clockwise from north"
            return {}, [], [("in all runs", f"{why}")], whole, []
        if ship is None:
            taken = fitted(taken, batches)
        doubts = checked(whole, taken).doubts
        if ship is None:
            doubts = tuple(_without_file(doubt) for doubt in doubts)
        notes += [*doubts, *(f"{_some(names, kept)}{note}" for note, names in said.items())]
    return tables, kept, refused, whole, notes


def _estimates(request: requests.Import, ship: Vessel | None, record: Record) -> tuple[tuple[str, ...], list[str]]:
    """Words that let `estimate` find an estimate from the runs, and why there is none."""
    if not record.batches:
        return (), []
    if ship is None:
        return ("--vessel", VESSEL), []
    words = ("--vessel", str(request.vessel))
    try:
        fixed = to_fix(ship, reduced(checked(record, ship, undo=True), ship))
    except (InputError, NoAnswer) as error:
        return (), [f"no estimate can be had from these runs: {error}"]
    return (*words, *(("--fixed", *fixed) if fixed else ())), []


def _some(names: Sequence[str], runs: Sequence[Run]) -> str:
    """The runs that a note is on, where it is not on all of them."""
    if len(names) == len(runs):
        return ""
    return f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: "


def _without_file(text: str) -> str:
    for old, new in PRESUMED:
        text = text.replace(old, new)
    return text


def _turned_over(why: str) -> str:
    """What turns a heading over in the mapping, where a refusal says that it counts the other way round."""
    if "counter-clockwise" not in why:
        return ""
    offset = " and offset = 1.5708" if "from east" in why else ""
    return f"; in the mapping, scale = -1.0{offset} of the heading, and scale = -1.0 of its rate, turn it over"


def _origin_s(found: Sampled) -> float:
    return float(found.stretches[0].time_s[0])


def _written(path: Path, run: Run, found: Sampled) -> Path:
    """A run as a file of ours; headings begin within a turn."""
    columns = {"time_s": run.stretch.time_s - _origin_s(found), **run.stretch.columns}
    names = [*[name for name in FIRST if name in columns], *sorted(set(columns) - set(FIRST))]
    if "heading_rad" in columns:
        turned = columns["heading_rad"]
        columns["heading_rad"] = turned - 2 * np.pi * np.floor(turned[0] / (2 * np.pi))
    for name in names:
        if name.removeprefix("reached_")[:1] == "a" and name.endswith("_rad"):
            columns[name] = columns[name] - whole_turns(columns[name][0])
    row = ",".join(FORMATS.get(name, "%.8g") for name in names) + "\n"
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(names) + "\n")
        for first in range(0, len(run.stretch), WRITTEN_AT_ONCE):
            part = slice(first, first + WRITTEN_AT_ONCE)
            table = np.column_stack([columns[name][part] for name in names])
            file.writelines(row % tuple(values) for values in table.tolist())
    return path
