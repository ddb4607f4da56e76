"""RTZ 1.0, 1.1 and 1.2, the route exchange format of ECDIS: distances in nautical miles, speeds in knots.

A leg describes the way *to* its waypoint, so the first waypoint has none. Legs are rhumb lines (`Loxodrome`). The route
is named after its file, which ECDIS expect. The versions differ in the name of schedule elements, which 1.0 misspells,
and in how a stay is written: a time of day in 1.0, which cannot say a day or more, a duration from 1.1 on.

Source: IEC 61174, annex on the route plan exchange format, schemas 1.0 (2015), 1.1, 1.2.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lxml import etree

from expdesign.conventions import KNOTS_PER_MPS, METRES_PER_NAUTICAL_MILE
from expdesign.errors import InputError
from expdesign.export.formats.format import Format, degrees, leg_sentence, named_file, route_file, xml_text
from expdesign.export.routes import Route, Waypoint

SPACE = "http://www.cirm.org/RTZ/{}/{}"
VERSIONS = ("1.0", "1.1", "1.2")
LARGEST_FILE = 400_000  # bytes that an ECDIS must accept
DAY_S = 86400.0


def rtz_writer(version: str, file_name: str) -> Callable[[Route], bytes]:
    """A function that writes one version."""

    def write(route: Route) -> bytes:
        """Waypoints and one manual schedule: speeds, and times when the departure is fixed.

        Raises:
            InputError: the file is larger than an ECDIS must accept.
        """
        return _written(route, version, file_name)

    return write


def _written(route: Route, version: str, file_name: str) -> bytes:
    space = SPACE.format(*version.split("."))
    root = etree.Element(f"{{{space}}}route", nsmap={None: space}, version=version)
    names = {"routeName": Path(named_file(file_name, route)).stem, "vesselName": xml_text(route.vessel)}
    _add(root, "routeInfo", **names, routeAuthor="expdesign", routeStatus="trial plan, to be checked on board")
    waypoints = _add(root, "waypoints")
    for number, waypoint in enumerate(route.waypoints, start=1):
        _add_waypoint(waypoints, number, waypoint)
    manual = _add(_add(_add(root, "schedules"), "schedule", id="1", name=xml_text(route.scenario)), "manual")
    element = "sheduleElement" if version == "1.0" else "scheduleElement"
    for number, waypoint in enumerate(route.waypoints, start=1):
        _add(manual, element, waypointId=str(number), **_schedule(route, waypoint, version, first=number == 1))
    content = bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))
    if len(content) >= LARGEST_FILE:
        raise InputError(
            f"{file_name} has {len(content)} bytes with {len(route.waypoints)} waypoints, expected less than "
            f"{LARGEST_FILE}: a larger tolerance than {route.xtd_m:.1f} m gives fewer waypoints"
        )
    return content


def _add_waypoint(parent: etree._Element, number: int, waypoint: Waypoint) -> None:
    element = _add(parent, "waypoint", id=str(number), revision="0", name=waypoint.name)
    _add(element, "position", lat=degrees(waypoint.lat_deg), lon=degrees(waypoint.lon_deg))
    if number > 1:
        port, starboard = (
            f"{side / METRES_PER_NAUTICAL_MILE:.4f}" for side in (waypoint.xtd_port_m, waypoint.xtd_starboard_m)
        )
        sentence = xml_text(leg_sentence(waypoint))
        _add(element, "leg", starboardXTD=starboard, portsideXTD=port, geometryType="Loxodrome", legInfo=sentence)


def _schedule(route: Route, waypoint: Waypoint, version: str, *, first: bool) -> dict[str, str]:
    entry: dict[str, str] = {}
    arrival, departure = route.utc(waypoint.time_s), route.utc(waypoint.time_s + waypoint.stay_s)
    if departure is not None and (first or waypoint.stay_s > 0):
        entry["etd"] = departure
    if arrival is not None and not first:
        entry["eta"] = arrival
    if waypoint.stay_s > 0 and (version != "1.0" or waypoint.stay_s < DAY_S - 1):
        entry["stay"] = _time_of_day(waypoint.stay_s) if version == "1.0" else f"PT{waypoint.stay_s:.10g}S"
    if not first:
        entry["speed"] = f"{waypoint.speed_mps * KNOTS_PER_MPS:.3f}"
    return entry


def _time_of_day(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def _add(parent: etree._Element, tag: str, /, **attributes: str) -> etree._Element:
    space = etree.QName(parent).namespace
    return etree.SubElement(parent, f"{{{space}}}{tag}", attributes)


def _format(name: str, version: str, file_name: str) -> Format:
    return Format(
        name=name, file_name=file_name, summary=f"RTZ {version} route for ECDIS", write=rtz_writer(version, file_name)
    )


FORMAT = _format("rtz", "1.2", route_file("rtz"))
OLDER = tuple(_format(f"rtz-{v}", v, f"route-rtz{v.replace('.', '')}.rtz") for v in VERSIONS[:-1])
