"""Measured against simulated before and after, growth of the error, and errors against what is suspected."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis import Diagnosis, Finding
from expdesign.export.estimate_page.figures import AXES, thinned
from expdesign.export.report.figures.style import BLUE, GREY, VERMILION, light_grid, new_figure, plain, svg
from expdesign.values import Array

BINS = 16
MOST_SPREADS = 3.0
"""Errors beyond so many standard deviations of what is measured are not drawn: the simulation is lost."""
DEGREES = float(np.degrees(1.0))


def window_figure(found: Diagnosis, index: int) -> str:
    """One stretch of data: measured, simulated by the model in use, simulated by the extended one."""
    outputs = found.before.outputs
    figure = new_figure(9.0, 0.7 + 1.4 * len(outputs))
    rows = np.atleast_1d(figure.subplots(len(outputs), 1, sharex=True))
    windows = found.windows
    time = np.asarray(windows.sample_s * np.arange(windows.measured.shape[1]), dtype=float)
    for axes, output in zip(rows, outputs, strict=True):
        label, factor = AXES[output]
        column = OUTPUTS.index(output)
        measured = np.asarray(factor * windows.measured[index, :, column], dtype=float)
        axes.plot(*thinned(time, measured), color="#b0b0b0", linewidth=2.6, label="measured")
        for shown, colour, name in (
            (found.simulated_before, VERMILION, "model in use"),
            (found.simulated_after, BLUE, "extended model"),
        ):
            if name == "model in use" or found.findings:
                values = np.asarray(
                    np.where(np.isfinite(measured), factor * shown[index, :, column], np.nan), dtype=float
                )
                axes.plot(*thinned(time, values), color=colour, linewidth=1.1, label=name)
        axes.set_ylabel(label, fontsize=9)
        light_grid(axes)
    rows[0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8)
    rows[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    return svg(figure, key=f"window{index}", label="Measured and simulated velocities over time")


def growth_figure(found: Diagnosis) -> str:
    """Error of the simulation against the time since it started from a measured state."""
    outputs = found.before.outputs
    figure = new_figure(9.0, 2.4)
    columns = np.atleast_1d(figure.subplots(1, len(outputs)))
    for index, (axes, output) in enumerate(zip(columns, outputs, strict=True)):
        label, factor = AXES[output]
        axes.plot(found.before.horizons_s, factor * found.before.growth[:, index], "o-", color=VERMILION,
                  label="model in use", markersize=3.5)  # fmt: skip
        if found.findings:
            axes.plot(found.after.horizons_s, factor * found.after.growth[:, index], "s-", color=BLUE,
                      label="extended model", markersize=3.5)  # fmt: skip
        axes.set_xscale("log")
        axes.set_xticks(found.before.horizons_s, [f"{value:g}" for value in found.before.horizons_s])
        axes.minorticks_off()
        spread = factor * float(np.nanstd(found.windows.measured[..., OUTPUTS.index(output)]))
        _, top = axes.get_ylim()
        axes.set_ylim(0.0, min(top, MOST_SPREADS * spread) if spread > 0 else top)
        axes.set_title(f"error of {label}")
        axes.set_xlabel("time since the start [s]")
        light_grid(axes)
    columns[0].legend(fontsize=8)
    return svg(figure, key="growth", label="Root mean square error of the simulation against its horizon")


def suspect_figure(found: Diagnosis, item: Finding, key: str) -> str:
    """The error without a cause, against the variable that it should depend on."""
    outputs = found.before.outputs
    error = found.errors[item.cause]
    values, label = suspected(found, item.suspect)
    figure = new_figure(9.0, 2.5)
    columns = np.atleast_1d(figure.subplots(1, len(outputs)))
    for axes, output in zip(columns, outputs, strict=True):
        name, factor = AXES[output]
        _scatter(axes, values, factor * error[..., OUTPUTS.index(output)])
        axes.set_title(f"error of {name}")
        axes.set_xlabel(plain(label))
        light_grid(axes)
    return svg(figure, key=key, label=f"Error of the simulation against {label}")


def _scatter(axes: Axes, x: Array, y: Array) -> None:
    """Every sample in grey, means of equal numbers of samples with their spread over windows in colour."""
    seen = np.isfinite(x) & np.isfinite(y)
    a, b = x[seen], y[seen]
    if len(a) == 0:
        return
    step = max(1, len(a) // 1500)
    axes.plot(a[::step], b[::step], ".", color="#c8c8c8", markersize=2, rasterized=False)
    edges = np.unique(np.quantile(a, np.linspace(0, 1, BINS + 1)))
    place = np.clip(np.searchsorted(edges, a, side="right") - 1, 0, max(len(edges) - 2, 0))
    middles = [float(np.mean(a[place == number])) for number in range(len(edges) - 1) if (place == number).any()]
    means = [float(np.mean(b[place == number])) for number in range(len(edges) - 1) if (place == number).any()]
    axes.plot(middles, means, "o-", color=VERMILION, markersize=4, linewidth=1.2)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    low, high = np.quantile(b, [0.005, 0.995])
    axes.set_ylim(low - 0.1 * (high - low + 1e-12), high + 0.1 * (high - low + 1e-12))


def suspected(found: Diagnosis, name: str) -> tuple[Array, str]:
    """(w, s) values of a suspected variable at the compared samples, and its label."""
    windows = found.windows
    every = slice(None, None, windows.steps_per_sample)
    u, v, r = np.moveaxis(windows.measured[..., :3], -1, 0)
    inputs = windows.gather(windows.batch_inputs)[:, every]
    scale = np.maximum(np.std(inputs.reshape(-1, inputs.shape[-1]), axis=0), 1e-12)
    push = inputs[..., 0]
    change = np.zeros_like(push)
    change[:, 1:] = np.abs(np.diff(inputs, axis=1) / scale).sum(axis=2)
    wind = windows.wind[:, every]
    table: dict[str, tuple[Array, str]] = {
        "heading": (DEGREES * (windows.heading[:, every] % (2 * np.pi)), "heading [\N{DEGREE SIGN}]"),
        "wind": (np.hypot(u - wind[..., 0], v - wind[..., 1]), "wind over deck [m/s]"),
        "input": (push, "first input"),
        "thrust": (push, "first input"),
        "small input": (push, "first input"),
        "input change": (_since((change > 0.2).astype(float)) * windows.sample_s, "time since an input changed [s]"),
        "advance": (push * u, "first input times surge speed"),
        "u": (u, "u [m/s]"),
        "r": (DEGREES * r, "r [\N{DEGREE SIGN}/s]"),
        "rate of change": (np.gradient(v, windows.sample_s, axis=1), "rate of change of v [m/s\N{SUPERSCRIPT TWO}]"),
        "term": (u * r, "u r [m/s\N{SUPERSCRIPT TWO}]"),
        "depth": (windows.depth_m[:, every], "water depth [m]"),
        "time": (windows.time_s[:, every] / 60, "time [min]"),
    }
    return table[name]


def _since(events: Array) -> Array:
    """(w, s) samples since the last event."""
    result = np.full(events.shape, np.nan)
    for row, happened in zip(result, events, strict=True):
        last = None
        for index, now in enumerate(happened):
            last = index if now else last
            if last is not None:
                row[index] = index - last
    return result
