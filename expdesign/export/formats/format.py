"""The common type of route formats."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from expdesign.export.routes import DEGREE_DECIMALS, ROUTE_NAME, Route, Waypoint


@dataclass(frozen=True, kw_only=True)
class Format:
    """A file format for routes."""

    name: str  # as on the command line
    file_name: str  # of the file it gives
    summary: str  # one line for the user
    write: Callable[[Route], bytes]  # the file's content


def route_file(extension: str) -> str:
    """File name of the route with an extension."""
    return f"{ROUTE_NAME}.{extension}"


def degrees(angle_deg: float) -> str:
    """A latitude or longitude with the decimals that the route was checked with."""
    return f"{angle_deg:.{DEGREE_DECIMALS}f}"


def xml_text(text: str) -> str:
    """Text without the characters that XML 1.0 does not allow; each becomes a replacement sign."""
    return "".join(sign if _in_xml(ord(sign)) else "\N{REPLACEMENT CHARACTER}" for sign in text)


def _in_xml(code: int) -> bool:
    return code in (0x9, 0xA, 0xD) or 0x20 <= code <= 0xD7FF or 0xE000 <= code <= 0xFFFD or code >= 0x10000


def leg_sentence(waypoint: Waypoint) -> str:
    """Motion of the ship on the leg to the waypoint, and what it does there."""
    what = "primitive" if waypoint.leg_kind == "primitive" else "reposition to"
    held = f"; stay here for {waypoint.held}" if waypoint.held else ""
    return f"leg {waypoint.leg}, {what} {waypoint.leg_name}{held}"


def corridor_sentence(waypoint: Waypoint) -> str:
    """How far from the leg to the waypoint the track goes."""
    return f"keep within {waypoint.xtd_port_m:.0f} m to port and {waypoint.xtd_starboard_m:.0f} m to starboard"


def named_file(file_name: str, route: Route) -> str:
    """The file name of a format for a route with a name of its own."""
    return file_name.replace(ROUTE_NAME, route.name, 1)
