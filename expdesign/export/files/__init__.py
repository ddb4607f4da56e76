"""Results as JSON, CSV and TOML files."""

from typing import TYPE_CHECKING

from expdesign.lazy import load_on_use

if TYPE_CHECKING:
    from expdesign.export.files.design_files import (
        dictionary_files,
        dictionary_json,
        durations_json,
        growth_json,
        recorded_dictionary_json,
        subsets_json,
    )
    from expdesign.export.files.estimates import (
        breach_sentences,
        disturbance_entries,
        disturbance_table,
        estimate_json,
        estimate_warnings,
        estimated_vessel,
        failure_rows,
        fit_entries,
        fit_table,
        limit_entries,
        limit_table,
        motion_words,
        parameter_entries,
        parameter_table,
        plus_minus,
        prediction_entries,
        prediction_table,
        prediction_title,
        rows_entry,
        steered_entry,
        unstable_warning,
    )
    from expdesign.export.files.known import Known, Purchase, replan_json
    from expdesign.export.files.plan_files import commands_csv, plan_json, track_csv
    from expdesign.export.files.text import finite, record_csv, strict_json
    from expdesign.export.files.vessel_file import vessel_toml

__all__ = [
    "Known",
    "Purchase",
    "breach_sentences",
    "commands_csv",
    "dictionary_files",
    "dictionary_json",
    "disturbance_entries",
    "disturbance_table",
    "durations_json",
    "estimate_json",
    "estimate_warnings",
    "estimated_vessel",
    "failure_rows",
    "finite",
    "fit_entries",
    "fit_table",
    "growth_json",
    "limit_entries",
    "limit_table",
    "motion_words",
    "parameter_entries",
    "parameter_table",
    "plan_json",
    "plus_minus",
    "prediction_entries",
    "prediction_table",
    "prediction_title",
    "record_csv",
    "recorded_dictionary_json",
    "replan_json",
    "rows_entry",
    "steered_entry",
    "strict_json",
    "subsets_json",
    "track_csv",
    "unstable_warning",
    "vessel_toml",
]

if not TYPE_CHECKING:
    __getattr__ = load_on_use(
        __name__,
        {
            "design_files": (
                "dictionary_files",
                "dictionary_json",
                "durations_json",
                "growth_json",
                "recorded_dictionary_json",
                "subsets_json",
            ),
            "estimates": (
                "breach_sentences",
                "disturbance_entries",
                "disturbance_table",
                "estimate_json",
                "estimate_warnings",
                "estimated_vessel",
                "failure_rows",
                "fit_entries",
                "fit_table",
                "limit_entries",
                "limit_table",
                "motion_words",
                "parameter_entries",
                "parameter_table",
                "plus_minus",
                "prediction_entries",
                "prediction_table",
                "prediction_title",
                "rows_entry",
                "steered_entry",
                "unstable_warning",
            ),
            "known": (
                "Known",
                "Purchase",
                "replan_json",
            ),
            "plan_files": (
                "commands_csv",
                "plan_json",
                "track_csv",
            ),
            "text": (
                "finite",
                "record_csv",
                "strict_json",
            ),
            "vessel_file": ("vessel_toml",),
        },
    )
