"""Durations with the equivalence theorem, information of each primitive, time against accuracy, standard errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from expdesign.durations import DurationDesign
from expdesign.export.pages.figures import (
    BLACK,
    BLUE,
    GREY,
    PRIMITIVE,
    VERMILION,
    light_grid,
    new_figure,
    page_figure,
    round_ticks,
    short,
    svg,
)
from expdesign.export.report.content import ReportContent, relative_information
from expdesign.export.report.parameters import Expected
from expdesign.export.report.tables import shown_names
from expdesign.export.tuning import TUNING
from expdesign.shortest_day import ShortestDay
from expdesign.values import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@page_figure
def durations_figure(content: ReportContent) -> str:
    """Left: time of each primitive, optimal and in whole runs. Right: its sensitivity against the bound."""
    design = content.design
    names = [short(name) for name in shown_names(content).values()]
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
    used, optimal = design.fractions > TUNING.least_fraction, design.durations_s / 60
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
    used, bound = design.fractions > TUNING.least_fraction, design.certificate.level
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
    names = [short(name) for name in shown_names(content).values()]
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
def uncertainty_figure(content: ReportContent, found: Expected) -> str:
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
