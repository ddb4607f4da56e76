"""Standard deviations before and after, each as a share of the parameter's size."""

from __future__ import annotations

import numpy as np

from expdesign.export.pages.figures import BLACK, BLUE, GREY, PRIMITIVE, light_grid, new_figure, round_ticks, short, svg
from expdesign.export.report.content import ReportContent
from expdesign.export.report.parameters import Expected
from expdesign.values import Array


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
