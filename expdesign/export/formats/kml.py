"""KML 2.2 for earth browsers: lines by leg, waypoints, and the water to stay in; longitude first.

Source: OGC 07-147r2, KML 2.2.
"""

from __future__ import annotations

from itertools import groupby, pairwise

from lxml import etree

from expdesign.export.formats.format import Format, corridor_sentence, degrees, leg_sentence, route_file, xml_text
from expdesign.export.formats.geojson import crosses_antimeridian, cut_at_antimeridian
from expdesign.export.routes import Route, Waypoint

KML = "http://www.opengis.net/kml/2.2"
COLOURS = {"primitive": "ff005ed5", "reposition": "ffb27200"}
"""Kind of leg -> alpha, blue, green, red: vermilion and blue, which colour-blind readers tell apart."""
Positions = list[tuple[float, float]]


def write(route: Route) -> bytes:
    """One document with a folder of legs, one of waypoints, and the allowed water."""
    root = etree.Element(f"{{{KML}}}kml", nsmap={None: KML})
    document = _add(root, "Document")
    _text(document, "name", route.scenario)
    _text(document, "description", f"{route.vessel}; manoeuvres are executed with commands.csv. Not for navigation.")
    for kind, colour in COLOURS.items():
        style = _add(document, "Style", id=kind)
        line = _add(style, "LineStyle")
        _text(line, "color", colour)
        _text(line, "width", "4" if kind == "primitive" else "2")
    area = _add(document, "Style", id="water")
    _text(_add(area, "PolyStyle"), "color", "33ffb060")
    _add_water(document, route)
    legs = _folder(document, "legs")
    for _, chords in groupby(pairwise(route.waypoints), key=lambda chord: chord[1].leg):
        _add_leg(legs, list(chords))
    points = _folder(document, "waypoints")
    for waypoint in route.waypoints:
        _add_point(points, route, waypoint)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _add_leg(folder: etree._Element, chords: list[tuple[Waypoint, Waypoint]]) -> None:
    end = chords[-1][1]
    places = [chords[0][0], *(chord[1] for chord in chords)]
    place = _placemark(folder, leg_sentence(end), style=end.leg_kind)
    parts = cut_at_antimeridian([(waypoint.lon_deg, waypoint.lat_deg) for waypoint in places])
    parent = place if len(parts) == 1 else _add(place, "MultiGeometry")
    for part in parts:
        line = _add(parent, "LineString")
        _text(line, "tessellate", "1")
        _text(line, "coordinates", _coordinates(part))


def _add_point(folder: etree._Element, route: Route, waypoint: Waypoint) -> None:
    place = _placemark(folder, waypoint.name)
    _text(place, "description", f"{leg_sentence(waypoint)}; {corridor_sentence(waypoint)}")
    time = route.utc(waypoint.time_s)
    if time is not None:
        _text(_add(place, "TimeStamp"), "when", time)
    data = _add(place, "ExtendedData")
    for key, value in (
        ("time_s", f"{waypoint.time_s:.10g}"),
        ("stay_s", f"{waypoint.stay_s:.10g}"),
        ("speed_mps", f"{waypoint.speed_mps:.4f}"),
        ("xtd_m", f"{route.xtd_m:.4f}"),
        ("xtd_port_m", f"{waypoint.xtd_port_m:.4f}"),
        ("xtd_starboard_m", f"{waypoint.xtd_starboard_m:.4f}"),
    ):
        _text(_add(data, "Data", name=key), "value", value)
    _text(_add(place, "Point"), "coordinates", _coordinates([(waypoint.lon_deg, waypoint.lat_deg)]))


def _add_water(document: etree._Element, route: Route) -> None:
    if route.fence is None or crosses_antimeridian(route.fence.inside):
        return
    polygon = _add(_placemark(document, "allowed water", style="water"), "Polygon")
    for side, rings in (("outerBoundaryIs", [route.fence.inside]), ("innerBoundaryIs", route.fence.outside)):
        for ring in rings:
            closed = [(lon, lat) for lat, lon in (*ring, ring[0])]
            _text(_add(_add(polygon, side), "LinearRing"), "coordinates", _coordinates(closed))


def _folder(parent: etree._Element, name: str) -> etree._Element:
    folder = _add(parent, "Folder")
    _text(folder, "name", name)
    return folder


def _placemark(parent: etree._Element, name: str, *, style: str = "") -> etree._Element:
    place = _add(parent, "Placemark")
    _text(place, "name", name)
    if style:
        _text(place, "styleUrl", f"#{style}")
    return place


def _coordinates(positions: Positions) -> str:
    return " ".join(f"{degrees(lon)},{degrees(lat)},0" for lon, lat in positions)


def _add(parent: etree._Element, tag: str, /, **attributes: str) -> etree._Element:
    return etree.SubElement(parent, f"{{{KML}}}{tag}", attributes)


def _text(parent: etree._Element, tag: str, text: str) -> None:
    _add(parent, tag).text = xml_text(text)


FORMAT = Format(name="kml", file_name=route_file("kml"), summary="KML 2.2 for earth browsers", write=write)
