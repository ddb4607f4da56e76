"""Results of an import: the mapping as a file, lines for a vessel file, JSON and a document."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
from markupsafe import Markup

from expdesign import __version__
from expdesign.conventions import plus_minus
from expdesign.export.document import Document, Figure, Listing, Table, filled, section
from expdesign.export.files import entry, finite, strict_json, toml_comments, toml_table, toml_value
from expdesign.export.pages.figures import GREY, LINES, light_grid, new_figure, page_figure, svg
from expdesign.export.words import counted
from expdesign.importing import Followed, Log, Run, Sampled, inputs_of
from expdesign.importing import Mapping as Decisions
from expdesign.values import Array
from expdesign.vessel import response_keys, stem

MOST_POINTS = 4000  # of a line in a figure
MOST_TEXTS = 12
DEGREES = 180.0 / np.pi
VESSEL = "VESSEL.toml"
"""Word for a vessel file that is not there yet."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ImportContent:
    """The values that page and files show."""

    logs: tuple[Log, ...]
    mapping: Decisions
    sampled: Sampled
    runs: tuple[Run, ...]
    files: tuple[str, ...]  # names, one for each run
    rejected: tuple[tuple[str, str], ...]  # where, and why
    followed: tuple[Followed, ...]  # how actuators follow their orders
    sensors: Mapping[str, tuple[float, str]]  # key of [sensors] -> value, and what it is
    notes: tuple[str, ...]
    origin_s: float  # time of the first row that is written
    dated: bool  # whether it counts from 1970
    command: str  # to reproduce it
    estimates: tuple[str, ...] = ()  # words behind `expdesign estimate FOLDER` that estimate from the runs; () for none


def channel_table(content: ImportContent) -> Table:
    """A row for each channel that is used, in the order of the columns' names."""
    uses = sorted((use for use in content.mapping.uses if use.column), key=lambda use: (use.column, use.file))
    rows = [
        (
            use.column, use.channel if len(content.logs) == 1 else f"{use.file}: {use.channel}", use.unit or "-",
            f"{use.scale:.5g}" + (f" {use.offset:+.5g}" if use.offset else ""), use.why,
        )
        for use in uses
    ]  # fmt: skip
    return Table(header=("Column", "Channel", "Unit", "Times", "Why"), rows=rows, texts=5)


def unused_table(content: ImportContent) -> Table:
    """Log, channels or texts that are not used, and why; those of one reason together."""
    groups: dict[tuple[str, str], list[str]] = {}
    for use in content.mapping.uses:
        if not use.column:
            groups.setdefault((use.file, use.why), []).append(use.channel)
    for log in content.logs:
        if log.unused:
            groups.setdefault((log.source, "not a reading of the ship's motion, or without a clock"), []).extend(
                log.unused
            )
    rows = [(file, _listed(names), why) for (file, why), names in groups.items()]
    return Table(header=("Log", "Channel", "Why"), rows=rows, texts=3)


def _listed(names: Sequence[str]) -> str:
    more = len(names) - MOST_TEXTS
    return ", ".join(names[:MOST_TEXTS]) + (f" and {more} more" if more > 0 else "")


def run_table(content: ImportContent) -> Table:
    """File, what it is, when it begins, how long it lasts, and how long its approach is."""
    step_s = content.sampled.sample_time_s
    rows = [
        (name, run.family, moment(content, float(run.stretch.time_s[0])), f"{len(run.stretch) * step_s:.4g}",
         f"{run.approach_s:.4g}")
        for name, run in zip(content.files, content.runs, strict=True)
    ]  # fmt: skip
    return Table(header=("File", "What", "Begins", "Lasts s", "Approach s"), rows=rows, texts=3)


def moment(content: ImportContent, time_s: float) -> str:
    """A time as a date where it is known, else in seconds from the beginning."""
    if not content.dated:
        return f"{time_s - content.origin_s:.1f} s"
    return datetime.fromtimestamp(time_s, UTC).strftime("%Y-%m-%d %H:%M:%S")


def response_table(content: ImportContent) -> Table:
    """Signal, slew rate, lag, dead time and what is left, each with its standard error."""
    rows = [
        (one.signal, _followed(one.rate), _followed(one.lag_s), _followed(one.delay_s), f"{one.rest:.2g}")
        for one in content.followed
    ]
    return Table(header=("Signal", "Rate per second", "Lag s", "Dead time s", "Left"), rows=rows)


def _followed(value: tuple[float, float] | None) -> str:
    return "none shows" if value is None else plus_minus(*value)


