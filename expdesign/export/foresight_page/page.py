"""The page on what a diagnosis would find."""

from __future__ import annotations

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
from expdesign.export.foresight_page.figures import power_figure
from expdesign.export.pages import page_template
from expdesign.export.pages.figures import report_style
from expdesign.foresight import Foreseen, Foresight


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
