"""From files to a record: read, check, cut into batches, derive missing velocities.

Commands to go through, a list of levels or a plan's commands at every sample, are read here, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from expdesign.conventions import OUTPUTS, POSE_COLUMNS, listed
from expdesign.errors import FileError, InputError, UnknownName
from expdesign.records.file import (
    FIRST_ROW,
    LABEL,
    PLANNED,
    REACHED,
    STEERED,
    Clock,
    Inputs,
    Source,
    Table,
    check_ranges,
    check_wind,
    input_name,
    is_input,
    meaning,
    mistyped,
    read_cells,
    read_clock,
    read_table,
    relative_wind,
)
from expdesign.records.limits import check_limits, column_limits
from expdesign.records.pose import (
    MEASURED,
    SMOOTHED,
    VELOCITY_METHODS,
    Request,
    batch_velocity,
    check_agreement,
    check_heading,
    check_jumps,
    check_speed,
    kept_samples,
    left_out_notes,
    long_enough,
    needed_columns,
    origin_notes,
    velocity_origins,
    with_continuous_angles,
    with_metres,
)
from expdesign.sea_area import LocalFrame
from expdesign.signals import AUXILIARY, Batch, Record
from expdesign.values import Array
from expdesign.vessel import Actuator, Limit, column_name

HELD_SHARE = 0.5  # share of repeated positions of a moving ship above which they count as held values
SIDEWAYS_RATIO = 2.0  # sway over surge (root mean square) above which the axes of the pose are questioned
UNCHECKED = ("time_s", "batch", STEERED, "depth_m", "lat_deg", "lon_deg")


def table_remarks(table: Table) -> Iterator[str]:
    """Remarks on the columns of a file."""
    for name, values in table.columns.items():
        if name not in UNCHECKED and not is_input(input_name(name)) and np.ptp(values) == 0:
            yield f"{table.sources[name].header} is {table.value(name, 0)} in all rows, a dead sensor?"
    if "north_m" in table.columns:
        still = np.all(np.diff(table.stack("north_m", "east_m"), axis=0) == 0, axis=1)
        if HELD_SHARE < np.mean(still) < 1:
            yield f"the position repeats in {np.mean(still):.0%} of the rows: differences of held values are inaccurate"


def motion_remarks(batches: list[Batch], origins: Mapping[str, str]) -> Iterator[str]:
    """Remarks on velocities that come from the pose of one file."""
    if any(origins.get(output, MEASURED) == MEASURED for output in ("u", "v")):
        return
    u, v = np.sqrt(np.mean(np.vstack([batch.velocity[:, :2] for batch in batches]) ** 2, axis=0))
    if v > SIDEWAYS_RATIO * u:
        found = f"the ship moves sideways at {v:.3g} m/s and ahead at {u:.3g} m/s, root mean square"
        yield f"{found}: are the axes of the pose what their names say?"


def load_records(
    paths: Sequence[Path | str] | Path | str,
    *,
    vessel_inputs: tuple[str, ...] | None = None,
    sample_time_s: float | None = None,
    velocity: str = "auto",
    heading_std_rad: float | None = None,
    outputs: tuple[str, ...] = OUTPUTS,
    actuators: Sequence[Actuator] = (),
) -> Record:
    """Read measured data from one or more CSV files.

    Args:
        paths: the files; each starts a new batch, and so does every gap in time.
        vessel_inputs: signals to read, e.g. ("n1", "a1", "rudder1"), in the order the record gives them; None for all
            inputs of the first file, in its order.
        sample_time_s: what every file must have [s]; None for what the first file has.
        velocity: "measured"; "difference" or "smoothed" for velocities from pose even where measured ones exist; "auto"
            for measured ones where they exist and differences elsewhere.
        heading_std_rad: standard deviation of the heading's noise [rad], which corrects differences and the
            smoother; None where unknown: differences are not corrected, the smoother estimates it.
        outputs: required velocities among u, v, r; others are nan in the record where they are unknown.
        actuators: of the vessel, within whose limits the inputs should be.

    Returns:
        Batches in file order. Positions of all files share one origin. A batch with a differenced velocity lacks the
        first and the last sample.

    Raises:
        FileError: a file has an error; one line with the column, the value, the rows and the expectation.
        InputError: an argument is wrong.
    """
    files = _names(paths)
    request = _request(velocity, heading_std_rad, outputs, sample_time_s)
    inputs = Inputs(tuple(map(column_name, vessel_inputs)), "the vessel") if vessel_inputs is not None else None
    whose, origin, limits = "the vessel", None, column_limits(actuators)
    batches: list[Batch] = []
    notes: dict[str, list[str]] = {}
    stands: dict[str, set[tuple[str, str]]] = {}  # column of an input -> its name and value in files, "" where it moves
    reached: dict[str, list[str]] = {}  # column of an input -> files that have the position reached
    for path, name in files.items():
        table, origin = _read(path, inputs, origin, limits)
        clock = read_clock(table, sample_time_s=sample_time_s, whose=whose)
        if sample_time_s is None:
            sample_time_s, whose = clock.sample_time_s, f"the first file ({name})"
        inputs = inputs or Inputs(table.inputs, f"the first file ({name})")
        found, remarks = _batches(_judged(table, clock, request), name, clock, request, inputs)
        batches += found
        for note in remarks:
            notes.setdefault(note, []).append(name)
        for column in table.inputs:
            stands.setdefault(column, set()).add(_standing(table, column))
        for column in inputs.columns:
            if REACHED + column in table.columns:
                reached.setdefault(column, []).append(name)
    idle: dict[str, list[str]] = {}  # value -> inputs that have it in all rows
    for levels in stands.values():
        (header, value), *others = levels
        if header and not others:  # another file may tell what one does not
            idle.setdefault(value, []).append(header)
    still = tuple(f"{_listed([*files.values()])}: {_idle_note(headers, value)}" for value, headers in idle.items())
    told = tuple(f"{_listed(names)}: {note}" for note, names in notes.items())
    mixed = tuple(_mixed_notes(reached, [*files.values()]))
    return Record(batches=tuple(batches), notes=(*told, *mixed, *still), idle=still)


def _mixed_notes(reached: Mapping[str, list[str]], files: list[str]) -> Iterator[str]:
    """Inputs that are positions in some files and commands in others."""
    for column, names in reached.items():
        if others := [name for name in files if name not in names]:
            where = f"was reached in {_listed(names)}, and a command in {_listed(others)}"
            yield f"{column} is a position that {where}: one name in all files if one instrument wrote them"


def _standing(table: Table, column: str) -> tuple[str, str]:
    """Name and value of an input that never moves, both empty where it does."""
    used = REACHED + column if REACHED + column in table.columns else column  # as `_inputs` takes it
    return ("", "") if np.ptp(table.columns[used]) > 0 else (table.sources[used].header, table.value(used, 0))


def _idle_note(names: list[str], value: str) -> str:
    """What cannot be learnt of inputs that never move."""
    effect, depend, them = ("its effect", "depends", "it") if len(names) == 1 else ("their effects", "depend", "them")
    # a propeller at one speed still bears on a rudder behind it, and drives the ship
    lost = f"how {effect} {depend} on {them}" if float(value) else effect
    return f"{listed(names)} {'is' if len(names) == 1 else 'are'} {value} in all rows, so {lost} cannot be estimated"


def _listed(names: list[str]) -> str:
    """File names in front of a note that they share."""
    if len(names) == 1:
        return names[0]
    return f"{names[0]} and {len(names) - 1} more file{'s' if len(names) > 2 else ''}"


def _names(paths: Sequence[Path | str] | Path | str) -> dict[Path, str]:
    """Each file with its name in notes and batches, or its path where names coincide."""
    files = [Path(path) for path in ([paths] if isinstance(paths, Path | str) else paths)]
    if not files:
        raise InputError("no data files are given, expected one or more CSV files")
    for index, path in enumerate(files):
        if path in files[:index]:
            raise InputError(f"{path} is given twice, expected every data file once")
    names = [path.name for path in files]
    return {path: path.name if names.count(path.name) == 1 else str(path) for path in files}


def _request(
    velocity: str, heading_std_rad: float | None, outputs: tuple[str, ...], sample_time_s: float | None
) -> Request:
    if velocity not in VELOCITY_METHODS:
        raise UnknownName("velocity method", velocity, known=VELOCITY_METHODS)
    for output in outputs:
        if output not in OUTPUTS:
            raise UnknownName("output", output, known=OUTPUTS)
    if heading_std_rad is not None and not 0 <= heading_std_rad < math.inf:
        raise InputError(f"heading_std_rad is {heading_std_rad:g}, expected a standard deviation of 0 or more")
    if sample_time_s is not None and not 0 < sample_time_s < math.inf:
        raise InputError(f"sample_time_s is {sample_time_s:g}, expected more than 0")
    return Request(method=velocity, heading_std_rad=heading_std_rad, outputs=outputs)


def _read(
    path: Path, inputs: Inputs | None, origin: LocalFrame | None, limits: Mapping[str, Limit]
) -> tuple[Table, LocalFrame | None]:
    """One file in metres and radians, with every number in its range and within the limits of the actuators."""
    table = read_table(path, inputs=inputs)
    check_ranges(table)
    table = with_continuous_angles(check_wind(table), limits)
    return with_metres(check_limits(table, limits), origin)


def _judged(table: Table, clock: Clock, request: Request) -> Table:
    """The same with remarks; raises where pose and velocity jump, or contradict each other."""
    origins = velocity_origins(table, request)
    table = table.noted(*clock.notes)
    table = check_jumps(table, clock.batches, clock.sample_time_s, needed=needed_columns(origins))
    if MEASURED in origins.values():
        table = check_agreement(table, clock.batches, clock.sample_time_s)
    check_speed(table, clock.batches, clock.sample_time_s)
    if any(origins.get(output) != MEASURED for output in ("u", "v")):
        check_heading(table, clock.batches, clock.sample_time_s)
    return table.noted(*table_remarks(table))


def _batches(
    table: Table, name: str, clock: Clock, request: Request, inputs: Inputs
) -> tuple[list[Batch], tuple[str, ...]]:
    """The batches of one file, and all notes on it."""
    origins = velocity_origins(table, request)
    parts = long_enough(clock.batches, origins)
    if not parts:
        raise table.error("time_s", "leaves no batch long enough to derive velocities in, expected 4 samples in a row")
    batches = [
        _batch(table, clock, request, origins, inputs, part, f"{name}, batch {index}" if len(parts) > 1 else name)
        for index, part in enumerate(parts, start=1)
    ]
    left_out = left_out_notes(table, clock.batches, parts)
    return batches, (*table.notes, *left_out, *origin_notes(origins), *motion_remarks(batches, origins))


def _batch(
    table: Table, clock: Clock, request: Request, origins: Mapping[str, str], inputs: Inputs, part: slice, name: str
) -> Batch:
    kept = kept_samples(part, origins)
    wind, depth, steered = relative_wind(table), table.columns.get("depth_m"), table.columns.get(STEERED)
    planned = [PLANNED + column for column in inputs.columns if PLANNED + column in table.columns]
    names = tuple(column.removesuffix("_rps").removesuffix("_rad") for column in inputs.columns)
    return Batch(
        name=name,
        sample_time_s=clock.sample_time_s,
        input_names=names,
        inputs=_inputs(table, inputs.columns, part)[kept.start - part.start :][: kept.stop - kept.start],
        velocity=batch_velocity(table, part, clock.sample_time_s, origins, request.heading_std_rad),
        pose=table.stack(*POSE_COLUMNS)[kept] if set(POSE_COLUMNS) & set(table.columns) else None,
        wind=wind[kept] if wind is not None else None,
        depth_m=depth[kept] if depth is not None else None,
        derived=tuple(output for output, origin in origins.items() if origin != MEASURED),
        smoothed=SMOOTHED in origins.values(),
        first_row=table.first_row + kept.start,
        steered=steered[kept] if steered is not None else None,
        planned=table.stack(*planned)[kept] if planned else None,
        reached=tuple(
            signal for signal, column in zip(names, inputs.columns, strict=True) if REACHED + column in table.columns
        ),
        auxiliary=table.stack(*AUXILIARY)[kept] if set(AUXILIARY) & set(table.columns) else None,
    )


def _inputs(table: Table, columns: tuple[str, ...], part: slice) -> Array:
    """(k, m) commands held in each sample of a part, or means of the positions that were reached at its ends."""
    commanded = table.stack(*columns)[part]
    reached = table.stack(*(REACHED + column for column in columns))[part]
    means = (reached + np.concatenate([reached[1:], reached[-1:]])) / 2
    return np.where([REACHED + column in table.columns for column in columns], means, commanded)


LABEL_SOURCES = ("column", "file")
"""Where labels are: in the column `manoeuvre`, or before the first underscore of a file's name."""


