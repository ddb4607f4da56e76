"""The page of a load plan."""

from __future__ import annotations

from expdesign.export.load_page.content import (
    CASE_HEADER,
    PRECISION_HEADER,
    STEP_HEADER,
    LoadContent,
    case_rows,
    load_sentences,
    precision_rows,
    step_rows,
)
from expdesign.export.pages import page_template


def load_plan_html(content: LoadContent) -> str:
    """One HTML page without any outside reference."""
    return page_template("expdesign.export.load_page", "load_plan.html").render(
        content=content,
        sentences=load_sentences(content),
        case_header=[name.capitalize() for name in CASE_HEADER],
        case_rows=case_rows(content),
        precision_header=[name.capitalize() for name in PRECISION_HEADER],
        precision_rows=precision_rows(content),
        step_header=[name.capitalize() for name in STEP_HEADER],
        step_rows=step_rows(content),
    )
