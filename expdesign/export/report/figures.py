"""Figures of the report besides the chart: durations, information, primitives, and the plan over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from expdesign.conventions import KNOTS_PER_MPS, to_n_frame
from expdesign.dictionary.build import desired_motion
from expdesign.dictionary.spec import Primitive
from expdesign.durations import DurationDesign
from expdesign.export.files import PlannedAccuracy
from expdesign.export.pages.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LINES,
    PRIMITIVE,
    VERMILION,
    light_grid,
    new_figure,
    page_figure,
    plain,
    round_ticks,
    short,
    svg,
)
from expdesign.export.report.content import ReportContent, primitive_runs, relative_information
from expdesign.plan.values import Plan
from expdesign.shortest_day import ShortestDay
from expdesign.values import Array
from expdesign.vessel import stem

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEAST_FRACTION = 1e-6  # time fractions below this count as none
HULLS = 5  # hulls drawn along the path of a primitive
NUMBER_GAP = 0.022  # least distance of the numbers of runs, as a share of the figure's width


@page_figure
def durations_figure(content: ReportContent) -> str:
    """Left: time of each primitive, optimal and in whole runs. Right: its sensitivity against the bound."""
    design = content.design
    names = [short(content.shown(item.primitive.name)) for item in content.information]
    figure = new_figure(6.4, 1.5 + 0.32 * len(names))
    times, sensitivities = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    _draw_times(times, design)
    _draw_sensitivities(sensitivities, design)
    times.set_yticks(range(len(names)), names, fontsize=9)
    times.invert_yaxis()
    label = "Time of each primitive, and its sensitivity against the bound of the optimality certificate"
    return svg(figure, key="durations", label=label)


def _draw_times(axes: Axes, design: DurationDesign) -> None:
    rows = np.arange(len(design.problem.names))
    whole = np.array(design.repeats) * design.problem.run_s / 60
    axes.barh(rows, whole, height=0.62, color=PRIMITIVE, alpha=0.75, label="in whole runs")
    used, optimal = design.fractions > LEAST_FRACTION, design.durations_s / 60
    axes.plot(optimal[used], rows[used], "D", color="white", markeredgecolor="black", label="optimal", markersize=6)
    for row, (length, count) in enumerate(zip(whole, design.repeats, strict=True)):
        beyond = max(length, optimal[row])
        text = f"{count} \N{MULTIPLICATION SIGN}"
        axes.annotate(text, (beyond, row), (8, 0), textcoords="offset points", va="center", fontsize=9)
    axes.set_xlabel("time [min]")
    axes.set_xlim(0, 1.14 * max(whole.max(), optimal.max()))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=1, fontsize=9)
    light_grid(axes, "x")


def _draw_sensitivities(axes: Axes, design: DurationDesign) -> None:
    rows = np.arange(len(design.problem.names))
    used, bound = design.fractions > LEAST_FRACTION, design.certificate.level
    net = design.sensitivities - design.certificate.prices
    axes.axvline(bound, color="black", linewidth=1.2, label=f"bound {bound:.4g}")
    shown = design.problem.included  # nothing is to be proved of the others
    axes.hlines(rows[shown], min(0.0, bound), net[shown], color=GREY, linewidth=0.8)
    axes.plot(net[used], rows[used], "o", color=BLUE, label="used")
    axes.plot(net[shown & ~used], rows[shown & ~used], "o", color="white", markeredgecolor=BLUE, label="not used")
    low, high = min(0.0, float(net[shown].min())), max(bound, float(net[shown].max()))
    axes.set_xlim(low - 0.12 * (high - low) * (low < 0), high + 0.12 * (high - low))
    axes.set_xlabel("sensitivity minus price" if design.certificate.multipliers else "sensitivity")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=9, columnspacing=1.0)
    light_grid(axes, "x")


@page_figure
def information_figure(content: ReportContent) -> str:
    """Heat map: for each parameter, information per minute of each primitive relative to the best one."""
    share = relative_information(content).T
    names = [short(content.shown(item.primitive.name)) for item in content.information]
    figure = new_figure(min(max(2.2 + 0.62 * len(names), 6.4), 14.0), 1.9 + 0.3 * len(content.parameters))
    axes = figure.subplots()
    mesh = axes.pcolormesh(share, cmap="cividis", vmin=0.0, vmax=1.0, edgecolors="white", linewidth=1.0)
    for (row, column), value in np.ndenumerate(share):
        colour = "black" if value > 0.55 else "white"
        axes.text(column + 0.5, row + 0.5, f"{100 * value:.0f}", ha="center", va="center", fontsize=8, color=colour)
    axes.set_yticks(np.arange(len(content.parameters)) + 0.5, [short(name) for name in content.parameters])
    axes.set_xticks(np.arange(len(names)) + 0.5, names)
    if max(map(len, names)) > 6:
        axes.tick_params(axis="x", rotation=40, rotation_mode="xtick")
    axes.invert_yaxis()
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    bar = figure.colorbar(mesh, ax=axes, ticks=(0, 0.5, 1.0), format=lambda value, _: f"{100 * value:.0f} %")
    bar.outline.set_visible(False)
    bar.solids.set(rasterized=False, edgecolor="face")  # type: ignore[union-attr]
    bar.set_label("of the most informative manoeuvre", fontsize=9)
    label = "Heat map: information per minute of each primitive about each parameter, relative to the best primitive"
    return svg(figure, key="information", label=label)


@page_figure
def pareto_figure(day: ShortestDay) -> str:
    """Every day planned as a point, the estimated shortest days as a line, and the bound."""
    figure = new_figure(6.4, 3.6)
    axes = figure.subplots()
    minutes, shares = day.curve.T[0] / 60, 100 * day.curve.T[1]
    axes.plot(minutes, shares, "-", color=BLUE, linewidth=1.4, label="shortest, estimated")
    tried = np.array([(item.day_s / 60, 100 * item.information) for item in day.tried])
    axes.plot(*tried.T, "o", color=VERMILION, markersize=5, label="planned")
    for number, point in enumerate(tried, start=1):
        axes.annotate(str(number), point, (5, 4), textcoords="offset points", fontsize=9)
    chosen_s = day.plan.day.planned_s
    axes.plot(chosen_s / 60, 100 * day.information, "o", color="none", markeredgecolor=BLACK, markersize=12)
    asked = 100.0 if day.most_s is None else None
    if asked is not None:
        axes.axhline(asked, color=BLACK, linewidth=0.9, linestyle=":", label="asked for")
    else:
        axes.axvline((day.most_s or np.nan) / 60, color=BLACK, linewidth=0.9, linestyle=":", label="asked for")
    low, high = axes.get_xlim()
    if day.bound is not None and day.bound.day_s > 0:
        low = min(low, day.bound.day_s / 60 - 0.04 * (high - low))
        axes.axvspan(low, day.bound.day_s / 60, color=GREY, alpha=0.25, linewidth=0)
    axes.set_xlim(low, high)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("day as planned [min]")
    axes.set_ylabel("information [% of what is needed]" if day.most_s is None else "information [% of total_s]")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=9)
    light_grid(axes)
    return svg(figure, key="pareto", label="Length of the day against the information of its whole track")


@page_figure
def uncertainty_figure(content: ReportContent, found: PlannedAccuracy) -> str:
    """One row for each parameter, logarithmic: prior, after the runs, after the whole track."""
    names = [short(name) for name in content.parameters]
    figure = new_figure(6.4, 1.4 + 0.27 * len(names))
    axes = figure.subplots()
    size = parameter_size(content)
    rows = np.arange(len(names))
    before, runs, track = (
        100 * np.where(std > 0, std, np.nan) / size for std in (found.before, found.runs, found.track)
    )
    axes.hlines(rows, np.fmin(before, track), np.fmax(before, track), color=GREY, linewidth=1.0)
    axes.plot(before, rows, "s", color="white", markeredgecolor=BLACK, label="before")
    axes.plot(runs, rows, "D", color=PRIMITIVE, markersize=5, label="after the runs alone")
    axes.plot(track, rows, "o", color=BLUE, label="after the whole track")
    axes.set_xscale("log")
    axes.set_yticks(rows, names)
    axes.invert_yaxis()
    axes.set_xlabel("standard deviation, % of the parameter (where it is 0: of the one before)")
    axes.xaxis.label.set_fontsize(9)
    round_ticks(axes)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=9, columnspacing=1.0)
    light_grid(axes, "x")
    return svg(figure, key="uncertainty", label="Standard deviation of every parameter before and after the trial")


def parameter_size(content: ReportContent) -> Array:
    """(p,) reference for standard deviations: the value, the prior where that is zero, else 1."""
    model = content.vessel.model
    nominal = dict(zip(model.names, np.abs(model.parameters).tolist(), strict=True))
    values = np.array([nominal[name] for name in content.parameters])
    prior = content.parameter_std
    return np.where(values > 0, values, np.where(prior > 0, prior, 1.0))


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


Panel = tuple[str, tuple[str, ...], Array]
"""Title, names and values (k, n) of signals that share an axis."""


def _motion_panels(plan: Plan) -> tuple[Panel, ...]:
    u, v, r = plan.trajectory.velocity.T
    speeds = np.stack([u, v], axis=1)
    return (
        ("velocity over\nground [m/s]", ("u ahead", "v to starboard"), speeds),
        ("yaw rate [\N{DEGREE SIGN}/s]", ("r",), np.degrees(r)[:, None]),
    )


def _command_panels(plan: Plan) -> tuple[Panel, ...]:
    grouped: dict[str, list[tuple[str, Array]]] = {}
    for name in plan.commands.names:
        title, factor = GROUPS.get(stem(name), (plain(name), 1.0))
        grouped.setdefault(title, []).append((name, plan.commands.column(name) * factor))
    grouped = {
        title: [(name, _within_a_turn(values)) for name, values in signals] if title == GROUPS["a"][0] else signals
        for title, signals in grouped.items()
    }
    return tuple(
        (title, tuple(name for name, _ in signals), np.stack([values for _, values in signals], axis=1))
        for title, signals in grouped.items()
    )


def _within_a_turn(degrees: Array) -> Array:
    """Angles of thrusters that turn round and round, from -180 to 180, with gaps where they pass there."""
    wrapped = (degrees + 180.0) % 360.0 - 180.0
    wrapped[1:][np.abs(np.diff(wrapped)) > 180.0] = np.nan
    return wrapped


def _draw(axes: Axes, panel: Panel, sample_time_s: float) -> None:
    title, names, values = panel
    time_min = np.arange(len(values)) * sample_time_s / 60
    for name, column, colour in zip(names, values.T, LINES * len(names), strict=False):
        axes.plot(time_min, column, color=colour, linewidth=1.1, label=short(name))  # thinned where straight
    axes.set_ylabel(title, fontsize=9)
    if len(names) > 1:
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
        if middle - last < NUMBER_GAP * plan.commands.duration_s / 60:
            continue  # numbers of runs too short to be told apart here
        last = middle
        axes.annotate(
            str(run.number), (middle, 1.0), (0, 3), xycoords=("data", "axes fraction"),
            textcoords="offset points", ha="center", fontsize=9, fontweight="bold", color=PRIMITIVE,
        )  # fmt: skip


LEAST_SPAN = {"u [m/s]": 0.2, "v [m/s]": 0.2, "r [\N{DEGREE SIGN}/s]": 0.2}
"""Axes show at least this much, so that rounding errors do not look like motion."""
SIZE_IN = (5.2, 3.3)
PATH_BOX = (0.125, 0.15, 0.335, 0.82)  # place of the path's axes: left, bottom, width, height, as shares of the figure
CURVE_BOXES = tuple((0.655, bottom, 0.33, 0.235) for bottom in (0.735, 0.4425, 0.15))


@page_figure
def primitive_figure(primitive: Primitive, hull_b: Array, *, number: int) -> str:
    """Path with hull outlines on the left; u, v and r over time on the right, dashed the desired velocities."""
    figure = new_figure(*SIZE_IN, layout=None)  # fixed places: many small figures are drawn much sooner
    _draw_path(figure.add_axes(PATH_BOX), primitive.trajectory.pose, hull_b)
    time_s = primitive.trajectory.time_s
    velocity = primitive.trajectory.velocity * (1.0, 1.0, np.degrees(1.0))
    desired = desired_motion(primitive)
    shown = velocity if desired is None else desired * (1.0, 1.0, np.degrees(1.0))
    rows = [figure.add_axes(box) for box in CURVE_BOXES]
    for axes, values, aim, (name, span) in zip(rows, velocity.T, shown.T, LEAST_SPAN.items(), strict=True):
        axes.axhline(0.0, color=BLACK, linewidth=0.5)
        if desired is not None:
            axes.plot(time_s, aim, color=GREY, linewidth=1.0, linestyle="--")
        axes.plot(time_s, values, color=BLUE, linewidth=1.4)
        axes.set_ylabel(name)
        axes.yaxis.set_label_coords(-0.37, 0.5)
        axes.tick_params(labelsize=9, labelbottom=axes is rows[-1])
        low, high = min(values.min(), aim.min(), 0.0), max(values.max(), aim.max(), 0.0)
        slack = max(span - (high - low), 0.0) / 2 + 0.06 * (high - low)
        axes.set_ylim(low - slack, high + slack)
        axes.locator_params(nbins=4)
        light_grid(axes)
    rows[-1].set_xlabel("time [s]")
    return svg(figure, key=f"primitive-{number}", label=f"Path and velocities of primitive {primitive.name}")


def _draw_path(axes: Axes, pose: Array, hull_b: Array) -> None:
    axes.plot(pose[:, 1], pose[:, 0], color=PRIMITIVE, linewidth=1.6)
    samples = np.linspace(0, len(pose) - 1, HULLS).round().astype(int)
    hulls = [to_n_frame(hull_b, pose[sample]) for sample in samples]
    for corners in hulls:
        axes.fill(corners[:, 1], corners[:, 0], facecolor="none", edgecolor=GREY, linewidth=0.8)
    axes.plot(pose[0, 1], pose[0, 0], "o", color=GREEN, markersize=6)
    places = np.vstack([*hulls, pose[:, :2]])
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    inches = np.array([PATH_BOX[3] * SIZE_IN[1], PATH_BOX[2] * SIZE_IN[0]])
    half = inches * float((np.ptp(places, axis=0) / inches).max()) * 0.54  # metres alike on both axes, with a margin
    axes.set_ylim(middle[0] - half[0], middle[0] + half[0])
    axes.set_xlim(middle[1] - half[1], middle[1] + half[1])
    axes.set_xlabel("starboard [m]")
    axes.set_ylabel("ahead [m]")
    axes.yaxis.set_label_coords(-0.27, 0.5)
    axes.tick_params(labelsize=9)
    axes.locator_params(nbins=4)
    light_grid(axes)
