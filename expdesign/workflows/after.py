"""From a plan or from measured data: route files, rehearsal, estimates."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from expdesign import __version__
from expdesign.assessment import NO_TESTS, Assessment, Wish, assess
from expdesign.conventions import Array
from expdesign.errors import FileError, InputError
from expdesign.estimation.regression import with_depth
from expdesign.export import (
    FORMATS,
    build_route,
    estimate_json,
    estimate_warnings,
    estimated_vessel,
    find_format,
    fit_entries,
    fit_table,
    limit_entries,
    limit_table,
    parameter_entries,
    parameter_table,
    route_files,
    write_files,
)
from expdesign.export.estimate_page import EstimateContent, estimate_html
from expdesign.export.routes import read_plan
from expdesign.records import load_records
from expdesign.scenario import load_vessel
from expdesign.signals import Commands, Record
from expdesign.simulation import Environment, WeatherSeries, draw_environment, draw_weather, measure
from expdesign.simulation import simulate as simulate_run
from expdesign.vessel import Vessel, column_name
from expdesign.vessel.structures import FORCE_SIGNALS
from expdesign.workflows.outcome import Outcome, Progress, TextTable, silent, within


def export(
    plan: Path,
    out: Path | None,
    *,
    formats: Sequence[str],
    departure: str | None = None,
    tolerance_m: float | None = None,
    progress: Progress = silent,
) -> Outcome:
    """Route files of a plan made before, into `out` or beside it; with times where a departure is given."""
    if not formats:
        raise InputError(f"no route format is named; there are {', '.join(item.name for item in FORMATS)}")
    for name in formats:
        find_format(name)
    progress("reading the plan", 0.1)
    route = build_route(read_plan(plan), departure=_departure(departure), tolerance_m=tolerance_m)
    files = write_files(out or plan.parent, route_files(route, tuple(dict.fromkeys(formats))))
    summary = {
        "waypoints": len(route.waypoints),
        "length_m": route.length_m,
        "cross_track_distance_m": route.xtd_m,
        "track_within_m": route.fit.largest_m,
        "legs_in_allowed_water": route.fit.in_water,
    }
    return Outcome(files=files, summary=summary)


def _departure(text: str | None) -> datetime | None:
    if text is None:
        return None
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise InputError(f"--departure is {text!r}, expected a time such as 2026-05-01T08:00:00Z") from None


def simulate(
    plan: Path,
    out: Path | None,
    *,
    truth: Path,
    until_s: float | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> Outcome:
    """The commands of a plan run open loop on another vessel in drawn weather, and what its sensors record.

    Mean current and wind are drawn around the plan's forecast, and vary from sample to sample as the forecast says;
    where the vessel's file has a current or a wind, around that. With `until_s` the data end at that time, as of a
    trial broken off.
    """
    if until_s is not None and not 0 < until_s < np.inf:
        raise InputError(f"--until is {until_s:g}, expected more than 0 seconds")
    progress("reading the plan", 0.05)
    track, vessel = read_plan(plan), load_vessel(truth)
    if (vessel.model.inputs, vessel.sample_time_s) != (track.commands.names, track.commands.sample_time_s):
        raise FileError(
            truth,
            "actuators",
            f"takes {', '.join(vessel.model.inputs)} every {vessel.sample_time_s:g} s, the plan commands "
            f"{', '.join(track.commands.names)} every {track.commands.sample_time_s:g} s",
        )
    rng = np.random.default_rng(seed)
    weather = draw_environment(_truth_weather(track.environment, vessel.environment), rng)
    progress("simulating the trial", 0.2)
    begin, met = track.trajectory, _met(weather, track.commands, rng)
    sailed = simulate_run(vessel, track.commands, pose=begin.pose[0], velocity=begin.velocity[0], environment=met)
    columns = measure(vessel, track.commands, sailed, environment=met, rng=rng)
    kept = len(track.commands) if until_s is None else math.ceil(until_s / track.commands.sample_time_s - 1e-9)
    columns = {name: values[:kept] for name, values in columns.items()}
    apart = np.hypot(*(sailed.pose - begin.pose)[: kept + 1, :2].T)
    files = write_files(out or plan.parent, {"measured.csv": _csv(columns)})
    summary = {
        "trial_s": track.commands.duration_s,
        "samples": len(columns["time_s"]),
        "farthest_from_plan_m": float(apart.max()),
        "current_to_north_mps": float(weather.current_to[0]),
        "current_to_east_mps": float(weather.current_to[1]),
        "wind_to_north_mps": float(weather.wind_to[0]),
        "wind_to_east_mps": float(weather.wind_to[1]),
    }
    return Outcome(files=files, summary=summary)


def _truth_weather(forecast: Environment, own: Environment) -> Environment:
    """The forecast, but the current and the wind of the vessel's file where it has a mean one."""
    if own.current_to.any():
        names = ("current_to", "current_std_mps", "current_variation")
        forecast = replace(forecast, **{name: getattr(own, name) for name in names})
    if own.wind_to.any():
        names = ("wind_to", "wind_std_mps", "wind_variation")
        forecast = replace(forecast, **{name: getattr(own, name) for name in names})
    return forecast


