"""Conclusions of a diagnosis: findings, verdict and notes."""

from expdesign.diagnosis.conclusions.findings import (
    error_reductions_of,
    finding_of,
    note_beside_the_same_fit,
    note_on_divergence,
    note_on_nuisance,
    note_on_parameters_alone,
    note_on_predictions,
    note_on_random_current,
    note_on_stretches,
    note_on_unconverged,
    note_on_work,
    notes_on_data,
    notes_on_found_again,
    notes_on_rejected,
)
from expdesign.diagnosis.conclusions.verdict import (
    DIVERGED_FIT,
    accuracy_in_words,
    alternatives,
    doubt,
    has_diverged,
    manoeuvre,
    remarks,
    sign_of,
    unit_name,
    verdict,
)
