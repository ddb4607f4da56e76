"""Results as JSON, CSV and TOML files."""

from typing import TYPE_CHECKING

from expdesign.lazy import load_on_use

if TYPE_CHECKING:
    from expdesign.export.files.design_files import dictionary_json, durations_json
    from expdesign.export.files.dictionary_file import dictionary_files, growth_json
    from expdesign.export.files.disturbances import disturbance_entries, disturbance_table
    from expdesign.export.files.estimate_tables import (
        breach_sentences,
        estimate_warnings,
        failure_rows,
        fit_table,
        limit_table,
        motion_words,
        parameter_table,
        plus_minus,
        prediction_table,
        prediction_title,
        unstable_warning,
    )
    from expdesign.export.files.estimates import (
        estimate_json,
        estimated_vessel,
        fit_entries,
        limit_entries,
        parameter_entries,
        prediction_entries,
        rows_entry,
        steered_entry,
    )
    from expdesign.export.files.known import Known, Purchase, replan_json
    from expdesign.export.files.plan_files import commands_csv, plan_json, track_csv
    from expdesign.export.files.record_file import record_csv
    from expdesign.export.files.recorded_design import recorded_dictionary_json, subsets_json
    from expdesign.export.files.text import finite, strict_json
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
            "design_files": ("dictionary_json", "durations_json"),
            "dictionary_file": ("dictionary_files", "growth_json"),
            "disturbances": ("disturbance_entries", "disturbance_table"),
            "estimate_tables": (
                "breach_sentences",
                "estimate_warnings",
                "failure_rows",
                "fit_table",
                "limit_table",
                "prediction_table",
                "prediction_title",
                "motion_words",
                "parameter_table",
                "plus_minus",
                "unstable_warning",
            ),
            "estimates": (
                "estimate_json",
                "estimated_vessel",
                "prediction_entries",
                "fit_entries",
                "limit_entries",
                "parameter_entries",
                "rows_entry",
                "steered_entry",
            ),
            "known": ("Known", "Purchase", "replan_json"),
            "plan_files": ("commands_csv", "plan_json", "track_csv"),
            "record_file": ("record_csv",),
            "recorded_design": ("recorded_dictionary_json", "subsets_json"),
            "text": ("finite", "strict_json"),
            "vessel_file": ("vessel_toml",),
        },
    )
