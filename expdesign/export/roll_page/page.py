"""The page of roll identification."""

from __future__ import annotations

from expdesign.export.pages import page_template
from expdesign.export.roll_page.content import (
    CURE_HEADER,
    PARAMETER_HEADER,
    SCALED_HEADER,
    RollContent,
    cure_rows,
    parameter_rows,
    roll_sentences,
    scaled_rows,
)


def roll_html(content: RollContent) -> str:
    """One HTML page without any outside reference."""
    return page_template("expdesign.export.roll_page", "roll.html").render(
        content=content,
        sentences=roll_sentences(content),
        parameter_header=[name.capitalize() for name in PARAMETER_HEADER],
        parameter_rows=parameter_rows(content),
        scaled_header=[name.capitalize() for name in SCALED_HEADER],
        scaled_rows=scaled_rows(content),
        cure_header=[name.capitalize() for name in CURE_HEADER],
        cure_rows=cure_rows(content),
    )
