"""Distribution of the errors of each design, and observed against predicted standard deviations."""

from __future__ import annotations

import numpy as np

from expdesign.export.pages.figures import BLUE, GREY, LINES, VERMILION, light_grid, new_figure, plain, round_ticks, svg
from expdesign.export.validation_page.content import ERROR_LIMIT, chance
from expdesign.rehearsal import Validated


def error_figure(results: tuple[Validated, ...]) -> str:
    """Share of trials below each normalised error, one line per design."""
    figure = new_figure(6.4, 3.4)
    axes = figure.subplots()
    for result, colour in zip(results, LINES, strict=False):
        errors = np.sort(result.errors)
        share = np.arange(1, len(errors) + 1) / len(errors)
        axes.step(errors, 100 * share, where="post", color=colour, label=plain(result.design))
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    if low < ERROR_LIMIT < high:
        axes.axvline(ERROR_LIMIT, color=GREY, linewidth=0.8, linestyle="--", label=f"good below {ERROR_LIMIT:g}")
    round_ticks(axes)
    axes.set_xlabel("error of a trial, relative to the true parameters")
    axes.set_ylabel("trials below [%]")
    axes.set_ylim(0, 101)
    axes.legend(loc="upper left", fontsize=9)
    light_grid(axes)
    return svg(figure, key="errors", label="Share of simulated trials below each normalised error, by design")


def spread_figure(result: Validated) -> str:
    """Observed over predicted standard deviation of each parameter, with its sampling error."""
    names = [plain(name) for name in result.parameters]
    figure = new_figure(6.4, 1.1 + 0.26 * len(names))
    axes = figure.subplots()
    rows = np.arange(len(names))
    axes.axvline(1.0, color="black", linewidth=1.0)
    error = 1.96 * chance(result)
    for ratio, marker, colour, label in (
        (result.found / result.theory, "o", BLUE, "predicted with the true ship"),
        (result.found / result.forecast, "D", VERMILION, "forecast with the nominal model"),
    ):
        shift = -0.12 if marker == "o" else 0.12
        axes.errorbar(
            ratio, rows + shift, xerr=error * ratio, fmt=marker, color=colour, markersize=5, label=label, linewidth=1
        )
    axes.set_yticks(rows, names)
    axes.invert_yaxis()
    axes.set_xscale("log")
    round_ticks(axes)
    axes.set_xlabel("standard deviation, observed / predicted")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=9)
    light_grid(axes, "x")
    return svg(figure, key="spread", label="Observed over predicted standard deviation of each parameter")