def row_labels(record: Record, paths: Sequence[Path], source: str) -> tuple[tuple[str, ...], ...]:
    """The label of every sample of every batch; "" where there is none.

    Args:
        record: as `load_records` gives it.
        paths: the files that it was read from.
        source: one of `LABEL_SOURCES`.

    Raises:
        UnknownName: no such source.
        FileError: a file has no column `manoeuvre`.
    """
    if source not in LABEL_SOURCES:
        raise UnknownName("source of labels", source, known=LABEL_SOURCES)
    named = {name: path for path in paths for name in (path.name, str(path))}
    texts = {path: _label_column(path) for path in paths} if source == "column" else {}
    found = []
    for batch in record.batches:
        path = named[batch.name if batch.name in named else batch.name.rpartition(",")[0]]
        first = batch.first_row - FIRST_ROW
        by_name = (path.stem.partition("_")[0],) * len(batch)
        found.append(texts[path][first : first + len(batch)] if texts else by_name)
    return tuple(found)


def _label_column(path: Path) -> tuple[str, ...]:
    """The text of every row."""
    cells = read_cells(path)
    if LABEL not in cells.header:
        raise FileError(path, "row 1", f"names no {LABEL}, expected a column with the label of every row")
    column = cells.header.index(LABEL)
    return tuple(text.strip() for _, columns in cells.blocks() for text in columns[column])


