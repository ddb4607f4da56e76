"""Commands on a plan that is written: `simulate`, `export` and `check-route`, `trial-result`."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime

import numpy as np
from pydantic import RootModel

from expdesign import requests
from expdesign.conventions import Array
from expdesign.errors import FileError, InputError
from expdesign.export import Content, build_bridge_route, build_route, find_format, route_files, write_files
from expdesign.export.files import strict_json
from expdesign.export.files.text import read_json
from expdesign.export.formats.check import check_route_file
from expdesign.export.result_page import Estimated, Indices, PlanResult, ResultContent, result_document
from expdesign.export.routes import ROUTE_NAME, read_plan
from expdesign.progress import Progress, silent
from expdesign.scenario import load_vessel
from expdesign.signals import Commands
from expdesign.simulation import Environment, WeatherSeries, draw_environment, draw_weather, in_waves, measure
from expdesign.simulation import simulate as simulate_run
from expdesign.workflows.outcome import Outcome, document_of, finished, workflow

# `expdesign export`: route files of a plan made before.


@workflow
def export(request: requests.Export, *, progress: Progress = silent) -> Outcome:
    """Route files of a plan made before, into `out` or beside it; with times where a departure is given.

    The route and its files are called `name`, or "route". The route has few legs, or follows the track in every turn
    where `fine` or a tolerance is given.
    """
    for known in request.formats:
        find_format(known)
    called = _name(request.name)
    progress("reading the plan", 0.1)
    track, starts = read_plan(request.plan), _departure(request.departure)
    if request.fine or request.tolerance_m is not None:
        route = build_route(track, departure=starts, tolerance_m=request.tolerance_m)
    else:
        route = build_bridge_route(track, departure=starts)
    route = replace(route, name=called)
    files = write_files(request.out or request.plan.parent, route_files(route, tuple(dict.fromkeys(request.formats))))
    summary = {
        "waypoints": len(route.waypoints),
        "length_m": route.length_m,
        "cross_track_distance_m": route.xtd_m,
        "track_within_m": route.fit.largest_m,
        "legs_in_allowed_water": route.fit.in_water,
    }
    return Outcome(files=files, document=document_of(summary))


def _name(text: str | None) -> str:
    if text is None:
        return ROUTE_NAME
    if not re.fullmatch(r"[0-9A-Za-z][0-9A-Za-z._-]{0,62}", text):
        raise InputError(f"--name is {text!r}, expected up to 63 letters, digits, dots, dashes and underscores")
    return text


def _departure(text: str | None) -> datetime | None:
    if text is None:
        return None
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise InputError(f"--departure is {text!r}, expected a time such as 2026-05-01T08:00:00Z") from None


# `expdesign check-route`: route files of any origin checked.


@workflow
def check_routes(request: requests.CheckRoute, *, progress: Progress = silent) -> Outcome:
    """Whether RTZ and GPX files are fit to be loaded.

    Raises:
        FileError: the first problem of the first file that has one, and how many more there are.
    """
    for number, path in enumerate(request.files):
        progress(f"checking {path.name}", number / len(request.files))
        problems = check_route_file(path)
        if problems:
            more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
            raise FileError(path, "", problems[0] + more)
    return Outcome(files=(), document=document_of({"files": len(request.files), "problems": 0}))


Estimates = RootModel[dict[str, Estimated]]


@workflow
def trial_result(request: requests.TrialResult, *, progress: Progress = silent) -> Outcome:
    """The result of a planned trial, from the files of `run`, `estimate` and `indices`, beside the plan.

    Raises:
        InputError: a file is wrong, or they are not of the same ship.
    """
    planned = read_json(request.plan, PlanResult, "a plan.json as expdesign run writes it")
    if planned.draft:
        raise FileError(request.plan, "draft", "is true: a draft is not sailed, expected the plan that was")
    tried = read_json(request.estimate, Estimates, "an estimate.json as expdesign estimate writes it").root
    best = next((one for one in tried.values() if one.in_vessel_file), None)
    if best is None or not set(best.parameters) & set(planned.parameters):
        raise FileError(request.estimate, "", f"estimates no parameter of the plan, {', '.join(planned.parameters)}")
    judged = (
        None
        if request.indices is None
        else read_json(request.indices, Indices, "an indices.json as expdesign indices writes it")
    )
    if judged is not None and judged.vessel != planned.vessel.name:
        raise InputError(f"{request.indices}: is of {judged.vessel}, the plan {request.plan} of {planned.vessel.name}")
    content = ResultContent(
        plan=planned,
        estimate=best,
        indices=judged,
    )
    document = result_document(content)
    files: dict[str, Content] = {
        "result.json": strict_json({"ship": planned.vessel.name, "trial": planned.scenario, **document.summary}),
    }
    return finished(request, request.plan.parent, files, document, progress, page="result.html")


@workflow
def simulate(request: requests.Simulate, *, progress: Progress = silent) -> Outcome:
    """Run the commands of a plan open loop on another vessel in drawn weather, and record its sensors.

    Mean current and wind are drawn around the plan's forecast, and vary from sample to sample as the forecast says;
    where the vessel's file has a current or a wind, around that. Waves of its [roll] roll it. With `until_s` the data
    end at that time, as of a trial broken off.
    """
    progress("reading the plan", 0.05)
    track, vessel = read_plan(request.plan), load_vessel(request.truth)
    if (vessel.model.inputs, vessel.sample_time_s) != (track.commands.names, track.commands.sample_time_s):
        raise FileError(
            request.truth,
            "actuators",
            f"takes {', '.join(vessel.model.inputs)} every {vessel.sample_time_s:g} s, the plan commands "
            f"{', '.join(track.commands.names)} every {track.commands.sample_time_s:g} s",
        )
    rng = np.random.default_rng(request.seed)
    weather = draw_environment(_truth_weather(track.environment, vessel.environment), rng)
    progress("simulating the trial", 0.2)
    begin, met = track.trajectory, _met(weather, track.commands, rng)
    sailed = simulate_run(vessel, track.commands, pose=begin.pose[0], velocity=begin.velocity[0], environment=met)
    sailed = in_waves(vessel, sailed, rng)
    columns = measure(vessel, track.commands, sailed, environment=met, rng=rng)
    columns["steered"] = np.zeros(len(track.commands))  # the commands of legs too are those of the plan
    kept = (
        len(track.commands)
        if request.until_s is None
        else math.ceil(request.until_s / track.commands.sample_time_s - 1e-9)
    )
    columns = {name: values[:kept] for name, values in columns.items()}
    apart = np.hypot(*(sailed.pose - begin.pose)[: kept + 1, :2].T)
    summary = {
        "trial_s": track.commands.duration_s,
        "samples": len(columns["time_s"]),
        "farthest_from_plan_m": float(apart.max()),
        "current_to_north_mps": float(weather.current_to[0]),
        "current_to_east_mps": float(weather.current_to[1]),
        "wind_to_north_mps": float(weather.wind_to[0]),
        "wind_to_east_mps": float(weather.wind_to[1]),
    }
    files = {"measured.csv": _csv(columns)}
    return finished(request, request.plan.parent, files, document_of(summary), progress)


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


def _csv(columns: Mapping[str, Array]) -> str:
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return "\n".join([",".join(columns), *(",".join(f"{value:.10g}" for value in row) for row in rows)]) + "\n"
