"""Mission file of ArduPilot's ground stations, `QGC WPL 110`: twelve fields with tabs between them, item 0 is home.

It has neither names nor a fence; for the fence take the QGroundControl plan.

Source: MAVLink developer guide, file formats, plain-text missions.
"""

from __future__ import annotations

from expdesign.export.formats.format import Format, degrees, route_file
from expdesign.export.formats.mission import GLOBAL, NAV_WAYPOINT, MissionItem, mission
from expdesign.export.routes import Route

HEADER = "QGC WPL 110"


def write(route: Route) -> bytes:
    """Home at the first waypoint, then the mission."""
    first = route.waypoints[0]
    home = MissionItem(NAV_WAYPOINT, GLOBAL, (0.0, 0.0, 0.0, 0.0), first.lat_deg, first.lon_deg)
    lines = [_line(number, item) for number, item in enumerate((home, *mission(route)))]
    return ("\n".join([HEADER, *lines]) + "\n").encode()


def _line(number: int, item: MissionItem) -> str:
    fields = (
        str(number),
        "1" if number == 0 else "0",
        str(item.frame),
        str(item.command),
        *(f"{value:.8g}" for value in item.parameters),
        degrees(item.lat_deg),
        degrees(item.lon_deg),
        "0",
        "1",
    )
    return "\t".join(fields)


FORMAT = Format(
    name="ardupilot", file_name=route_file("waypoints"), summary="ArduPilot mission (QGC WPL 110)", write=write
)
