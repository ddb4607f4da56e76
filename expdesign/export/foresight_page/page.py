"""The page on what a diagnosis would find."""

from __future__ import annotations

import numpy as np

from expdesign.export import words
from expdesign.export.foresight_page.content import (
    HEADER,
    NONE,
    ForesightContent,
    conclusions,
    effect_row,
    foresight_rows,
    runs_text,
)
from expdesign.export.pages import page_template
from expdesign.export.pages.figures import (
    BLUE,
    GREY,
    VERMILION,
    light_grid,
    new_figure,
    page_figure,
    plain,
    report_style,
    svg,
)
from expdesign.foresight import Foreseen, Foresight


@page_figure
def power_figure(found: Foresight) -> str:
    """Probability that the test accepts each cause, that held-out runs show it too, and that it is named first."""
    items = [item for item in found.weakest if item.sized]
    figure = new_figure(6.8, 1.1 + 0.26 * len(items))
    axes = figure.subplots()
    rows = np.arange(len(items))
    axes.barh(
        rows, [100 * item.power for item in items], height=0.6, color=BLUE, alpha=0.35, label="accepted by its test"
    )
    axes.barh(rows, [100 * item.found for item in items], height=0.3, color=BLUE, label="found")
    axes.plot([100 * item.named for item in items], rows, "D", color=VERMILION, markersize=5, label="found and first")
    axes.axvline(100 * found.wanted_power, color=GREY, linewidth=0.9, linestyle="--")
    axes.set_yticks(rows, [plain(_name(item)) for item in items])
    axes.invert_yaxis()
    axes.set_xlim(0, 101)
    axes.set_xlabel("probability [%]")
    axes.legend(loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=3, fontsize=9)
    light_grid(axes, "x")
    return svg(figure, key="power", label="Probability that a diagnosis finds each cause, and that it names it first")


def _name(item: Foreseen) -> str:
    return item.cause if item.cause.endswith(f":{item.name}") else f"{item.cause}: {item.name}"


def foresight_html(content: ForesightContent) -> str:
    """One HTML page without any outside reference."""
    found = content.found
    with report_style():
        figure = power_figure(found)
    return page_template("expdesign.export.foresight_page", "foresee.html").render(
        content=content,
        found=found,
        figure=figure,
        lasts=words.duration(found.duration_s),
        conclusions=conclusions(found),
        header=HEADER[:-1],
        rows=[row[:-1] for row in foresight_rows(found)],
        pairs=_pairs(found),
        together=None if found.together is None else runs_text(found.together),
        every=[_every(item) for item in found.effects],
    )


def _every(item: Foreseen) -> tuple[str, ...]:
    cause, name, size, power, found, _, least, *_ = effect_row(item)
    return (
        cause,
        name,
        size,
        power,
        found,
        item.rule,
        words.significant(item.noncentrality) if item.sized else NONE,
        least,
    )


def _pairs(found: Foresight) -> list[tuple[str, ...]]:
    return [
        (
            f"{item.cause}: {item.name}",
            other.cause,
            words.number(other.cosine, 3),
            words.significant(other.noncentrality),
            words.percent(other.told_apart),
        )
        for item, other in found.not_told_apart
    ]
