"""The page on designs in Monte Carlo trials."""

from __future__ import annotations

import numpy as np

from expdesign.estimation.methods import method_named
from expdesign.export import words
from expdesign.export.pages import page_template
from expdesign.export.pages.figures import (
    BLUE,
    GREY,
    LINES,
    VERMILION,
    light_grid,
    new_figure,
    page_figure,
    plain,
    report_style,
    round_ticks,
    svg,
)
from expdesign.export.validation_page.content import ERROR_LIMIT, ValidationContent, chance, judgements
from expdesign.rehearsal import Validated


@page_figure
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


@page_figure
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


def validation_html(content: ValidationContent) -> str:
    """One HTML page without any outside reference."""
    predicted = next((item for item in content.results if np.isfinite(item.theory).all()), None)
    with report_style():
        figures = {
            "errors": error_figure(content.results),
            "spread": None if predicted is None else spread_figure(predicted),
        }
    return page_template("expdesign.export.validation_page", "validation.html").render(
        content=content,
        judgements=judgements(content),
        designs=[_design_row(content, item) for item in content.results],
        tables=[(item.design, _parameter_rows(item)) for item in content.results],
        predicted=predicted,
        estimator=method_named(content.rehearsal.method).title,
        figures=figures,
    )


def _design_row(content: ValidationContent, result: Validated) -> tuple[str, ...]:
    runs = content.rehearsal.designs[result.design]
    names = [primitive.name for primitive in content.rehearsal.primitives]
    spelled = (
        "random in every trial"
        if runs is None
        else ", ".join(
            f"{count} \N{MULTIPLICATION SIGN} {name}" for name, count in zip(names, runs, strict=True) if count
        )
    )
    return (
        result.design,
        spelled,
        f"{np.median(result.errors):.3g}",
        f"{np.percentile(result.errors, 95):.3g}",
        f"{100 * (result.errors < ERROR_LIMIT).mean():.1f} %",
        str(result.failed),
    )


def _parameter_rows(result: Validated) -> list[tuple[str, ...]]:
    return [
        (
            name,
            _text(result.truth[index]),
            _text(result.bias[index]),
            _text(result.found[index]),
            _text(result.theory[index]),
            _text(result.forecast[index]),
            _text(result.stated[:, index].mean()),
            f"{100 * result.coverage[index]:.0f} %" if np.isfinite(result.truth[index]) else "\N{EN DASH}",
        )
        for index, name in enumerate(result.parameters)
    ]


def _text(value: float) -> str:
    return words.significant(value) if np.isfinite(value) else "\N{EN DASH}"