def mapping_toml(mapping: Decisions, logs: Sequence[Log], *, command: str) -> str:
    """The mapping as a file that `--map` reads."""
    lines = toml_comments(
        [
            "How the channels of these logs become columns. Change what is wrong, and give the file as --map.",
            "Keys: expdesign explain mapping. Columns: expdesign explain data.",
            f"Made by: {command}",
        ]
    )
    top = ("sample_time_s", "length_m", "variation_deg", "antenna_forward_m", "antenna_starboard_m")
    lines += toml_table("", {key: getattr(mapping, key) for key in top})
    clockless = {log.source for log in logs if log.clock == "no clock"}
    for clock in mapping.files:
        step_s = clock.sample_time_s if clock.sample_time_s or clock.file in clockless else None
        stated = {"offset_s": clock.offset_s, "offset_std_s": clock.offset_std_s or None, "sample_time_s": step_s}
        lines += ["", *toml_table("[[file]]", {"name": clock.file, **stated})]
    for use in mapping.uses:
        if use.column:
            entries = {**vars(use), "offset": use.offset or None, "why": use.why or None}
            lines += ["", *toml_table("[[channel]]", entries)]
    rest = [use for use in mapping.uses if not use.column]
    if rest:
        names = (f"file = {toml_value(use.file)}, channel = {toml_value(use.channel)} ({use.why})" for use in rest)
        lines += ["", *toml_comments(["Not used; add a table [[channel]] for what should be:", *names])]
    return "\n".join(lines) + "\n"


def instruments_toml(content: ImportContent) -> str:
    """What the logs tell of actuators and sensors, which commands read that are given the folder."""
    lines = toml_comments(
        [
            "What the logs tell of sensors and actuators, by keys of vessel files. Commands that read the runs use it",
            "where the vessel file says nothing, and say so. Change or delete what is wrong.",
            f"Made by: {content.command}",
        ]
    )
    if content.sensors:
        lines += ["", "[sensors]"]
        lines += [f"{key} = {value!r}  # {words}" for key, (value, words) in content.sensors.items()]
    for one in content.followed:
        keys = response_keys(stem(one.signal))
        lines += ["", f"[actuators.{one.signal}]  # {one.moves} changes of its order"]
        for key, value in (("rate", one.rate), ("lag_s", one.lag_s), ("delay_s", one.delay_s)):
            if value is not None:
                lines.append(f"{keys[key]} = {value[0]:.4g}  # standard error {value[1]:.1g}")
        if abs(one.offset) > 3 * one.rest:
            lines.append(f"# {keys['offset']} = {one.offset:.3g}: reached less ordered, at rest; not used")
    return "\n".join(lines) + "\n"


def import_json(content: ImportContent) -> str:
    """All decisions and results."""
    return strict_json(
        {
            "command": content.command,
            "version": __version__,
            "begins": moment(content, content.origin_s) if content.dated else None,
            "begins_s": content.origin_s,
            "sample_time_s": content.sampled.sample_time_s,
            "logs": [
                {"name": log.source, "clock": log.clock, "channels": len(log.channels), "unused": list(log.unused)}
                for log in content.logs
            ],
            "clocks": [entry(one, "file", "offset_s", "offset_std_s") for one in content.mapping.files],
            "channels": [{**vars(use), "column": use.column or None} for use in content.mapping.uses],
            "runs": [
                {"file": name, "what": run.family, "begins_s": float(run.stretch.time_s[0]) - content.origin_s,
                 "lasts_s": len(run.stretch) * content.sampled.sample_time_s, "approach_s": run.approach_s}
                for name, run in zip(content.files, content.runs, strict=True)
            ],
            "rejected": [{"where": where, "why": why} for where, why in content.rejected],
            "actuators": {
                one.signal: {
                    key: None if value is None else {"value": finite(value[0]), "std": finite(value[1])}
                    for key, value in (("rate", one.rate), ("lag_s", one.lag_s), ("delay_s", one.delay_s))
                }
                for one in content.followed
            },
            "sensors": {key: value for key, (value, _) in content.sensors.items()},
            "notes": list(content.notes),
        }
    )  # fmt: skip


def earlier_files(folder: Path) -> set[str]:
    """Runs that an earlier import wrote into a folder, which a new one replaces."""
    try:
        runs = json.loads((folder / "import.json").read_text(encoding="utf-8"))["runs"]
        return {run["file"] for run in runs if Path(run["file"]).name == run["file"] and run["file"].endswith(".csv")}
    except (OSError, ValueError, KeyError, TypeError):
        return set()