def _met(weather: Environment, commands: Commands, rng: np.random.Generator) -> Environment | WeatherSeries:
    """Weather that does not vary needs no numbers for every sample."""
    if weather.steady:
        return weather
    return draw_weather(weather, len(commands), sample_time_s=commands.sample_time_s, rng=rng)


def estimate(
    data: Sequence[Path],
    out: Path | None,
    *,
    vessel: Path,
    methods: Sequence[str] = (),
    fixed: Sequence[str] = (),
    velocity: str = "auto",
    mean: str = "complete",
    start: str = "auto",
    motion: str = "continuous",
    horizon_s: float | None = None,
    constant: bool = False,
    tests: Sequence[Path] = (),
    progress: Progress = silent,
) -> Outcome:
    """Parameters of a vessel from measured data, into `out` or runs/<first data file>."""
    if not data:
        raise InputError("no data files are given, expected one or more CSV files")
    for path in tests:
        if path in data:
            raise InputError(f"{path} is given for estimation and for testing, expected one of the two")
    progress("reading the data", 0.02)
    ship = load_vessel(vessel)
    wish = Wish(
        methods=tuple(methods),
        fixed=tuple(fixed),
        mean=mean,
        start=start,
        motion=motion,
        horizon_s=horizon_s,
        constant=constant,
    )
    record = measured(data, ship, velocity=velocity)
    apart = measured(tests, ship, velocity=velocity) if tests else NO_TESTS
    found = assess(ship, record, wish, tests=apart, progress=within(progress, 0.1, 0.8))
    progress("drawing the report", 0.8)
    command = _estimate_command(data, vessel, wish, velocity, tests)
    files = {
        "estimate.json": estimate_json(found, ship),
        "vessel-estimated.toml": estimated_vessel(found, ship, command=command),
        "estimate.html": estimate_html(EstimateContent(vessel=ship, found=found, command=command, version=__version__)),
    }
    written = write_files(out or Path("runs") / data[0].stem, files)
    progress("done", 1.0)
    return Outcome(files=written, summary=_estimate_summary(found), tables=_estimate_tables(found))


def measured(data: Sequence[Path], vessel: Vessel, *, velocity: str = "auto") -> Record:
    """Measured data of a vessel: its own actuators' signals, or generalised forces where the first file has those.

    A model in discrete form holds for one sample time, which the data must have; in continuous form any will do.
    """
    inputs, header = vessel.model.inputs, _header(data[0])
    if not {column_name(name) for name in inputs} <= header and set(FORCE_SIGNALS) <= header:
        inputs = FORCE_SIGNALS
    record = load_records(
        list(data),
        vessel_inputs=inputs,
        sample_time_s=vessel.sample_time_s if vessel.model.form == "discrete" else None,
        velocity=velocity,
        heading_std_rad=vessel.sensors.heading_rad or None,
        outputs=vessel.model.outputs,
    )
    return with_depth(record, vessel.draught_m) if vessel.model.reads_depth else record


def _header(path: Path) -> set[str]:
    """Names in the first row; empty where the file cannot be read, of which the reader will complain."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            return {cell.strip(' "') for cell in re.split("[,;\t]", file.readline().strip())}
    except (OSError, UnicodeDecodeError):
        return set()


def _estimate_command(data: Sequence[Path], vessel: Path, wish: Wish, velocity: str, tests: Sequence[Path]) -> str:
    options = [("--method", wish.methods), ("--fixed", wish.fixed), ("--test", tests)]
    spelled = [part for option, values in options if values for part in (option, *map(str, values))]
    chosen = [
        ("--velocity", velocity, "auto"),
        ("--mean", wish.mean, "complete"),
        ("--start", wish.start, "auto"),
        ("--motion", wish.motion, "continuous"),
        ("--horizon", "" if wish.horizon_s is None else f"{wish.horizon_s:g}", ""),
    ]
    spelled += [part for option, value, usual in chosen if value != usual for part in (option, value)]
    spelled += ["--constant"] if wish.constant else []
    return shlex.join(["expdesign", "estimate", *map(str, data), "--vessel", str(vessel), *spelled])


def _estimate_summary(found: Assessment) -> dict[str, object]:
    batches = found.record.batches
    return {
        "runs": len(batches),
        "samples": sum(len(batch) for batch in batches),
        "runs_kept_apart": len(found.tests.batches),
        "vessel_file_holds": found.best.method.name,
        "parameters_of": found.motion,
        "what_limits_the_fit": limit_entries(found),
        "methods_left_out": list(found.left_out),
        "methods": {
            item.method.name: {
                "parameters": parameter_entries(item),
                "fit": fit_entries(item),
                "warnings": len(estimate_warnings(found, item)),
            }
            for item in found.methods
        },
    }


def _estimate_tables(found: Assessment) -> tuple[TextTable, ...]:
    tables = (
        ("Estimates, with standard deviations", parameter_table(found)),
        ("Fit of the simulated output to the measured one, in per cent", fit_table(found)),
        (f"What limits the fit of {found.best.method.name}", limit_table(found)),
    )
    return tuple(TextTable(title=title, header=header, rows=tuple(rows)) for title, (header, rows) in tables)


def _csv(columns: Mapping[str, Array]) -> str:
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return "\n".join([",".join(columns), *(",".join(f"{value:.10g}" for value in row) for row in rows)]) + "\n"
