"""The whole plan over time: speed, yaw rate, commands, with the informative runs shaded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from expdesign.conventions import KNOTS_PER_MPS
from expdesign.export.pages.figures import LINES, PRIMITIVE, light_grid, new_figure, page_figure, plain, short, svg
from expdesign.export.report.content import primitive_runs
from expdesign.export.tuning import TUNING
from expdesign.plan.values import Plan
from expdesign.values import Array
from expdesign.vessel import stem

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class _Panel:
    """Signals that share an axis."""

    title: str
    names: tuple[str, ...]
    values: Array


GROUPS = {
    "n": ("propeller speed [rev/s]", 1.0),
    "a": ("azimuth angle [\N{DEGREE SIGN}]", float(np.degrees(1.0))),
    "rudder": ("rudder angle [\N{DEGREE SIGN}]", float(np.degrees(1.0))),
    "tau_x": ("surge, sway force\n[model units]", 1.0),
    "tau_y": ("surge, sway force\n[model units]", 1.0),
    "tau_psi": ("yaw moment\n[model units]", 1.0),
}
"""Stem of an actuator signal -> title of its panel, and the factor to the unit shown."""


@page_figure
def timeline_figure(plan: Plan) -> str:
    """Speed, yaw rate and every actuator command over the time of the trial."""
    panels = (*_motion_panels(plan), *_command_panels(plan))
    figure = new_figure(7.2, 0.9 + 1.45 * len(panels))
    rows = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    for axes, panel in zip(rows, panels, strict=True):
        _draw(axes, panel, plan.trajectory.sample_time_s)
        _shade_runs(axes, plan)
    knots = rows[0].secondary_yaxis(
        "right", functions=(lambda mps: mps * KNOTS_PER_MPS, lambda knots: knots / KNOTS_PER_MPS)
    )
    knots.set_ylabel("[kn]")
    _number_runs(rows[0], plan)
    rows[-1].set_xlabel("time from the start [min]")
    rows[-1].set_xlim(0, plan.commands.duration_s / 60)
    figure.align_ylabels()
    return svg(figure, key="timeline", label="Speed, yaw rate and actuator commands over time, informative runs shaded")


def _motion_panels(plan: Plan) -> tuple[_Panel, ...]:
    u, v, r = plan.trajectory.velocity.T
    speeds = np.stack([u, v], axis=1)
    return (
        _Panel("velocity over\nground [m/s]", ("u ahead", "v to starboard"), speeds),
        _Panel("yaw rate [\N{DEGREE SIGN}/s]", ("r",), np.degrees(r)[:, None]),
    )


def _command_panels(plan: Plan) -> tuple[_Panel, ...]:
    grouped: dict[str, list[tuple[str, Array]]] = {}
    for name in plan.commands.names:
        title, factor = GROUPS.get(stem(name), (plain(name), 1.0))
        grouped.setdefault(title, []).append((name, plan.commands.column(name) * factor))
    grouped = {
        title: [(name, _within_a_turn(values)) for name, values in signals] if title == GROUPS["a"][0] else signals
        for title, signals in grouped.items()
    }
    return tuple(
        _Panel(title, tuple(name for name, _ in signals), np.stack([values for _, values in signals], axis=1))
        for title, signals in grouped.items()
    )


def _within_a_turn(degrees: Array) -> Array:
    """Angles of thrusters that turn round and round, from -180 to 180, with gaps where they pass there."""
    wrapped = (degrees + 180.0) % 360.0 - 180.0
    wrapped[1:][np.abs(np.diff(wrapped)) > 180.0] = np.nan
    return wrapped


def _draw(axes: Axes, panel: _Panel, sample_time_s: float) -> None:
    time_min = np.arange(len(panel.values)) * sample_time_s / 60
    for name, values, colour in zip(panel.names, panel.values.T, LINES * len(panel.names), strict=False):
        axes.plot(time_min, values, color=colour, linewidth=1.1, label=short(name))  # thinned where straight
    axes.set_ylabel(panel.title, fontsize=9)
    if len(panel.names) > 1:
        axes.legend(loc="center left", bbox_to_anchor=(1.09, 0.5), fontsize=8)
    light_grid(axes)


def _shade_runs(axes: Axes, plan: Plan) -> None:
    minutes = plan.commands.sample_time_s / 60
    for run in primitive_runs(plan):
        leg = plan.legs[run.leg]
        axes.axvspan(leg.first * minutes, leg.last * minutes, color=PRIMITIVE, alpha=0.13, linewidth=0)


def _number_runs(axes: Axes, plan: Plan) -> None:
    minutes = plan.commands.sample_time_s / 60
    last = -np.inf
    for run in primitive_runs(plan):
        leg = plan.legs[run.leg]
        middle = (leg.first + leg.last) / 2 * minutes
        if middle - last < TUNING.number_gap * plan.commands.duration_s / 60:
            continue  # numbers of runs too short to be told apart here
        last = middle
        axes.annotate(
            str(run.number), (middle, 1.0), (0, 3), xycoords=("data", "axes fraction"),
            textcoords="offset points", ha="center", fontsize=9, fontweight="bold", color=PRIMITIVE,
        )  # fmt: skip
