"""Results leave the package here: JSON and CSV, route files, and the report (in `expdesign.export.report`)."""

from typing import TYPE_CHECKING

from expdesign.lazy import load_on_use

if TYPE_CHECKING:
    from expdesign.export.files import (
        commands_csv,
        dictionary_json,
        disturbance_table,
        durations_json,
        estimate_json,
        estimate_warnings,
        estimated_vessel,
        failure_rows,
        fit_entries,
        fit_table,
        limit_entries,
        limit_table,
        parameter_entries,
        parameter_table,
        plan_json,
        prediction_entries,
        prediction_table,
        prediction_title,
        rows_entry,
        steered_entry,
        track_csv,
        vessel_toml,
    )
    from expdesign.export.folder import Content, write_files
    from expdesign.export.formats import FORMATS, STANDARD, Format, find_format, route_files
    from expdesign.export.routes import (
        PlannedTrack,
        Route,
        Waypoint,
        build_bridge_route,
        build_route,
        planned_track,
        read_plan,
    )
else:
    __getattr__, __all__ = load_on_use(__name__, __file__)
