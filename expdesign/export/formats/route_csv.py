"""Waypoints as a table, SI units."""

from __future__ import annotations

import csv
import io

from expdesign.export.formats.format import Format, degrees, route_file
from expdesign.export.routes import Route

COLUMNS = (
    "waypoint",
    "lat_deg",
    "lon_deg",
    "north_m",
    "east_m",
    "time_s",
    "stay_s",
    "speed_mps",
    "xtd_m",
    "leg",
    "leg_kind",
    "leg_name",
    "xtd_port_m",
    "xtd_starboard_m",
    "runs_here",
)


def write(route: Route) -> bytes:
    """The route as CSV with one header row; speed and leg describe the way to the waypoint."""
    text = io.StringIO(newline="")
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for point in route.waypoints:
        table.writerow(
            (
                point.name,
                degrees(point.lat_deg),
                degrees(point.lon_deg),
                f"{point.north_m:.4f}",
                f"{point.east_m:.4f}",
                f"{point.time_s:.10g}",
                f"{point.stay_s:.10g}",
                f"{point.speed_mps:.4f}",
                f"{route.xtd_m:.4f}",
                point.leg,
                point.leg_kind,
                point.leg_name,
                f"{point.xtd_port_m:.4f}",
                f"{point.xtd_starboard_m:.4f}",
                point.held,
            )
        )
    return text.getvalue().encode()


FORMAT = Format(name="csv", file_name=route_file("csv"), summary="table of waypoints in SI units", write=write)
