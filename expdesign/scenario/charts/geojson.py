"""From GeoJSON files to features and to polygons in degrees, every one checked.

Harmless flaws are repaired and noted: rings that are not closed, repeated points, rings that touch themselves.
Polygons that leave it ambiguous where land ends and water begins are refused. The caller states which property names
the layer of a feature. Other formats of maps are recognised, and refused with the way from them to GeoJSON.

Source of the format: RFC 7946.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from expdesign.errors import InputError
from expdesign.input_files import read_text
from expdesign.scenario.tables import Entry, shown
from expdesign.values import Array

AREA_ROUNDING_DEG2 = 1e-13  # area of rounding, for outlines of about one degree; a tenth of a square decimetre
UNNAMED = ""  # layer of features that name none
POLYGON_TYPES = ("Polygon", "MultiPolygon", "GeometryCollection")
GEOMETRY_TYPES = (*POLYGON_TYPES, "Point", "MultiPoint", "LineString", "MultiLineString")
WGS84 = ("CRS84", ":4326")
CONVERT = "expected GeoJSON: save it as that in a GIS or a map editor, or ogr2ogr -f GeoJSON {stem}.geojson {name}"
OTHER_FORMATS = (
    (b"<kml", "KML", CONVERT),
    (b"<osm", "OpenStreetMap XML", f"{CONVERT} multipolygons"),
    (b"<gpx", "GPX", f"{CONVERT} tracks, whose closed lines have to become polygons"),
    (b"<", "XML", CONVERT),
    (
        b"PK\x03\x04",
        "a zip archive such as KMZ or zipped shapefiles",
        "expected GeoJSON: unpack it, and convert the map",
    ),
    (b"\x00\x00\x27\x0a", "a shapefile", CONVERT),
    (b"SQLite format 3", "a GeoPackage or another SQLite file", CONVERT),
    (b'"osm3s"', "Overpass JSON", "expected GeoJSON: export it as that from the map service"),
    (b'"esriGeometry', "Esri JSON", CONVERT),
)
"""Mark among the first bytes (XML begins with <, JSON with {), format, and how to go on."""
PARTS = {".dbf": ".shp", ".shx": ".shp", ".prj": ".shp", ".cpg": ".shp"}
"""Files that come with a shapefile, which alone hold no geometry."""
FIRST_BYTES = 2000


@dataclass(frozen=True)
class Feature:
    """One feature of a chart, not yet looked into."""

    entry: Entry  # the file and the number of the feature in it, from 1
    layer: str  # name of its layer, or `UNNAMED`
    geometry: Mapping[str, Any]  # the GeoJSON geometry
    properties: Mapping[str, Any] = field(default_factory=dict)  # its other properties

    @property
    def is_area(self) -> bool:
        """Whether its geometry is of polygons."""
        return self.geometry["type"] in POLYGON_TYPES


def read_features(
    path: Path, *, layer_property: str = "layer", skip: Sequence[int | str] = (), stated_at: Entry | None = None
) -> tuple[Feature, ...]:
    """The features of a GeoJSON file: a FeatureCollection, a Feature or a bare geometry.

    Args:
        layer_property: the property that names the layer of a feature.
        skip: numbers, from 1, and types of geometry of features to leave out unread.
        stated_at: the list of these in another file.

    Raises:
        FileError: unreadable, not GeoJSON, not in longitude and latitude, or without features.
    """
    entry, content = Entry(path), _read_json(path)
    if not isinstance(content, dict):
        raise entry.error("is no GeoJSON object, expected a FeatureCollection, Polygon or MultiPolygon")
    _check_reference_system(content, entry.at("crs"))
    kind = content.get("type")
    if kind in GEOMETRY_TYPES:
        content = {"type": "Feature", "geometry": content}
    elif kind not in ("FeatureCollection", "Feature"):
        raise entry.at("type").error(f"is {shown(kind)}, expected FeatureCollection, Polygon or MultiPolygon")
    rows = content.get("features") if kind == "FeatureCollection" else [content]
    if not isinstance(rows, list):
        raise entry.at("features").error("is missing or no list, expected a list of features")
    if stated_at is not None:
        _check_skipped(rows, skip, stated_at)
    features = tuple(_features(rows, path, layer_property, skip))
    if not features:
        found = "hold no geometry that is not skipped" if rows else "is empty"
        raise entry.at("features").error(f"{found}, expected at least one polygon")
    return features


def polygon_rings(geometry: object, entry: Entry) -> list[list[Any]]:
    """The rings of every polygon in a geometry: outline first, then holes.

    Raises:
        FileError: it is, or holds, something else than polygons.
    """
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if not isinstance(geometry, dict) or kind not in POLYGON_TYPES:
        raise entry.error(f"is a {kind}, expected Polygon or MultiPolygon")
    member = "geometries" if kind == "GeometryCollection" else "coordinates"
    content = geometry.get(member)
    if not isinstance(content, list):
        raise entry.error(f"has no list of {member}")
    if kind == "GeometryCollection":
        return [rings for part in content for rings in polygon_rings(part, entry)]
    polygons = [content] if kind == "Polygon" else content
    if not all(isinstance(rings, list) and rings for rings in polygons):
        raise entry.error("has a polygon without rings, expected lists of [longitude, latitude]")
    return polygons


def positions_in(geometry: Mapping[str, Any]) -> Iterator[list[float]]:
    """[longitude, latitude] of every corner of a geometry that was checked."""
    for part in geometry.get("geometries", []):
        yield from positions_in(part)
    parts = [geometry.get("coordinates", [])]
    while parts:
        part = parts.pop()
        if part and not isinstance(part[0], list):
            yield part[:2]
        else:
            parts += part


def _read_json(path: Path) -> object:
    entry = Entry(path)
    _check_format(path, entry)

    def refuse(constant: str) -> None:
        raise entry.error(f"holds {constant}, expected finite numbers")

    try:
        content: object = json.loads(read_text(path, "a GeoJSON file"), parse_constant=refuse)
    except json.JSONDecodeError as error:
        place = f"at line {error.lineno}, column {error.colno}"
        raise entry.error(f"is not valid JSON: {error.msg} ({place})") from None
    except (RecursionError, ValueError) as error:
        raise entry.error(f"is not readable JSON: {error}") from None
    return content


def _check_reference_system(content: Mapping[str, Any], entry: Entry) -> None:
    system = content.get("crs")
    if system is None:
        return
    properties = system.get("properties") if isinstance(system, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else system
    if not isinstance(name, str) or not name.endswith(WGS84):
        raise entry.error(f"is {shown(name)}, expected longitude and latitude in WGS84 (CRS84)")


def _check_format(path: Path, entry: Entry) -> None:
    """Raise for a map in another format that is recognised; files that cannot be read are for the reader."""
    if path.suffix.lower() in PARTS:
        raise entry.error(f"is a part of a shapefile, {_way_on(CONVERT, path.with_suffix(PARTS[path.suffix.lower()]))}")
    try:
        with path.open("rb") as file:
            begins = file.read(FIRST_BYTES)
    except (OSError, ValueError):
        return
    begins = begins.lstrip(b"\xef\xbb\xbf \t\r\n")
    for mark, name, way_on in OTHER_FORMATS:
        first = {b"<": b"<", b'"': b"{"}.get(mark[:1], mark)
        if begins.startswith(first) and mark in begins:
            raise entry.error(f"is {name}, {_way_on(way_on, path)}")


def _way_on(text: str, path: Path) -> str:
    return text.format(stem=path.stem, name=path.name)


def _check_skipped(rows: list[Any], skip: Sequence[int | str], entry: Entry) -> None:
    """Raise for a number or a type of geometry that no feature has."""
    kinds = sorted({str(kind) for row in rows if (kind := _geometry_type(row)) is not None})
    for index, item in enumerate(skip, start=1):
        if isinstance(item, str) and item not in kinds:
            raise entry.item(index).unknown(item, kinds)
        if isinstance(item, int) and not 1 <= item <= len(rows):
            raise entry.item(index).error(f"is {item}, expected 1 to {len(rows)}, the number of a feature")


def _geometry_type(row: object) -> Any:
    geometry = row.get("geometry") if isinstance(row, dict) else None
    return geometry.get("type") if isinstance(geometry, dict) else None


def _features(rows: list[Any], path: Path, key: str, skip: Sequence[int | str]) -> Iterator[Feature]:
    """Features that have a geometry and are not to be left out."""
    for number, row in enumerate(rows, start=1):
        entry = Entry(path, f"feature {number}")
        if number in skip or _geometry_type(row) in skip:
            continue
        if not isinstance(row, dict) or row.get("type") != "Feature":
            raise entry.error("is no GeoJSON feature, expected an object with type 'Feature'")
        layer = _properties(row).get(key, UNNAMED)
        if not isinstance(layer, str | None):
            raise entry.error(f"has the {key} {shown(layer)}, expected the name of its layer")
        geometry = row.get("geometry")
        if geometry is None:
            continue
        if _geometry_type(row) not in GEOMETRY_TYPES:
            found = shown(geometry.get("type") if isinstance(geometry, dict) else geometry)
            raise entry.error(f"has a geometry of type {found}, expected Polygon or MultiPolygon")
        yield Feature(_named(path, number, layer or UNNAMED), layer or UNNAMED, geometry, _properties(row))


def _properties(row: object) -> Mapping[str, Any]:
    properties = row.get("properties") if isinstance(row, dict) else None
    return properties if isinstance(properties, dict) else {}


def _named(path: Path, number: int, layer: str) -> Entry:
    return Entry(path, f"feature {number} (layer {shown(layer)})" if layer else f"feature {number}")


REPEATED = "repeated point", "removed"
CLOSED = "ring", "closed"
SPLIT = "polygon", "taken apart where it touches itself"
MOVED = "polygon", "moved by a full turn: the chart crosses the antimeridian"
FAR_DEG = 2.3  # of latitude, about the largest extent of a sea area
WORDS = {
    "Ring Self-intersection": "crosses itself",
    "Interior is disconnected": "crosses itself",
    "Self-intersection": "crosses itself",
    "Hole lies outside shell": "has a hole outside its outline",
    "Holes are nested": "has a hole inside a hole",
}


@dataclass(frozen=True, kw_only=True)
class Chart:
    """Valid polygons by layer, coordinates (longitude, latitude) [deg], longitudes continuous over the antimeridian."""

    layers: Mapping[str, tuple[shapely.Polygon, ...]]  # layer name to polygons; they may overlap
    notes: tuple[str, ...]  # on repairs

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """West, south, east, north of all polygons [deg]."""
        polygons = [polygon for layer in self.layers.values() for polygon in layer]
        west, south, east, north = shapely.total_bounds(polygons)
        return float(west), float(south), float(east), float(north)


def read_layers(features: tuple[Feature, ...], names: Iterable[str], *, near_lon_deg: float | None = None) -> Chart:
    """The polygons of the named layers, checked.

    Args:
        features: of one file, as read.
        names: layers to read; others are ignored.
        near_lon_deg: longitudes are counted within half a turn of it; by default of the first polygon.

    Raises:
        FileError: naming the feature, its layer and the place: not a polygon, crosses itself, out of range.
        InputError: the layers hold no polygon.
    """
    layers: dict[str, list[shapely.Polygon]] = {name: [] for name in names}
    repairs: Counter[tuple[str, str]] = Counter()
    for feature in features:
        if feature.layer in layers:
            polygons = feature_polygons(feature.geometry, feature.entry, near_lon_deg, repairs)
            layers[feature.layer] += polygons
            if near_lon_deg is None and polygons:
                near_lon_deg = float(shapely.get_coordinates(polygons[0].exterior)[:, 0].mean())
    if not any(layers.values()):
        raise InputError(f"holds no polygon in the layers {', '.join(layers)}, expected at least one")
    notes = tuple(f"{count} {what}{'s' * (count > 1)} {done}" for (what, done), count in repairs.items() if count)
    return Chart(layers={name: tuple(polygons) for name, polygons in layers.items()}, notes=notes)


def feature_polygons(
    geometry: object, entry: Entry, near_lon_deg: float | None, repairs: Counter[tuple[str, str]]
) -> list[shapely.Polygon]:
    """The valid polygons of a geometry; counts repairs.

    Args:
        geometry: in GeoJSON.
        near_lon_deg: longitudes are counted within half a turn of it; of the first polygon where None.
        repairs: grows.
    """
    polygons: list[shapely.Polygon] = []
    for rings in polygon_rings(geometry, entry):
        shell, *holes = _continuous([_ring(ring, entry, repairs) for ring in rings], entry)
        middle = float(shell[:, 0].mean())
        near_lon_deg = middle if near_lon_deg is None else near_lon_deg
        turn = np.array([360.0 * round((near_lon_deg - middle) / 360), 0.0])
        repairs[MOVED] += bool(turn[0])
        polygons += _valid(shapely.Polygon(shell + turn, [hole + turn for hole in holes]), entry, repairs)
    return polygons


def place_text(lat_deg: float, lon_deg: float) -> str:
    """A position for people, e.g. "60.16340 N, 24.96300 E"."""
    lon_deg = (lon_deg + 180) % 360 - 180
    return f"{abs(lat_deg):.5f} {'NS'[lat_deg < 0]}, {abs(lon_deg):.5f} {'EW'[lon_deg < 0]}"


def _ring(positions: Any, entry: Entry, repairs: Counter[tuple[str, str]]) -> Array:
    """One closed ring (k, 2) of longitude, latitude without repeated points."""
    ring = positions_of(positions, entry)[:, :2]
    kept = np.concatenate([[True], (np.diff(ring, axis=0) != 0).any(axis=1)])
    repairs[REPEATED] += int(np.count_nonzero(~kept))
    ring = ring[kept]
    if (ring[0] != ring[-1]).any():
        repairs[CLOSED] += 1
        ring = np.concatenate([ring, ring[:1]])
    corners = len(np.unique(ring, axis=0))
    if corners < 3:
        raise entry.error(f"has a ring with {corners} different corners, expected at least 3")
    return ring


def positions_of(positions: Any, entry: Entry) -> Array:
    """(k, 2) longitude, latitude of a list of positions, or (k, 3) where all have a third coordinate.

    Raises:
        FileError: one is no position, or out of range.
    """
    positions = positions if isinstance(positions, list) else [positions]
    strange = [position for position in positions or [[]] if not _is_position(position)]
    if strange:
        found = str(strange[0])[:60]
        raise entry.error(f"has {found} where a position [longitude, latitude] of numbers is expected")
    size = 3 if all(len(position) > 2 and _is_position(position[1:]) for position in positions) else 2
    points = np.array([position[:size] for position in positions], dtype=float)
    wrong = (np.abs(points[:, 1]) > 90) | (points[:, 0] < -180) | (points[:, 0] > 360)
    if wrong.any():
        lon, lat = points[wrong][0, :2]
        raise entry.error(f"has the position [{lon:g}, {lat:g}], expected [longitude, latitude] in degrees")
    _check_corners(points[:, :2], entry)
    return points


def _check_corners(points: Array, entry: Entry) -> None:
    """Refuse positions (k, 2) one of which is beside its neighbour only with its two numbers swapped.

    Of the two ends of such a step, the wrong one is farther from where most positions are.
    """
    before, after = points[:-1], points[1:]
    steps = np.flatnonzero(_far(before, after) & ~_far(before, after[:, ::-1]))
    if not steps.size:
        return
    ends = points[steps[0] : steps[0] + 2]
    lon, lat = max(ends.tolist(), key=lambda end: float(np.hypot(*(end - np.median(points, axis=0)))))
    raise entry.error(
        f"has the corner [{lon:g}, {lat:g}] far from the one beside it, expected [longitude, latitude]: with the two "
        "swapped it lies beside it"
    )


def _far(first: Array, second: Array) -> np.ndarray:
    """(k,) whether positions (k, 2) [deg] are farther apart than sea areas are wide, in any order of the two."""
    return np.asarray(np.hypot(*((second - first + 180) % 360 - 180).T) > FAR_DEG)


def continuous_line(points: Array, near_lon_deg: float) -> Array:
    """The points (k, 2 or 3) of a line without jumps of a full turn, within half a turn of a longitude."""
    moved = points.copy()
    moved[:, 0] = np.unwrap(points[:, 0], period=360.0)
    moved[:, 0] += 360.0 * np.round((near_lon_deg - moved[:, 0].mean()) / 360)
    return moved


def _is_position(position: object) -> bool:
    if not isinstance(position, list) or len(position) < 2:
        return False
    return all(type(number) in (int, float) and abs(number) < 1e300 for number in position[:2])


def _continuous(rings: list[Array], entry: Entry) -> list[Array]:
    """The rings of one polygon without jumps of a full turn in longitude."""
    unwrapped = []
    for ring in rings:
        steps = np.diff(ring[:, 0])
        turns = np.concatenate([[0.0], np.cumsum(np.where(np.abs(steps) > 180, -360 * np.sign(steps), 0.0))])
        if turns[-1]:
            raise entry.error("goes around a pole, expected a polygon that does not")
        unwrapped.append(ring + np.column_stack([turns, 0 * turns]))
    middle = unwrapped[0][:, 0].mean()
    return [ring + np.array([360 * np.round((middle - ring[:, 0].mean()) / 360), 0]) for ring in unwrapped]


def _valid(polygon: shapely.Polygon, entry: Entry, repairs: Counter[tuple[str, str]]) -> list[shapely.Polygon]:
    """The polygon itself, or its parts when it only touches itself.

    Its parts, the union of what the outline encloses less that of the holes, have the polygon's area only where no
    place is enclosed twice and none the wrong way round: then all readings of the outline agree.
    """
    if shapely.is_valid(polygon):
        return [polygon]
    reason, lon, lat = _reason(polygon)
    where = f" at {place_text(lat, lon)}" if math.isfinite(lon) else ""
    mended = shapely.make_valid(polygon, method="structure", keep_collapsed=False)
    parts = [part for part in shapely.get_parts(mended) if part.geom_type == "Polygon"]
    west, south, east, north = polygon.bounds
    rounding = AREA_ROUNDING_DEG2 * max(1.0, polygon.length * max(east - west, north - south) / 100)
    if sum(part.area for part in parts) <= rounding:
        raise entry.error(f"encloses no area{where}, expected an outline of land or water")
    if abs(sum(part.area for part in parts) - polygon.area) <= rounding:
        repairs[SPLIT] += 1
        return parts
    what = WORDS.get(reason, f"is no proper polygon ({reason.lower()})")
    raise entry.error(f"{what}{where}, expected outlines that neither cross nor overlap themselves")


def _reason(polygon: shapely.Polygon) -> tuple[str, float, float]:
    """What makes a polygon invalid, and the longitude and latitude where."""
    text = str(shapely.is_valid_reason(polygon))
    found = re.fullmatch(r"(.*?)\[(\S+) (\S+)\]", text)
    return (found[1], float(found[2]), float(found[3])) if found else (text, math.nan, math.nan)
