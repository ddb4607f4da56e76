"""From GeoJSON files to features and the rings of their polygons; geometry is not checked here.

Source of the format: RFC 7946; the caller states which property names the layer of a feature. Other formats of maps are
recognised, and refused with the way from them to GeoJSON.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from expdesign.scenario.tables import Entry, read_text, shown

UNNAMED = ""
"""Layer of features that name none."""
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
    """One feature of a chart, not yet looked into.

    Attributes:
        entry: the file and the number of the feature in it, from 1.
        layer: name of its layer, or `UNNAMED`.
        geometry: the GeoJSON geometry.
        properties: its other properties.
    """

    entry: Entry
    layer: str
    geometry: Mapping[str, Any]
    properties: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_area(self) -> bool:
        """Whether its geometry is of polygons."""
        return self.geometry["type"] in POLYGON_TYPES


def read_features(
    path: Path, *, layer_property: str = "layer", skip: Sequence[int | str] = (), stated_at: Entry | None = None
) -> tuple[Feature, ...]:
    """The features of a GeoJSON file: a FeatureCollection, a Feature or a bare geometry.

    Args:
        path: the file.
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
        content: object = json.loads(read_text(path, "GeoJSON"), parse_constant=refuse)
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
