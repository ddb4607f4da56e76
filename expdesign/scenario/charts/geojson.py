"""From GeoJSON files to features and the rings of their polygons; geometry is not checked here.

Source of the format: RFC 7946; the caller states which property names the layer of a feature.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from expdesign.scenario.tables import Entry, read_text, shown

LAYER_OF_BARE_POLYGONS = "land"
POLYGON_TYPES = ("Polygon", "MultiPolygon", "GeometryCollection")
GEOMETRY_TYPES = (*POLYGON_TYPES, "Point", "MultiPoint", "LineString", "MultiLineString")
WGS84 = ("CRS84", ":4326")


@dataclass(frozen=True)
class Feature:
    """One feature of a chart, not yet looked into.

    Attributes:
        entry: the file and the number of the feature in it, from 1.
        layer: name of its layer.
        geometry: the GeoJSON geometry.
        properties: its other properties.
        assumed: the file names no layer at all, so that all is taken to be land.
    """

    entry: Entry
    layer: str
    geometry: Mapping[str, Any]
    properties: Mapping[str, Any] = field(default_factory=dict)
    assumed: bool = False


def read_features(path: Path, *, layer_property: str = "layer") -> tuple[Feature, ...]:
    """The features of a GeoJSON file: a FeatureCollection, a Feature or a bare geometry.

    Bare geometries, and features of a file in which none names a layer, are land.

    Args:
        path: the file.
        layer_property: the property that names the layer of a feature.

    Raises:
        FileError: unreadable, not GeoJSON, not in longitude and latitude, or without features.
    """
    entry, content = Entry(path), _read_json(path)
    if not isinstance(content, dict):
        raise entry.error("is no GeoJSON object, expected a FeatureCollection, Polygon or MultiPolygon")
    _check_reference_system(content, entry.at("crs"))
    kind = content.get("type")
    if kind in GEOMETRY_TYPES:
        return (Feature(_named(path, 1, LAYER_OF_BARE_POLYGONS), LAYER_OF_BARE_POLYGONS, content),)
    if kind not in ("FeatureCollection", "Feature"):
        raise entry.at("type").error(f"is {shown(kind)}, expected FeatureCollection, Polygon or MultiPolygon")
    rows = content.get("features") if kind == "FeatureCollection" else [content]
    if not isinstance(rows, list):
        raise entry.at("features").error("is missing or no list, expected a list of features")
    features = tuple(_features(rows, path, layer_property))
    if not features:
        raise entry.at("features").error("is empty, expected at least one polygon")
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


def _read_json(path: Path) -> object:
    entry = Entry(path)

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


def _features(rows: list[Any], path: Path, key: str) -> Iterator[Feature]:
    """Features that have a geometry."""
    named = any(_properties(row).get(key) is not None for row in rows)
    for number, row in enumerate(rows, start=1):
        entry = Entry(path, f"feature {number}")
        if not isinstance(row, dict) or row.get("type") != "Feature":
            raise entry.error("is no GeoJSON feature, expected an object with type 'Feature'")
        layer = _properties(row).get(key) if named else LAYER_OF_BARE_POLYGONS
        if not isinstance(layer, str):
            found = f"has no property {key!r}" if layer is None else f"has the {key} {shown(layer)}"
            raise entry.error(f"{found}, expected the name of its layer")
        geometry = row.get("geometry")
        if geometry is None:
            continue
        if not isinstance(geometry, dict) or geometry.get("type") not in GEOMETRY_TYPES:
            found = shown(geometry.get("type") if isinstance(geometry, dict) else geometry)
            raise entry.error(f"has a geometry of type {found}, expected Polygon or MultiPolygon")
        yield Feature(_named(path, number, layer), layer, geometry, _properties(row), assumed=not named)


def _properties(row: object) -> Mapping[str, Any]:
    properties = row.get("properties") if isinstance(row, dict) else None
    return properties if isinstance(properties, dict) else {}


def _named(path: Path, number: int, layer: str) -> Entry:
    return Entry(path, f"feature {number} (layer {shown(layer)})")
