"""GPX 1.1 route with the extensions that OpenCPN reads: planned speeds in knots, arrival radius in nautical miles.

Source: GPX 1.1 schema (Topografix 2004); OpenCPN's extensions as in its route files. A planned speed belongs
to the chord that ends at its point.
"""

from __future__ import annotations

from lxml import etree

from expdesign.conventions import KNOTS_PER_MPS, METRES_PER_NAUTICAL_MILE
from expdesign.export.formats.format import Format, corridor_sentence, degrees, leg_sentence, route_file, xml_text
from expdesign.export.routes import ROUTE_NAME, Route, Waypoint

GPX = "http://www.topografix.com/GPX/1/1"
OPENCPN = "http://www.opencpn.org"


def write(route: Route) -> bytes:
    """One route; points carry times only when the departure is fixed."""
    root = etree.Element(f"{{{GPX}}}gpx", nsmap={None: GPX, "opencpn": OPENCPN}, version="1.1", creator="expdesign")
    line = etree.SubElement(root, f"{{{GPX}}}rte")
    _text(line, "name", route.scenario if route.name == ROUTE_NAME else route.name)
    _text(line, "desc", f"{route.scenario}, {route.vessel}; manoeuvres are executed with commands.csv")
    extensions = etree.SubElement(line, f"{{{GPX}}}extensions")
    _extension(extensions, "planned_speed", f"{route.speed_mps * KNOTS_PER_MPS:.3f}")
    departure = route.utc(0.0)
    if departure is not None:
        _extension(extensions, "planned_departure", departure)
    for waypoint in route.waypoints:
        _add_point(line, route, waypoint)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _add_point(line: etree._Element, route: Route, waypoint: Waypoint) -> None:
    place = {"lat": degrees(waypoint.lat_deg), "lon": degrees(waypoint.lon_deg)}
    point = etree.SubElement(line, f"{{{GPX}}}rtept", place)
    time = route.utc(waypoint.time_s)
    if time is not None:
        _text(point, "time", time)
    _text(point, "name", waypoint.name)
    _text(point, "desc", f"{leg_sentence(waypoint)}; {corridor_sentence(waypoint)}")
    _text(point, "type", "WPT")
    extensions = etree.SubElement(point, f"{{{GPX}}}extensions")
    radius_m = min(waypoint.xtd_port_m, waypoint.xtd_starboard_m)
    _extension(extensions, "arrival_radius", f"{radius_m / METRES_PER_NAUTICAL_MILE:.4f}")
    speed = etree.SubElement(extensions, f"{{{OPENCPN}}}rte_properties")
    speed.set("planned_speed", f"{waypoint.speed_mps * KNOTS_PER_MPS:.3f}")


def _text(parent: etree._Element, name: str, text: str) -> None:
    etree.SubElement(parent, f"{{{GPX}}}{name}").text = xml_text(text)


def _extension(parent: etree._Element, name: str, text: str) -> None:
    etree.SubElement(parent, f"{{{OPENCPN}}}{name}").text = text


FORMAT = Format(
    name="gpx", file_name=route_file("gpx"), summary="GPX 1.1 route for plotters, with OpenCPN speeds", write=write
)
