"""RTZ 1.2, the route exchange format of ECDIS: distances in nautical miles, speeds in knots.

A leg describes the way *to* its waypoint, so the first waypoint has none. Legs are rhumb lines; at the length of a
chord they differ from straight lines in the plan's frame by less than a millimetre.

Source: IEC 61174, annex on the route plan exchange format, schema 1.2.
"""

from __future__ import annotations

from lxml import etree

from expdesign.conventions import KNOTS_PER_MPS, METRES_PER_NAUTICAL_MILE
from expdesign.errors import InputError
from expdesign.export.formats.format import Format, leg_sentence, route_file, xml_text
from expdesign.export.route import Route, Waypoint

RTZ = "http://www.cirm.org/RTZ/1/2"
LARGEST_FILE = 400_000
"""Bytes that an ECDIS must accept."""


def write(route: Route) -> bytes:
    """Waypoints and one manual schedule: speeds, and times when the departure is fixed.

    Raises:
        InputError: the file is larger than an ECDIS must accept.
    """
    root = etree.Element(f"{{{RTZ}}}route", nsmap={None: RTZ}, version="1.2")
    names = {"routeName": xml_text(route.name), "vesselName": xml_text(route.vessel)}
    _add(root, "routeInfo", **names, routeAuthor="expdesign", routeStatus="trial plan, to be checked on board")
    waypoints = _add(root, "waypoints")
    for number, waypoint in enumerate(route.waypoints, start=1):
        _add_waypoint(waypoints, number, waypoint, route)
    manual = _add(_add(_add(root, "schedules"), "schedule", id="1", name=xml_text(route.scenario)), "manual")
    for number, waypoint in enumerate(route.waypoints, start=1):
        _add(manual, "scheduleElement", waypointId=str(number), **_schedule(route, waypoint, first=number == 1))
    content = bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))
    if len(content) >= LARGEST_FILE:
        raise InputError(
            f"route.rtz has {len(content)} bytes with {len(route.waypoints)} waypoints, expected less than "
            f"{LARGEST_FILE}: a larger tolerance than {route.xtd_m:.1f} m gives fewer waypoints"
        )
    return content


def _add_waypoint(parent: etree._Element, number: int, waypoint: Waypoint, route: Route) -> None:
    element = _add(parent, "waypoint", id=str(number), revision="0", name=waypoint.name)
    _add(element, "position", lat=f"{waypoint.lat_deg:.9f}", lon=f"{waypoint.lon_deg:.9f}")
    if number > 1:
        xtd = f"{route.xtd_m / METRES_PER_NAUTICAL_MILE:.4f}"
        sentence = xml_text(leg_sentence(waypoint))
        _add(element, "leg", starboardXTD=xtd, portsideXTD=xtd, geometryType="Loxodrome", legInfo=sentence)


def _schedule(route: Route, waypoint: Waypoint, *, first: bool) -> dict[str, str]:
    entry: dict[str, str] = {}
    arrival, departure = route.utc(waypoint.time_s), route.utc(waypoint.time_s + waypoint.stay_s)
    if departure is not None and (first or waypoint.stay_s > 0):
        entry["etd"] = departure
    if arrival is not None and not first:
        entry["eta"] = arrival
    if waypoint.stay_s > 0:
        entry["stay"] = f"PT{waypoint.stay_s:.10g}S"
    if not first:
        entry["speed"] = f"{waypoint.speed_mps * KNOTS_PER_MPS:.3f}"
    return entry


def _add(parent: etree._Element, tag: str, /, **attributes: str) -> etree._Element:
    return etree.SubElement(parent, f"{{{RTZ}}}{tag}", attributes)


FORMAT = Format(name="rtz", file_name=route_file("rtz"), summary="RTZ 1.2 route for ECDIS", write=write)
