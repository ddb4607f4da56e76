"""The page of a step trial."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from expdesign.export.document import Document, Figure, Table, filled, section
from expdesign.export.pages.figures import BLUE, GREY, VERMILION, light_grid, new_figure, page_figure, svg
from expdesign.export.step_trial_content import (
    REPEAT_HEADER,
    STEP_HEADER,
    StepTrialContent,
    Validated,
    command_units,
    nominal_rows,
    repeat_rows,
    sentences,
    step_rows,
    to_repeat,
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
    axes.legend(loc="best", fontsize=8)
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
def simulation_figure(part: Validated, halves: Sequence[int], key: str) -> str:
    """U and r, measured and, of the halves that the model has, simulated from the commands alone."""
    figure = new_figure(6.8, 3.6)
    axes = figure.subplots(2, 1, sharex=True)
    every = max(1, len(part.time_s) // MOST_POINTS)
    for channel, label in enumerate(("U [m/s]", "r [rad/s]")):
        axes[channel].plot(
            part.time_s[::every], part.measured[::every, channel], color=BLUE, linewidth=0.8, label="measured"
        )
        if channel in halves:
            simulated = part.simulated[::every, channel]
            axes[channel].plot(part.time_s[::every], simulated, color=VERMILION, linewidth=0.9, label="simulated")
        axes[channel].set_ylabel(label)
        light_grid(axes[channel])
    axes[halves[0]].legend(loc="upper right", fontsize=8, ncols=2)
    axes[1].set_xlabel("time [s]")
    return svg(figure, key=key, label=f"Speed and yaw rate of {part.name}, measured and simulated")


MOST_SIMULATIONS = 4


EQUATION = Markup(
    "m<sub>U</sub>(U, r) dU/dt + &sigma;<sub>U</sub>(U, r) = throttle, m<sub>r</sub>(U, r) dr/dt + "
    "&sigma;<sub>r</sub>(U, r) = rudder, each after its dead time. U is the speed {}, r the yaw rate."
)
NOMINAL = (
    "The steady states and time constants of the steps were compared with those of this model, beside the values that "
    "its file stated before. What steps of speed and yaw rate do not determine, above all of sway, keeps the standard "
    "deviation stated before. vessel-steps.toml has standard deviations and correlations: a design with prior = "
    '"parameter_std" goes on from there. expdesign estimate with the method oe refines the parameters on the same data.'
)


def step_trial_document(content: StepTrialContent) -> Document:
    """The step trial for people."""
    trial, shown = content.trial, (*content.tests, *content.own)[:MOST_SIMULATIONS]
    through = "through the water" if any(trial.currents) else "over ground"
    delays = {f"delay_{CHANNELS[place]}_s": trial.delays[place][0] for place, *_ in trial.model.halves}
    return Document(
        kind="Step trial",
        title=content.nominal.name if content.nominal else trial.batches[0].name,
        name="Step trial",
        about=EQUATION.format(through),
        findings=sentences(content),
        facts={
            "throttle": trial.controls.words[0],
            "rudder": trial.controls.words[1],
            "holds": len(trial.holds),
            "steps_that_count": len(trial.counted),
            **delays,
        },
        values={
            "steps_to_repeat": [one.hold.number for one in to_repeat(content)],
            "fit": {
                part.name: {"Ur"[place]: part.fit_percent[place] for place, *_ in trial.model.halves}
                for part in (*content.own, *content.tests)
            },
        },
        sections=filled(
            section("Steps to repeat", Table(header=REPEAT_HEADER, rows=repeat_rows(content), texts=5)),
            section(
                "Where the model holds",
                Figure(
                    draw=partial(coverage_figure, content),
                    caption="The grey region is the convex hull of what was sailed, mirrored to both sides. Outside, "
                    "where a polynomial cannot be trusted, the surfaces keep their value at the edge.",
                ),
            ),
            section(
                "Damping and inertia",
                Figure(
                    draw=partial(surface_figure, content),
                    caption="Damping is the command that holds a steady state, in the unit of the command. Inertia is "
                    "the command per acceleration: the time constant of a step times the slope of the damping.",
                ),
            ),
            section("Simulation", *(_simulation(content, place, part) for place, part in enumerate(shown))),
            section(
                "Nominal vessel",
                Table(header=("Parameter", "Before", "After the steps"), rows=nominal_rows(content), texts=3),
                NOMINAL,
            ),
            section("All steps", Table(header=STEP_HEADER, rows=step_rows(content), texts=10, on="page")),
        ),
        notes=content.notes,
    )


def _simulation(content: StepTrialContent, place: int, part: Validated) -> Figure:
    halves = [half for half, *_ in content.trial.model.halves]
    fits = (f"{'Ur'[half]} {part.fit_percent[half]:.0f} %" for half in halves)
    caption = f"{part.name}: simulated from its first state with its commands alone. Fit {', '.join(fits)}."
    return Figure(draw=partial(simulation_figure, part, halves, f"simulation{place}"), caption=caption)
