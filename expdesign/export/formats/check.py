"""Are RTZ and GPX files fit to be loaded? Rules of the formats, and those that their schemas cannot express.

Meant for files of any origin: document types, entities and outside references are refused, nothing is fetched.

Source: IEC 61174, annex on the route plan exchange format; GPX 1.1 schema (Topografix 2004).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import pyproj
from lxml import etree

from expdesign.errors import FileError
from expdesign.export.formats.gpx import GPX
from expdesign.export.formats.rtz import LARGEST_FILE, SPACE, VERSIONS
from expdesign.input_files import readable

CHILDREN = {
    "route": ("routeInfo", "waypoints", "schedules", "extensions"),
    "routeInfo": ("extensions",),
    "waypoints": ("defaultWaypoint", "waypoint", "extensions"),
    "defaultWaypoint": ("leg", "extensions"),
    "waypoint": ("position", "leg", "extensions"),
    "leg": ("extensions",),
    "position": (),
    "schedules": ("schedule", "extensions"),
    "schedule": ("manual", "calculated", "extensions"),
    "manual": ("scheduleElement", "sheduleElement", "extensions"),
    "calculated": ("scheduleElement", "sheduleElement", "extensions"),
    "scheduleElement": ("extensions",),
    "sheduleElement": ("extensions",),
}
"""Element of RTZ -> allowed children; the content of `extensions` is not checked."""
RANGES = {
    "lat": (-90.0, 90.0, True),
    "lon": (-180.0, 180.0, False),
    "starboardXTD": (0.0, 10.0, False),
    "portsideXTD": (0.0, 10.0, False),
    "speed": (0.0, math.inf, True),
    "speedMin": (0.0, math.inf, True),
    "speedMax": (0.0, math.inf, True),
    "windSpeed": (0.0, math.inf, True),
    "currentSpeed": (0.0, math.inf, True),
    "windDirection": (0.0, 360.0, False),
    "currentDirection": (0.0, 360.0, False),
    "radius": (0.0, 10.0, False),
}
"""Attribute -> lowest value, highest, and whether the highest itself is allowed."""
GEOMETRIES = ("Loxodrome", "Orthodrome")
APART_M = 0.1  # below which two waypoints one after the other are at one place, where a leg has no course
FASTEST_MPS = 60.0  # no vessel keeps a schedule that is faster
WGS84 = pyproj.Geod(ellps="WGS84")
TIMES = ("eta", "etd", "validityPeriodStart", "validityPeriodStop")


def check_route_file(path: Path) -> list[str]:
    """Problems of an RTZ or GPX file, one sentence each.

    Raises:
        FileError: the file cannot be read, or is neither.
    """
    checks = {".rtz": check_rtz, ".gpx": check_gpx}
    if path.suffix.lower() not in checks:
        raise FileError(path, "", f"has the ending {path.suffix or 'none'}, expected .rtz or .gpx")
    with readable(path, "an RTZ or GPX file"):
        content = path.read_bytes()
    return checks[path.suffix.lower()](content, path.stem)


def check_rtz(content: bytes, file_stem: str) -> list[str]:
    """Problems of an RTZ file.

    Args:
        file_stem: its name without the ending, which the route must be named after.
    """
    root = _parsed(content)
    if isinstance(root, str):
        return [root]
    return list(_rtz_problems(root, file_stem, len(content)))


def _parsed(content: bytes) -> etree._Element | str:
    """The root element, or a problem."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        return f"is not well-formed XML: {error.msg}"
    return "declares a document type, which is not allowed" if root.getroottree().docinfo.doctype else root


