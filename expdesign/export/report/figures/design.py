"""Durations with the equivalence theorem, and the information of each primitive about each parameter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from expdesign.durations import DurationDesign
from expdesign.export.pages.figures import BLUE, GREY, PRIMITIVE, light_grid, new_figure, short, svg
from expdesign.export.report.content import ReportContent, relative_information
from expdesign.export.report.tables import shown_names
from expdesign.export.tuning import TUNING

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
    axes.hlines(rows, min(0.0, bound), net, color=GREY, linewidth=0.8)
    axes.plot(net[used], rows[used], "o", color=BLUE, label="used")
    axes.plot(net[~used], rows[~used], "o", color="white", markeredgecolor=BLUE, label="not used")
    low, high = min(0.0, float(net.min())), max(bound, float(net.max()))
    axes.set_xlim(low - 0.12 * (high - low) * (low < 0), high + 0.12 * (high - low))
    axes.set_xlabel("sensitivity minus price" if design.certificate.multipliers else "sensitivity")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=9, columnspacing=1.0)
    light_grid(axes, "x")


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
