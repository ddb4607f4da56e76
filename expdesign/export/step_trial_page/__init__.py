"""Results of a step trial: JSON, sentences and a document."""

from expdesign.export.step_trial_page.content import (
    REPEAT_HEADER,
    StepTrialContent,
    Validated,
    nominal_rows,
    repeat_rows,
    sentences,
    step_model_json,
    to_repeat,
)
from expdesign.export.step_trial_page.live import (
    TO_DO_HEADER,
    LiveContent,
    event_line,
    live_json,
    live_sentences,
    to_do_csv,
    to_do_table,
)
from expdesign.export.step_trial_page.page import step_trial_document