def _rtz_problems(root: etree._Element, file_stem: str, size: int) -> Iterator[str]:
    version = root.get("version", "")
    if version not in VERSIONS:
        yield f"version is {version!r}, expected one of {', '.join(VERSIONS)}"
        return
    space = SPACE.format(*version.split("."))
    if root.tag != f"{{{space}}}route":
        yield f"root element is {root.tag}, expected route in the name space {space}"
        return
    if size >= LARGEST_FILE:
        yield f"has {size} bytes, expected less than {LARGEST_FILE}"
    yield from _structure(root, space)
    info = root.find(f"{{{space}}}routeInfo")
    name = None if info is None else info.get("routeName")
    if name is None:
        yield "routeInfo has no routeName"
    elif name != file_stem:
        yield f"routeName is {name!r}, expected the file's name {file_stem!r}"
    if info is not None:
        yield from _in_order(info, "validityPeriodStart", "validityPeriodStop")
    waypoints = root.findall(f"{{{space}}}waypoints/{{{space}}}waypoint")
    yield from _waypoints(waypoints, space, version)
    places: dict[str | None, int] = {}
    for number, waypoint in enumerate(waypoints):
        places.setdefault(waypoint.get("id"), number)
    ways_m = _ways_m([waypoint.find(f"{{{space}}}position") for waypoint in waypoints])
    yield from _at_one_place(ways_m, "waypoint")
    for schedule in root.iterfind(f"{{{space}}}schedules/{{{space}}}schedule/*"):
        yield from _schedule(schedule, places, ways_m)


def _structure(element: etree._Element, space: str) -> Iterator[str]:
    """Elements where they do not belong, and attributes out of their range."""
    tag = etree.QName(element).localname
    for key, text in element.attrib.items():
        yield from _attribute(tag, str(key), str(text))
    for child in element.iterchildren(etree.Element):
        name = etree.QName(child)
        if name.namespace != space or name.localname not in CHILDREN[tag]:
            yield f"{name.localname} stands in {tag}, expected {', '.join(CHILDREN[tag]) or 'nothing'}"
        elif name.localname != "extensions":
            yield from _structure(child, space)


def _attribute(tag: str, key: str, text: str) -> Iterator[str]:
    if key in RANGES:
        low, high, closed = RANGES[key]
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (low <= value < high or (closed and value == high)):
            yield f"{tag} has {key} = {text!r}, expected {low:g} to {high:g}{'' if closed else ', that one excluded'}"
    elif key == "geometryType" and text not in GEOMETRIES:
        yield f"{tag} has geometryType = {text!r}, expected {' or '.join(GEOMETRIES)}"
    elif key in ("id", "revision", "waypointId") and not text.isdecimal():
        yield f"{tag} has {key} = {text!r}, expected a whole number of 0 or more"
    elif key in TIMES and _moment(text) is None:
        yield f"{tag} has {key} = {text!r}, expected a time such as 2026-05-01T08:00:00Z"


def _waypoints(waypoints: list[etree._Element], space: str, version: str) -> Iterator[str]:
    ids = [waypoint.get("id") for waypoint in waypoints]
    if len(waypoints) < 2:
        yield f"has {len(waypoints)} waypoints, expected 2 or more"
    for number, waypoint in enumerate(waypoints, start=1):
        for key in ("id", "revision") if version == "1.2" else ("id",):
            if waypoint.get(key) is None:
                yield f"waypoint {number} has no {key}"
        position = waypoint.find(f"{{{space}}}position")
        if position is None or None in (position.get("lat"), position.get("lon")):
            yield f"waypoint {number} has no position with lat and lon"
    for one, times in Counter(one for one in ids if one is not None).items():
        if times > 1:
            yield f"waypoint id {one} is given {times} times, expected once"


def _ways_m(points: Sequence[etree._Element | None]) -> list[float]:
    """Shortest way from each point to the next [m]; nan where one is no place."""
    places = [_place(point) for point in points]
    return [
        math.nan if one is None or two is None else float(WGS84.inv(one[1], one[0], two[1], two[0])[2])
        for one, two in pairwise(places)
    ]


def _place(point: etree._Element | None) -> tuple[float, float] | None:
    """Latitude and longitude [deg] of an element."""
    try:
        place = None if point is None else (float(point.get("lat", "")), float(point.get("lon", "")))
    except ValueError:
        return None
    return place if place is not None and abs(place[0]) <= 90.0 and abs(place[1]) <= 180.0 else None


def _at_one_place(ways_m: Sequence[float], what: str) -> Iterator[str]:
    for number, way_m in enumerate(ways_m, start=1):
        if way_m < APART_M:
            yield f"{what}s {number} and {number + 1} are at one place, so that the leg between them has no course"


