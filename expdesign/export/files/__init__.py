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
    from expdesign.export.files.disturbances import (
        answer_sentence,
        current_sentence,
        disturbance_table,
        unstated_sentences,
    )
    from expdesign.export.files.estimates import (
        breach_sentences,
        estimate_json,
        estimate_values,
        estimated_vessel,
        failure_rows,
        fit_table,
        limit_table,
        motion_words,
        parameter_table,
        prediction_table,
        rows_by_equation,
        unstable_warning,
    )
    from expdesign.export.files.plan_files import (
        Known,
        PlannedAccuracy,
        Purchase,
        commands_csv,
        plan_json,
        planned_accuracy,
        replan_json,
        track_csv,
    )
    from expdesign.export.files.text import (
        entry,
        finite,
        named_finite,
        record_csv,
        strict_json,
        toml_comments,
        toml_table,
        toml_value,
    )
    from expdesign.export.files.vessel_file import vessel_toml
else:
    __getattr__, __all__ = load_on_use(__name__, __file__)
