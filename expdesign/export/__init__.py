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
        fit_entries,
        fit_table,
        limit_entries,
        limit_table,
        parameter_entries,
        parameter_table,
        plan_json,
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

__all__ = [
    "FORMATS",
    "STANDARD",
    "Content",
    "Format",
    "PlannedTrack",
    "Route",
    "Waypoint",
    "build_bridge_route",
    "build_route",
    "commands_csv",
    "dictionary_json",
    "disturbance_table",
    "durations_json",
    "estimate_json",
    "estimate_warnings",
    "estimated_vessel",
    "find_format",
    "fit_entries",
    "fit_table",
    "limit_entries",
    "limit_table",
    "parameter_entries",
    "parameter_table",
    "plan_json",
    "planned_track",
    "read_plan",
    "route_files",
    "rows_entry",
    "steered_entry",
    "track_csv",
    "vessel_toml",
    "write_files",
]

if not TYPE_CHECKING:
    __getattr__ = load_on_use(
        __name__,
        {
            "files": (
                "commands_csv",
                "dictionary_json",
                "durations_json",
                "estimate_json",
                "estimate_warnings",
                "estimated_vessel",
                "fit_entries",
                "disturbance_table",
                "fit_table",
                "limit_entries",
                "limit_table",
                "parameter_entries",
                "parameter_table",
                "rows_entry",
                "steered_entry",
                "plan_json",
                "track_csv",
                "vessel_toml",
            ),
            "folder": ("Content", "write_files"),
            "formats": ("FORMATS", "STANDARD", "Format", "find_format", "route_files"),
            "routes": (
                "PlannedTrack",
                "Route",
                "Waypoint",
                "build_bridge_route",
                "build_route",
                "planned_track",
                "read_plan",
            ),
        },
    )
