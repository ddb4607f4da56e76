"""Results of a step trial: JSON, sentences, tables and a page."""

from expdesign.export.step_trial_page.content import (
    REPEAT_HEADER,
    StepTrialContent,
    Validated,
    nominal_rows,
    repeat_rows,
    sentences,
    step_model_json,
)
from expdesign.export.step_trial_page.page import step_trial_html

__all__ = [
    "REPEAT_HEADER",
    "StepTrialContent",
    "Validated",
    "nominal_rows",
    "repeat_rows",
    "sentences",
    "step_model_json",
    "step_trial_html",
]
