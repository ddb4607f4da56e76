"""The route as a list of MAVLink mission commands, for the file formats of autopilots.

Speed over ground is ordered before the waypoint it leads to, and again only when it changes; a stay is a hold time.
An autopilot that follows waypoints cannot steer a zig-zag: runs are steered by commands.csv.

Source: MAVLink common message set: MAV_CMD_NAV_WAYPOINT (16), MAV_CMD_DO_CHANGE_SPEED (178).
"""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.export.routes import Route

NAV_WAYPOINT, DO_CHANGE_SPEED = 16, 178
GLOBAL, MISSION, GLOBAL_RELATIVE_ALT = 0, 2, 3
"""Frames of a mission item."""
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
