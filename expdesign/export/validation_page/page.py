"""The page on designs in Monte Carlo trials."""

from __future__ import annotations

import numpy as np

from expdesign.estimation.methods import method_named
from expdesign.export import words
from expdesign.export.pages import page_template
from expdesign.export.pages.figures import report_style
from expdesign.export.validation_page.content import ERROR_LIMIT, ValidationContent, judgements
from expdesign.export.validation_page.figures import error_figure, spread_figure
from expdesign.rehearsal import Validated


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
