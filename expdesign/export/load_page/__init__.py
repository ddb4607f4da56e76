"""Results of load plans: JSON, load cases as files, sentences, tables and a page."""

from expdesign.export.load_page.content import (
    CASE_HEADER,
    PRECISION_HEADER,
    STEP_HEADER,
    LoadContent,
    case_rows,
    load_plan_html,
    load_plan_json,
    load_sentences,
    loads_toml,
    precision_rows,
    repeats_json,
    step_rows,
)

__all__ = [
    "CASE_HEADER",
    "PRECISION_HEADER",
    "STEP_HEADER",
    "LoadContent",
    "case_rows",
    "load_plan_html",
    "load_plan_json",
    "load_sentences",
    "loads_toml",
    "precision_rows",
    "repeats_json",
    "step_rows",
]
