"""Missions of autopilots: QGroundControl plans with speeds and a geofence, and ArduPilot's `QGC WPL 110`.

The route is a list of MAVLink mission commands. Speed over ground is ordered before the waypoint it leads to, and again
only when it changes; a stay is a hold time. An autopilot that follows waypoints cannot steer a zig-zag: runs are
steered by commands.csv. ArduPilot's file has twelve fields with tabs between them, item 0 is home; it has neither names
nor a fence.

Source: MAVLink common message set: MAV_CMD_NAV_WAYPOINT (16), MAV_CMD_DO_CHANGE_SPEED (178); MAVLink developer guide,
file formats, plain-text missions; QGroundControl developer guide, plan file format: Plan version 1, mission 2, geofence
2, rally points 2; MAV_TYPE_SURFACE_BOAT (11), MAV_AUTOPILOT_ARDUPILOTMEGA (3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from expdesign.export.files import strict_json
from expdesign.export.formats.format import Format, degrees, route_file
from expdesign.export.routes import Route

NAV_WAYPOINT, DO_CHANGE_SPEED = 16, 178
GLOBAL, MISSION, GLOBAL_RELATIVE_ALT = 0, 2, 3  # frames of a mission item
GROUND_SPEED = 1.0
THROTTLE_UNCHANGED = -1.0
SLOWEST_MPS = 0.01


@dataclass(frozen=True)
class MissionItem:
    """One command."""

    command: int  # number of the MAV_CMD
    frame: int  # number of the MAV_FRAME
    parameters: tuple[float, float, float, float]  # the first four
    # lat_deg, lon_deg: or zeros where the command has no place
    lat_deg: float = 0.0
    lon_deg: float = 0.0


def mission(route: Route) -> list[MissionItem]:
    """Commands from the first waypoint to the last."""
    items: list[MissionItem] = []
    ordered = -1.0
    for number, waypoint in enumerate(route.waypoints):
        desired = round(max(waypoint.speed_mps, SLOWEST_MPS), 3)
        if number and desired != ordered:
            ordered = desired
            items.append(MissionItem(DO_CHANGE_SPEED, MISSION, (GROUND_SPEED, desired, THROTTLE_UNCHANGED, 0.0)))
        hold = (round(waypoint.stay_s, 3), 0.0, 0.0, 0.0)
        items.append(MissionItem(NAV_WAYPOINT, GLOBAL_RELATIVE_ALT, hold, waypoint.lat_deg, waypoint.lon_deg))
    return items


ARDUPILOT, SURFACE_BOAT = 3, 11
FENCE_VERSION, MISSION_VERSION, RALLY_VERSION = 2, 2, 2


def write_plan(route: Route) -> bytes:
    """One plan; without a fence where the chart was not at hand."""
    first = route.waypoints[0]
    speed = round(route.speed_mps, 3)
    return strict_json(
        {
            "fileType": "Plan",
            "version": 1,
            "groundStation": "expdesign",
            "mission": {
                "version": MISSION_VERSION,
                "firmwareType": ARDUPILOT,
                "vehicleType": SURFACE_BOAT,
                "cruiseSpeed": speed,
                "hoverSpeed": speed,
                "globalPlanAltitudeMode": 1,
                "plannedHomePosition": [first.lat_deg, first.lon_deg, 0],
                "items": [_item(number, item) for number, item in enumerate(mission(route), start=1)],
            },
            "geoFence": {"version": FENCE_VERSION, "circles": [], "polygons": _polygons(route)},
            "rallyPoints": {"version": RALLY_VERSION, "points": []},
        }
    ).encode()


def _item(number: int, item: MissionItem) -> dict[str, Any]:
    return {
        "type": "SimpleItem",
        "autoContinue": True,
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [*item.parameters, item.lat_deg, item.lon_deg, 0],
    }


def _polygons(route: Route) -> list[dict[str, Any]]:
    if route.fence is None:
        return []
    rings = [(True, route.fence.inside), *((False, ring) for ring in route.fence.outside)]
    return [{"version": 1, "inclusion": inside, "polygon": [list(corner) for corner in ring]} for inside, ring in rings]


PLAN = Format(
    name="qgc", file_name=route_file("plan"), summary="QGroundControl plan with speeds and fence", write=write_plan
)
HEADER = "QGC WPL 110"


def write_waypoints(route: Route) -> bytes:
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


WAYPOINTS = Format(
    name="ardupilot",
    file_name=route_file("waypoints"),
    summary="ArduPilot mission (QGC WPL 110)",
    write=write_waypoints,
)
