"""Charts: the polygons of GeoJSON layers in degrees, every one checked.

Harmless flaws are repaired and noted: rings that are not closed, repeated points, rings that touch themselves.
Polygons that leave it ambiguous where land ends and water begins are refused.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from expdesign.errors import InputError
from expdesign.scenario.charts.geojson import Feature, polygon_rings
from expdesign.scenario.charts.tuning import TUNING
from expdesign.scenario.tables import Entry
from expdesign.values import Array

REPEATED = "repeated points removed"
CLOSED = "rings closed"
SPLIT = "polygons that touch themselves taken apart where they touch"
MOVED = "polygons moved by a full turn: the chart crosses the antimeridian"
WORDS = {
    "Ring Self-intersection": "crosses itself",
    "Interior is disconnected": "crosses itself",
    "Self-intersection": "crosses itself",
    "Hole lies outside shell": "has a hole outside its outline",
    "Holes are nested": "has a hole inside a hole",
}


@dataclass(frozen=True, kw_only=True)
class Chart:
    """Valid polygons by layer, coordinates (longitude, latitude) [deg], longitudes continuous over the antimeridian.

    Attributes:
        layers: layer name to polygons; they may overlap.
        notes: on repairs.
    """

    layers: Mapping[str, tuple[shapely.Polygon, ...]]
    notes: tuple[str, ...]

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
    repairs: Counter[str] = Counter()
    for feature in features:
        if feature.layer in layers:
            polygons = feature_polygons(feature.geometry, feature.entry, near_lon_deg, repairs)
            layers[feature.layer] += polygons
            if near_lon_deg is None and polygons:
                near_lon_deg = float(shapely.get_coordinates(polygons[0].exterior)[:, 0].mean())
    if not any(layers.values()):
        raise InputError(f"holds no polygon in the layers {', '.join(layers)}, expected at least one")
    notes = tuple(f"{count} {what}" for what, count in repairs.items() if count)
    return Chart(layers={name: tuple(polygons) for name, polygons in layers.items()}, notes=notes)


def feature_polygons(
    geometry: object, entry: Entry, near_lon_deg: float | None, repairs: Counter[str]
) -> list[shapely.Polygon]:
    """The valid polygons of a geometry; counts repairs.

    Args:
        geometry: in GeoJSON.
        entry: names the feature.
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


def _ring(positions: Any, entry: Entry, repairs: Counter[str]) -> Array:
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
    return points


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


def _valid(polygon: shapely.Polygon, entry: Entry, repairs: Counter[str]) -> list[shapely.Polygon]:
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
    rounding = TUNING.area_rounding_deg2 * max(1.0, polygon.length * max(east - west, north - south) / 100)
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
