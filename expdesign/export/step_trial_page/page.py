"""The page of a step trial."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from expdesign.export.pages import page_template
from expdesign.export.pages.figures import BLUE, GREY, VERMILION, light_grid, new_figure, page_figure, report_style, svg
from expdesign.export.step_trial_page.content import (
    REPEAT_HEADER,
    STEP_HEADER,
    StepTrialContent,
    Validated,
    command_units,
    nominal_rows,
    repeat_rows,
    sentences,
    step_rows,
)
from expdesign.step_trials import CHANNELS, StepSample, Surface
from expdesign.values import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


# Coverage of the state space, surfaces with the samples they were fitted to, and the simulation beside the data.

MOST_POINTS = 3000


@page_figure
def coverage_figure(content: StepTrialContent) -> str:
    """Steady states and middles of transients in the plane of speed and yaw rate."""
    figure = new_figure(6.8, 3.4)
    axes = figure.subplots()
    outline = content.trial.model.region.outline
    axes.fill(outline[:, 0], outline[:, 1], color=GREY, alpha=0.15, linewidth=0, label="where the model holds")
    steady = np.array([one.plateau.state for one in content.trial.samples if one.plateau is not None])
    axes.plot(steady[:, 0], steady[:, 1], "o", color=BLUE, markersize=4, label="steady states")
    middles = np.array([one.location for one in content.trial.counted])
    axes.plot(middles[:, 0], middles[:, 1], "x", color=VERMILION, markersize=4, label="middles of steps that count")
    axes.set_xlabel("speed U [m/s]")
    axes.set_ylabel("yaw rate r [rad/s]")
    axes.legend(loc="upper left", fontsize=8)
    light_grid(axes)
    return svg(figure, key="coverage", label="Steady states and steps in the plane of speed and yaw rate")


@page_figure
def surface_figure(content: StepTrialContent) -> str:
    """Both dampings and both inertias: measured, and by the model at the same places."""
    trial, halves = content.trial, content.trial.model.halves
    figure = new_figure(3.4 * len(halves), 5.4)
    axes = figure.subplots(2, len(halves), squeeze=False)
    steady = [(one, one.plateau) for one in trial.samples if one.plateau is not None]
    states = np.array([part.state for _, part in steady])
    for place, (channel, damping, inertia) in enumerate(halves):
        name, unit = CHANNELS[channel], command_units(content)[channel]
        given = np.array([one.hold.commands[channel] for one, _ in steady])
        _against(axes[0, place], states, given, damping, f"damping = steady {name}", channel)
        own = [one for one in trial.samples if one.hold.channel == channel]
        _inertia(axes[1, place], own, inertia, f"inertia to {name}")
        if unit:
            axes[0, place].set_ylabel(f"{name} [{unit}]")
            axes[1, place].set_ylabel(f"[{unit} per {('m/s²', 'rad/s²')[channel]}]")
    return svg(figure, key="surfaces", label="Damping and inertia, measured and by the model")


def _against(axes: Axes, states: Array, values: Array, surface: Surface, title: str, channel: int) -> None:
    axes.plot(states[:, channel], values, "o", color=BLUE, markersize=4, label="measured")
    axes.plot(states[:, channel], surface(states), "x", color=VERMILION, markersize=4, label="model")
    axes.set_title(title)
    axes.set_xlabel(("speed U [m/s]", "yaw rate r [rad/s]")[channel])
    axes.legend(loc="best", fontsize=8)
    light_grid(axes)


def _inertia(axes: Axes, samples: list[StepSample], surface: Surface, title: str) -> None:
    good = [one for one in samples if one.counts]
    bad = [one for one in samples if not one.counts and np.isfinite(one.inertia) and one.plateau and one.before]
    places = np.array([one.location for one in good])
    error = [one.inertia_std for one in good]
    values = np.array([one.inertia for one in good])
    axes.errorbar(places[:, 0], values, error, fmt="o", color=BLUE, markersize=4, label="measured")
    axes.plot(places[:, 0], surface(places), "x", color=VERMILION, markersize=4, label="model")
    top = 1.3 * float(values.max())
    shown = [one for one in bad if 0 < one.inertia < top]
    if shown:
        left_out = np.array([one.location for one in shown])
        axes.plot(left_out[:, 0], [one.inertia for one in shown], "o", color=GREY, fillstyle="none", label="left out")
    axes.set_ylim(0, top)
    axes.set_title(title)
    axes.set_xlabel("speed U [m/s]")
    axes.legend(loc="best", fontsize=8)
    light_grid(axes)


@page_figure
def simulation_figure(part: Validated, key: str) -> str:
    """U and r, measured and simulated from the commands alone."""
    figure = new_figure(6.8, 3.6)
    axes = figure.subplots(2, 1, sharex=True)
    every = max(1, len(part.time_s) // MOST_POINTS)
    for channel, label in enumerate(("U [m/s]", "r [rad/s]")):
        axes[channel].plot(
            part.time_s[::every], part.measured[::every, channel], color=BLUE, linewidth=0.8, label="measured"
        )
        axes[channel].plot(
            part.time_s[::every], part.simulated[::every, channel], color=VERMILION, linewidth=0.9, label="simulated"
        )
        axes[channel].set_ylabel(label)
        light_grid(axes[channel])
    axes[0].legend(loc="upper right", fontsize=8, ncols=2)
    axes[1].set_xlabel("time [s]")
    return svg(figure, key=key, label=f"Speed and yaw rate of {part.name}, measured and simulated")


MOST_SIMULATIONS = 4


def step_trial_html(content: StepTrialContent) -> str:
    """One HTML page without any outside reference."""
    parts = (*content.tests, *content.own)[:MOST_SIMULATIONS]
    with report_style():
        figures = {"coverage": coverage_figure(content), "surfaces": surface_figure(content)}
        simulations = [(part, simulation_figure(part, f"simulation{place}")) for place, part in enumerate(parts)]
    return page_template("step_trial.html").render(
        content=content,
        sentences=sentences(content),
        repeat_header=[name.capitalize() for name in REPEAT_HEADER],
        repeat_rows=repeat_rows(content),
        step_header=[name if name[1] == " " else name.capitalize() for name in STEP_HEADER],
        step_rows=step_rows(content),
        nominal_rows=nominal_rows(content),
        figures=figures,
        simulations=simulations,
    )
