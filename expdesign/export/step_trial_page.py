"""A step trial while it is sailed and afterwards: sentences for the crew, what is left to sail, and the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from expdesign import __version__
from expdesign.export.document import Document, Figure, filled, section
from expdesign.export.files.text import csv_text, strict_json
from expdesign.export.pages.figures import BLUE, GREY, VERMILION, light_grid, new_figure, page_figure, svg
from expdesign.export.step_trial_content import (
    StepTrialContent,
    Validated,
    command_units,
    nominal_table,
    repeat_table,
    sentences,
    step_table,
    to_repeat,
    unit_of,
)
from expdesign.step_trials import CHANNELS, StepSample, Surface
from expdesign.step_trials.live import Event, Inputs, Listed, State, StepList, in_sequence
from expdesign.values import Array
from expdesign.vessel import column_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes


TO_DO_HEADER = ("step", "set", "why")


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveContent:
    """The values that the files show."""

    steps: StepList  # the list
    state: State  # after the last row
    constants_s: tuple[float, float]  # expected time constants of U and r [s]
    notes: tuple[str, ...]  # on the data
    command: str  # to reproduce it


def event_line(event: Event, steps: StepList) -> str:
    """One line about an event."""
    return f"{event.time_s:8.1f} s  {_event_words(event, steps)}{_following(event, steps)}"


def _event_words(event: Event, steps: StepList) -> str:
    step = f"step {event.step.number}" if event.step is not None else "this hold"
    commands = inputs_text(event.inputs, steps) if event.inputs else ""
    at = "" if event.state is None else f"U {event.state[0]:.2f} m/s over ground, r {event.state[1]:.3f} rad/s"
    texts = {
        "learnt": f"the noise is learnt at {1 / event.seconds if event.seconds else 0:.3g} samples a second",
        "begun": f"{step} begins: {commands}" if event.step is not None else f"on the way to a step: {commands}",
        "steady": f"{step} is steady at {at}: hold it for {event.seconds:.0f} s more"
        + (", a whole turn" if event.whole_turn else ""),
        "over": f"{step} is over, steady at {at}" if event.step is not None else f"steady at {at}",
        "bad": f"{step} is bad: {event.why}" + ("; it will be repeated at the end" if event.step is not None else ""),
        "left out": f"{step} is bad again and left out: {event.why}",
        "gap": f"a gap of {event.seconds:.1f} s in the data" + (f" spoils {step}" if event.step is not None else ""),
        "unlisted": f"the commands are no step of the list: {commands}",
        "done": "all steps are done",
    }
    return texts[event.kind]


def _following(event: Event, steps: StepList) -> str:
    if event.following is None:
        return ""
    inputs, step = event.following
    what = f"next step: {step.number}, " if step is not None else "next, on the way to a step: "
    return f"; {what}set {inputs_text(inputs, steps)}"


def inputs_text(inputs: Inputs, steps: StepList) -> str:
    """`n1 = 12 rps, rudder1 = 0.1 rad (5.7 deg)`."""
    return ", ".join(_input_text(name, value) for name, value in zip(steps.names, inputs, strict=True))


def _input_text(name: str, value: float) -> str:
    unit = unit_of(name)
    degrees = f" ({math.degrees(value):.1f} deg)" if unit == "rad" else ""
    return f"{name} = {round(value, 9) + 0.0:.4g} {unit}".rstrip() + degrees


def to_do_rows(content: LiveContent) -> Iterator[tuple[Inputs, Listed | None]]:
    """Commands still to be set one after the other, from a steady start at the first."""
    yield from in_sequence(content.state.left, None, content.steps)


def to_do_table(content: LiveContent) -> list[tuple[str, ...]]:
    """Under `TO_DO_HEADER`."""
    return [
        ("" if step is None else str(step.number), inputs_text(inputs, content.steps), _why(step))
        for inputs, step in to_do_rows(content)
    ]


def _why(step: Listed | None) -> str:
    if step is None:
        return "on the way to a step"
    return f"to repeat: {step.why}" if step.why else "not sailed yet"


def to_do_csv(content: LiveContent) -> str:
    """A list of steps again: commands in their order, the number of the step that each is, and why it is to do."""
    columns = [column_name(name) for name in content.steps.names]
    rows = (
        ("" if step is None else str(step.number), *(repr(value) for value in inputs), _why(step).replace(",", ";"))
        for inputs, step in to_do_rows(content)
    )
    return csv_text(("step", *columns, "why"), rows)


def live_json(content: LiveContent) -> str:
    """Steps that count, those to sail and those left out, with units in the names."""
    state = content.state
    return strict_json(
        {
            "finished": [
                {
                    "step": one.number, "begins_s": one.begins_s, "steady_after_s": one.steady_s,
                    "U_mps": one.state[0], "U_std_mps": one.state_std[0], "r_radps": one.state[1],
                    "r_std_radps": one.state_std[1],
                }
                for one in state.finished
            ],
            "U_is": "over ground",
            "to_do": _steps_json(state.left, content.steps),
            "left_out": _steps_json(state.left_out, content.steps),
            "expected_time_constants_s": dict(zip("Ur", content.constants_s, strict=True)),
            "sample_time_s": state.sample_time_s or None,
            "notes": list(content.notes),
            "command": content.command,
            "version": __version__,
        }
    )  # fmt: skip


def _steps_json(listed: Sequence[Listed], steps: StepList) -> list[dict[str, object]]:
    columns = [column_name(name) for name in steps.names]
    return [
        {
            "step": one.number,
            "before": dict(zip(columns, one.before, strict=True)),
            "after": dict(zip(columns, one.after, strict=True)),
            "attempts": one.attempts,
            "why": one.why,
        }
        for one in listed
    ]


def live_sentences(content: LiveContent) -> list[str]:
    """The findings."""
    state, count = content.state, len(content.steps.steps)
    found = [f"Steps that count: {len(state.finished)} of {count}."]
    if state.finished:
        found.append("Speeds U of steps are over ground: a current is in them, which identify-steps finds from turns.")
    if state.left:
        unsailed = sum(not step.attempts for step in state.left)
        found.append(f"{len(state.left)} to be sailed: {unsailed} not begun, {len(state.left) - unsailed} to repeat.")
    if state.left_out:
        found.append(
            "Left out after repeated failures: " + ", ".join(str(step.number) for step in state.left_out) + "."
        )
    return found


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


STATES = ("speed U [m/s]", "yaw rate r [rad/s]")


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
        _inertia(axes[1, place], own, inertia, f"inertia to {name}", channel)
        if unit:
            axes[0, place].set_ylabel(f"{name} [{unit}]")
            axes[1, place].set_ylabel(f"[{unit} per {('m/s²', 'rad/s²')[channel]}]")
    return svg(figure, key="surfaces", label="Damping and inertia, measured and by the model")


def _against(axes: Axes, states: Array, values: Array, surface: Surface, title: str, channel: int) -> None:
    axes.plot(states[:, channel], values, "o", color=BLUE, markersize=4, label="measured")
    axes.plot(states[:, channel], surface(states), "x", color=VERMILION, markersize=4, label="model")
    axes.set_title(title)
    axes.set_xlabel(STATES[channel])
    axes.legend(loc="best", fontsize=8)
    light_grid(axes)


def _inertia(axes: Axes, samples: list[StepSample], surface: Surface, title: str, channel: int) -> None:
    good = [one for one in samples if one.counts]
    bad = [one for one in samples if not one.counts and np.isfinite(one.inertia) and one.plateau and one.before]
    places = np.array([one.location for one in good])
    error = [one.inertia_std for one in good]
    values = np.array([one.inertia for one in good])
    axes.errorbar(places[:, channel], values, error, fmt="o", color=BLUE, markersize=4, label="measured")
    axes.plot(places[:, channel], surface(places), "x", color=VERMILION, markersize=4, label="model")
    top = 1.3 * float(values.max())
    shown = [one for one in bad if 0 < one.inertia < top]
    if shown:
        left_out = np.array([one.location for one in shown])
        axes.plot(
            left_out[:, channel], [one.inertia for one in shown], "o", color=GREY, fillstyle="none", label="left out"
        )
    axes.set_ylim(0, top)
    axes.set_title(title)
    axes.set_xlabel(STATES[channel])
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
        findings=tuple(sentences(content)),
        facts={
            "throttle": trial.controls.words[0],
            "rudder": trial.controls.words[1],
            "holds": len(trial.holds),
            "steps_that_count": len(trial.counted),
        },
        values={
            **delays,
            "steps_to_repeat": [one.hold.number for one in to_repeat(content)],
            "fit": {
                part.name: {"Ur"[place]: part.fit_percent[place] for place, *_ in trial.model.halves}
                for part in (*content.own, *content.tests)
            },
        },
        sections=filled(
            section("Steps to repeat", repeat_table(content)),
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
                nominal_table(content),
                NOMINAL,
            ),
            section("All steps", step_table(content)),
        ),
        notes=content.notes,
    )


def _simulation(content: StepTrialContent, place: int, part: Validated) -> Figure:
    halves = [half for half, *_ in content.trial.model.halves]
    fits = (f"{'Ur'[half]} {part.fit_percent[half]:.0f} %" for half in halves)
    caption = f"{part.name}: simulated from its first state with its commands alone. Fit {', '.join(fits)}."
    return Figure(draw=partial(simulation_figure, part, halves, f"simulation{place}"), caption=caption)
