"""`expdesign simulate`: the commands of a plan run on another vessel, and measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from expdesign import requests
from expdesign.conventions import Array
from expdesign.errors import FileError
from expdesign.export.document import Document
from expdesign.export.routes import read_plan
from expdesign.progress import Progress, silent
from expdesign.scenario import load_vessel
from expdesign.signals import Commands
from expdesign.simulation import Environment, WeatherSeries, draw_environment, draw_weather, in_waves, measure
from expdesign.simulation import simulate as simulate_run
from expdesign.workflows.outcome import Outcome, finished, results_folder, workflow


@workflow
def simulate(request: requests.Simulate, *, progress: Progress = silent) -> Outcome:
    """Run the commands of a plan open loop on another vessel in drawn weather, and record its sensors.

    Mean current and wind are drawn around the plan's forecast, and vary from sample to sample as the forecast says;
    where the vessel's file has a current or a wind, around that. Waves of its [roll] roll it. With `until_s` the data
    end at that time, as of a trial broken off.
    """
    folder = results_folder(request, request.plan.parent)
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
    return finished(request, folder, files, Document(facts=summary), progress)


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