def _too_fast(begins: datetime, ends: datetime, way_m: float, what: str) -> Iterator[str]:
    """The problem of a way that no vessel makes in time; a schedule that goes back in time is told elsewhere."""
    seconds = (ends - begins).total_seconds()
    if seconds >= 0.0 and way_m > APART_M and way_m > FASTEST_MPS * seconds:
        speed = f"{way_m / seconds:.0f} m/s" if seconds else "no time"
        yield f"{what}, {way_m / 1000:.4g} km in {seconds:g} s: {speed}, expected at most {FASTEST_MPS:g} m/s"


def _schedule(schedule: etree._Element, places: Mapping[str | None, int], ways_m: Sequence[float]) -> Iterator[str]:
    elements = [e for e in schedule.iterchildren(etree.Element) if etree.QName(e).localname.endswith("heduleElement")]
    named = [element.get("waypointId") for element in elements]
    for one in named:
        if one not in places:
            yield f"schedule refers to waypoint {one}, which is not in the route"
    order = [places[one] for one in named if one in places]
    if any(two <= one for one, two in pairwise(order)):
        yield "schedule does not follow the order of the waypoints"
    texts = [text for e in elements for key in ("eta", "etd") if (text := e.get(key)) is not None]
    known = [(text, moment) for text in texts if (moment := _moment(text)) is not None]
    for (before, one), (after, two) in pairwise(known):
        if two < one:
            yield f"schedule goes back in time, from {before} to {after}"
    timed = [
        (places[one], times)
        for one, e in zip(named, elements, strict=True)
        if one in places and (times := [t for key in ("eta", "etd") if (t := _moment(e.get(key, ""))) is not None])
    ]
    for (first, left), (last, reached) in pairwise(timed):
        what = f"schedule goes from waypoint {first + 1} to {last + 1}"
        yield from _too_fast(left[-1], reached[0], math.fsum(ways_m[first:last]), what)


def _in_order(element: etree._Element, first: str, last: str) -> Iterator[str]:
    one, two = (_moment(element.get(key, "")) for key in (first, last))
    if one is not None and two is not None and two < one:
        yield f"{last} is before {first}"


def _moment(text: str) -> datetime | None:
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        return None
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)


def check_gpx(content: bytes, file_stem: str = "") -> list[str]:
    """Problems of a GPX 1.1 file with a route."""
    root = _parsed(content)
    if isinstance(root, str):
        return [root]
    return list(_gpx_problems(root))


def _gpx_problems(root: etree._Element) -> Iterator[str]:
    if root.tag != f"{{{GPX}}}gpx" or root.get("version") != "1.1":
        yield f"is {root.tag} {root.get('version')!r}, expected gpx 1.1 in the name space {GPX}"
        return
    if not root.get("creator"):
        yield "gpx has no creator"
    routes = root.findall(f"{{{GPX}}}rte")
    if not routes:
        yield "has no route (rte)"
    for number, route in enumerate(routes, start=1):
        points = route.findall(f"{{{GPX}}}rtept")
        if len(points) < 2:
            yield f"route {number} has {len(points)} points, expected 2 or more"
        for point in points:
            for key in ("lat", "lon"):
                if point.get(key) is None:
                    yield f"a point of route {number} has no {key}"
            for key, text in point.attrib.items():
                yield from _attribute("rtept", str(key), str(text))
        times = [_moment(time.text or "") for time in route.iterfind(f"{{{GPX}}}rtept/{{{GPX}}}time")]
        if None in times:
            yield f"route {number} has an invalid time"
        if any(two < one for one, two in pairwise([time for time in times if time is not None])):
            yield f"route {number} goes back in time"
        ways_m = _ways_m(points)
        yield from _at_one_place(ways_m, f"route {number}: point")
        timed = [
            (place, moment)
            for place, point in enumerate(points)
            if (moment := _moment(point.findtext(f"{{{GPX}}}time", ""))) is not None
        ]
        for (first, left), (last, reached) in pairwise(timed):
            what = f"route {number} goes from point {first + 1} to {last + 1}"
            yield from _too_fast(left, reached, math.fsum(ways_m[first:last]), what)