NUMBER = "step"
Levels = tuple[Array, Array | None, tuple[int | None, ...] | None]


def read_levels(path: Path, *, inputs: Sequence[str]) -> Levels:
    """Read commands from a CSV file with a column for every input, and `time_s` or `step` where there is one.

    Returns:
        Commands (k, m) in the order of the inputs, in SI units; times (k,) of the rows [s], None for a list without;
        and the step that each row is, None where its cell is empty, or None for a list without such a column.

    Raises:
        FileError: unreadable, without a column for every input, or with cells that are no numbers.
    """
    cells = read_cells(path)
    rows = [row for _, columns in cells.blocks() for row in zip(*columns, strict=True)]
    known = [meaning(name, column) for column, name in enumerate(cells.header)]
    sources = {one.name: one for one in known if isinstance(one, Source)}
    wanted = [column_name(name) for name in inputs]
    if missing := [name for name in wanted if name not in sources]:
        problem = f"names no {' '.join(missing)}, expected a column for every input of the vessel, with its unit"
        raise FileError(path, "row 1", problem + mistyped(missing[0], cells.header))
    values = np.stack([_numbers(path, rows, sources[name]) for name in wanted], axis=1)
    time_s = _numbers(path, rows, sources["time_s"]) if "time_s" in sources else None
    if time_s is not None and np.any(np.diff(time_s) <= 0):
        raise FileError(path, sources["time_s"].header, "does not increase, expected increasing times")
    steps = next((place for place, name in enumerate(cells.header) if name == NUMBER), None)
    numbers = (
        None
        if steps is None or time_s is not None
        else tuple(_count(path, row[steps], k) for k, row in enumerate(rows))
    )
    return values, time_s, numbers


def _numbers(path: Path, rows: Sequence[Sequence[str]], source: Source) -> Array:
    found = [_number(row[source.column]) for row in rows]
    wrong = next((k for k, value in enumerate(found) if not math.isfinite(value)), None)
    if wrong is not None:
        raise FileError(
            path, source.header, f"is {rows[wrong][source.column]!r} in row {wrong + FIRST_ROW}, expected a number"
        )
    return source.factor * np.array(found)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _count(path: Path, text: str, row: int) -> int | None:
    if not text.strip():
        return None
    if not text.strip().isdecimal():
        raise FileError(path, NUMBER, f"is {text!r} in row {row + FIRST_ROW}, expected a whole number, or nothing")
    return int(text)