def import_document(content: ImportContent, folder: Path) -> Document:
    """The import for people; its runs are in `folder`."""
    step = f"{content.sampled.sample_time_s:g} s"
    clocks = " ".join(f"{log.source}: {log.clock}." for log in content.logs)
    sensors = [(key, f"{value:.4g}", words) for key, (value, words) in content.sensors.items()]
    parts = filled(
        section("Rejected", Table(header=("Where", "Why"), rows=content.rejected, texts=2)),
        section(
            "Channels that are used",
            channel_table(content),
            "mapping.toml holds these decisions. Change what is wrong, and import again with --map mapping.toml.",
        ),
        section("Not used", unused_table(content)),
        section(
            "How actuators follow their orders",
            response_table(content),
            "Fitted to orders and positions reached; instruments.toml has them, and other "
            "commands use them where the vessel file says nothing.",
        ),
        section("Sensors", Table(header=("Key under [sensors]", "Value", "From"), rows=sensors, texts=3)),
    )
    return Document(
        kind="Imported logs",
        title=", ".join(log.source for log in content.logs),
        name="Imported logs",
        about=f"{counted(len(content.runs), 'run')} in steps of {step}. {clocks}",
        facts={
            "runs": len(content.runs),
            "channels_used": sum(bool(use.column) for use in content.mapping.uses),
            "sample_time_s": content.sampled.sample_time_s,
        },
        values={
            "logs": [f"{log.source}: {log.clock}, {len(log.channels)} channels" for log in content.logs],
            "runs_rejected": [f"{where}: {why}" for where, why in content.rejected],
        },
        sections=(
            section(
                "Runs",
                run_table(content),
                Figure(draw=partial(_track, content), caption="Way over ground; runs in colour."),
                Figure(
                    draw=partial(_series, content),
                    caption="What is written, over the time from the first row on; runs shaded.",
                ),
            ),
            *parts,
            *filled(section("Next", *_next(content, folder))),
        ),
        notes=content.notes,
        command=content.command,
    )


def _next(content: ImportContent, folder: Path) -> Iterator[Listing | str]:
    """What to do with the runs."""
    if not content.estimates:
        return
    yield Listing((shlex.join(["expdesign", "estimate", str(folder), *content.estimates]),))
    if VESSEL in content.estimates:
        yield f"{VESSEL} stands for the ship's file, which expdesign new or expdesign nominal makes."
    if "--fixed" in content.estimates:
        yield "The runs tell nothing of the parameters behind --fixed, which keep the values of the vessel file."


def _thin(count: int) -> slice:
    return slice(None, None, max(1, math.ceil(count / MOST_POINTS)))


@page_figure
def _track(content: ImportContent) -> Markup:
    """The way over ground, with the runs in colour."""
    figure = new_figure(6.4, 4.6)
    axes = figure.subplots()
    parts = [(GREY, 0.8, "", stretch) for stretch in content.sampled.stretches]
    parts += [
        (LINES[k % len(LINES)], 2.0, name, run.stretch)
        for k, (name, run) in enumerate(zip(content.files, content.runs, strict=True))
    ]
    origin = None
    for colour, width, name, stretch in parts:
        columns = stretch.columns
        if "lat_deg" in columns:
            north, east = columns["lat_deg"], columns["lon_deg"]
            origin = origin or (float(north[0]), float(east[0]))
            north, east = 111195.0 * (north - origin[0]), 111195.0 * np.cos(np.radians(origin[0])) * (east - origin[1])
        elif "north_m" in columns:
            north, east = columns["north_m"], columns["east_m"]
        else:
            continue
        thin = _thin(len(stretch))
        axes.plot(east[thin], north[thin], color=colour, linewidth=width, label=name or None)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    light_grid(axes)
    if 0 < len(content.runs) <= 8 and axes.lines:
        axes.legend(fontsize=8)
    return svg(figure, key="track", label="way over ground with the runs")


def _within_turn(degrees: Array) -> Array:
    """Headings from 0 to 360 degrees, with a gap where they pass north."""
    shown = degrees % 360.0
    shown[1:][np.abs(np.diff(shown)) > 180.0] = np.nan
    return shown


@page_figure
def _series(content: ImportContent) -> Markup:
    """Heading, speed and inputs over time, runs shaded."""
    first = content.sampled.stretches[0].columns
    inputs = list(inputs_of(first))[:6]
    rows = [name for name in ("heading_rad", "u_mps") if name in first] + inputs
    figure = new_figure(8.6, 1.2 + 1.1 * max(len(rows), 1))
    for axes, name in zip(np.atleast_1d(figure.subplots(max(len(rows), 1), 1, sharex=True)), rows, strict=False):
        angle = name.endswith("_rad")
        for stretch in content.sampled.stretches:
            values = inputs_of(stretch.columns).get(name, stretch.columns.get(name))
            if values is not None:
                thin = _thin(len(stretch))
                shown = values[thin] * (DEGREES if angle else 1.0)
                shown = _within_turn(shown) if name == "heading_rad" else shown
                axes.plot((stretch.time_s[thin] - content.origin_s) / 60.0, shown, color="#0072B2", linewidth=0.8)
        for k, run in enumerate(content.runs):
            ends = (run.stretch.time_s[[0, -1]] - content.origin_s) / 60.0
            axes.axvspan(*ends, color=LINES[k % len(LINES)], alpha=0.15, linewidth=0)
        words = {"heading_rad": "heading [deg]", "u_mps": "ahead [m/s]"}
        unit = "deg" if angle else "1/s" if name.endswith("_rps") else "-"
        axes.set_ylabel(words.get(name, f"{name.removesuffix('_rad').removesuffix('_rps')} [{unit}]"), fontsize=8)
        light_grid(axes)
        axes.set_xlabel("time [min]")
        axes.label_outer()
    return svg(figure, key="series", label="heading, speed and inputs over time, runs shaded")
