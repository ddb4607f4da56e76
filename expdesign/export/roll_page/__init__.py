"""Results of roll identification: JSON, sentences, tables and a page."""

from expdesign.export.roll_page.content import (
    CURE_HEADER,
    PARAMETER_HEADER,
    RollContent,
    cure_rows,
    parameter_rows,
    roll_html,
    roll_json,
    roll_sentences,
)

__all__ = [
    "CURE_HEADER",
    "PARAMETER_HEADER",
    "RollContent",
    "cure_rows",
    "parameter_rows",
    "roll_html",
    "roll_json",
    "roll_sentences",
]
