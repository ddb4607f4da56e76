"""The page about a diagnosis: one self-contained file."""

from expdesign.export.diagnosis_page.page import accuracy_rows, diagnosis_html, diagnosis_notes
from expdesign.export.diagnosis_page.results import (
    RollVerdict,
    diagnosis_json,
    diagnosis_tables,
    extended_vessel,
    roll_sentences,
)
