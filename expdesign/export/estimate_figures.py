"""Measured against simulated velocities, residuals over time, and their autocorrelation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from expdesign.assessment import Assessed, RunCheck
from expdesign.conventions import OUTPUTS
from expdesign.export.pages.figures import BLUE, GREY, LINES, light_grid, new_figure, page_figure, plain, svg
from expdesign.values import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINE_POINTS = 500  # points per line: more cannot be told apart at this size
SHOWN_BEYOND = 0.6  # share of the measured range that is shown beyond it; simulations that leave it are cut off
AXES = {
    "u": ("u [m/s]", 1.0),
    "v": ("v [m/s]", 1.0),
    "r": ("r [\N{DEGREE SIGN}/s]", float(np.degrees(1.0))),
}
"""Output -> label of its axis and factor to the unit shown."""


@page_figure
def run_figure(index: int, methods: tuple[Assessed, ...]) -> str:
    """One run: every output measured (thick, grey) and simulated by each method."""
    checks = [item.runs[index] for item in methods]
    run = checks[0]
    figure = new_figure(7.2, 0.7 + 1.3 * len(run.outputs))
    rows = np.atleast_1d(figure.subplots(len(run.outputs), 1, sharex=True))
    for axes, output in zip(rows, run.outputs, strict=True):
        _draw_output(axes, output, checks, [item.method.name for item in methods])
    if len(run.outputs):
        rows[0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, fontsize=8)
    rows[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    return svg(figure, key=f"run{index}", label=f"{run.batch.name}: measured and simulated velocities over time")


def _draw_output(axes: Axes, output: str, checks: list[RunCheck], names: list[str]) -> None:
    label, factor = AXES[output]
    column, batch = OUTPUTS.index(output), checks[0].batch
    measured = factor * batch.velocity[:, column]
    axes.plot(*thinned(batch.time_s, measured), color="#b0b0b0", linewidth=2.6, label="measured")
    for check, name, colour in zip(checks, names, LINES, strict=False):
        if check.simulated is not None:
            simulated = factor * check.simulated[:, column]
            axes.plot(*thinned(batch.time_s, simulated), color=colour, linewidth=1.0, label=plain(f"simulated, {name}"))
    low, high = np.nanmin(measured), np.nanmax(measured)
    room = SHOWN_BEYOND * (high - low) or 1.0
    bottom, top = axes.get_ylim()
    axes.set_ylim(max(bottom, low - room), min(top, high + room))
    axes.set_ylabel(label, fontsize=9)
    light_grid(axes)


def thinned(time: Array, values: Array) -> tuple[Array, Array]:
    """About `LINE_POINTS` points at most, with the highest and the lowest of every stretch among them."""
    stretch = -(-2 * len(values) // LINE_POINTS)
    if stretch < 3:
        return time, values
    kept = []
    for start in range(0, len(values), stretch):
        part = values[start : start + stretch]
        if np.isfinite(part).any():
            kept += sorted({start + int(np.nanargmin(part)), start + int(np.nanargmax(part))})
        else:
            kept.append(start)
    return time[kept], values[kept]


@page_figure
def residual_figure(item: Assessed, runs: tuple[str, ...], sample_time_s: float) -> str:
    """One-step residuals of all runs, one after the other."""
    found = item.one_step
    figure = new_figure(7.2, 0.6 + 1.3 * len(found.outputs))
    rows = np.atleast_1d(figure.subplots(len(found.outputs), 1, sharex=True))
    minutes = np.arange(len(found.residuals)) * sample_time_s / 60
    for axes, output, values in zip(rows, found.outputs, found.residuals.T, strict=True):
        label, factor = AXES[output]
        axes.plot(*thinned(minutes, factor * values / sample_time_s), color=BLUE, linewidth=0.7)
        for edge in np.flatnonzero(np.diff(found.batch)) + 1:
            axes.axvline(minutes[edge], color=GREY, linewidth=0.8, linestyle=":")
        axes.set_ylabel(f"{label.split()[0]} [{label.split('[')[1].split('/')[0]}/s\N{SUPERSCRIPT TWO}]", fontsize=9)
        light_grid(axes)
    rows[-1].set_xlabel("time, runs concatenated [min]")
    figure.align_ylabels()
    return svg(figure, key="residuals", label=f"One-step residuals over the time of {len(runs)} runs")


@page_figure
def autocorrelation_figure(item: Assessed, sample_time_s: float) -> str:
    """Autocorrelation of the residuals of every output, with the band that white ones would keep to."""
    found = item.one_step
    figure = new_figure(7.2, 2.2)
    columns = np.atleast_1d(figure.subplots(1, len(found.outputs), sharey=True))
    seconds = np.arange(len(found.autocorrelation)) * sample_time_s
    for axes, output, values in zip(columns, found.outputs, found.autocorrelation.T, strict=True):
        axes.axhspan(-found.white_band, found.white_band, color=GREY, alpha=0.25, linewidth=0)
        axes.vlines(seconds, 0, values, color=BLUE, linewidth=1.2)
        axes.plot(seconds, values, "o", color=BLUE, markersize=2.5)
        axes.set_title(output)
        axes.set_xlabel("lag [s]")
        axes.set_ylim(-1.05, 1.05)
        light_grid(axes)
    return svg(figure, key="autocorrelation", label="Autocorrelation of the one-step residuals")


@page_figure
def interval_figure(methods: tuple[Assessed, ...], best: Assessed) -> str:
    """Every estimate with its 95 % interval, relative to the value in the vessel file."""
    names = best.estimate.names
    figure = new_figure(7.2, 1.0 + 0.3 * len(names))
    axes = figure.subplots()
    for place, (item, colour) in enumerate(zip(methods, LINES * len(methods), strict=False)):
        shift = 0.6 * ((place + 0.5) / len(methods) - 0.5)
        rows = [(row, item.estimate.names.index(name)) for row, name in enumerate(names) if name in item.estimate.names]
        scale = np.abs([best.estimate.value(names[row]) for row, _ in rows])
        sign = np.sign([best.estimate.value(names[row]) for row, _ in rows])
        picked = [index for _, index in rows]
        centre = sign * item.estimate.values[picked] / scale
        half = 1.96 * item.estimate.std[picked] / scale
        y = [row + shift for row, _ in rows]
        axes.errorbar(centre, y, xerr=half, fmt="o", color=colour, markersize=4, elinewidth=1.4, label=item.method.name)
    axes.axvline(0, color="black", linewidth=0.8)
    axes.set_xlim(-1.5, 3.5)
    axes.set_yticks(range(len(names)), [plain(name) for name in names])
    axes.invert_yaxis()
    axes.set_xlabel(f"estimate divided by that of {plain(best.method.name)}; long intervals are cut off at the frame")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, fontsize=8)
    light_grid(axes, "x")
    return svg(figure, key="intervals", label="Estimates of all methods with 95 % intervals")
