"""QGroundControl plan: mission with speeds, and the allowed water as a geofence.

Source: QGroundControl developer guide, plan file format: Plan version 1, mission 2, geofence 2, rally points 2;
MAV_TYPE_SURFACE_BOAT (11), MAV_AUTOPILOT_ARDUPILOTMEGA (3).
"""

from __future__ import annotations

from typing import Any

from expdesign.export.files import strict_json
from expdesign.export.formats.format import Format, route_file
from expdesign.export.formats.mission import MissionItem, mission
from expdesign.export.routes import Route

ARDUPILOT, SURFACE_BOAT = 3, 11
FENCE_VERSION, MISSION_VERSION, RALLY_VERSION = 2, 2, 2


def write(route: Route) -> bytes:
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


FORMAT = Format(
    name="qgc", file_name=route_file("plan"), summary="QGroundControl plan with speeds and fence", write=write
)
