"""The sea area: allowed water as polygons in a local metric frame.

The frame is a transverse Mercator projection centred on the area: north_m along the central meridian, east_m across
it, scale 1 at the centre.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import pyproj
import shapely

from expdesign.errors import NoPlan
from expdesign.values import Array

UNKNOWN_DEPTH = "No depths were checked: the chart names no depth areas. Check the whole track on the official chart."
"""Of an area without charted depths."""
DENSE = 10.0  # corners per clearance length of shore above which the clearance is eroded in steps
ARC_SEGMENTS = 16  # chords of a quarter circle at rounded corners
STEPS = (1 / 16, 3 / 16, 3 / 4)  # shares of the clearance eroded in each step
TILE_CORNERS = 16_000  # corners of a shore above which it is moved in tiles, and of one tile at most
REACHES = {"round": 1.1, "mitre": 5.5}
"""Distances moved within which a shore matters: moved shores err by a hundredth, mitres are 5 long at most."""
MOST_CORNERS, THINNED = 200_000, 0.005
"""Corners of a shore above which plans keep to a coarser one, and its tolerance as a share of the clearance."""
KEPT = 16  # eroded waters that a process keeps: those of a plan, and of a remedy or two
NARROW = 4.0  # reaches in a tile that is not halved again, however many corners it has


@dataclass(frozen=True)
class LocalFrame:
    """Relates latitude/longitude (WGS84) to north/east metres."""

    # lat_deg, lon_deg: the origin
    lat_deg: float
    lon_deg: float

    @cached_property
    def _projection(self) -> pyproj.Proj:
        return pyproj.Proj(self.definition)

    @property
    def definition(self) -> str:
        """The projection as a PROJ string."""
        return f"+proj=tmerc +lat_0={self.lat_deg!r} +lon_0={self.lon_deg!r} +k=1 +ellps=WGS84 +units=m"

    def to_metres(self, lat_lon_deg: Array) -> Array:
        """(..., 2) latitude, longitude [deg] -> (..., 2) north, east [m]."""
        lat_lon = np.asarray(lat_lon_deg, dtype=float)
        east, north = self._projection(lat_lon[..., 1], lat_lon[..., 0])
        return np.stack([north, east], axis=-1)

    def to_degrees(self, north_east_m: Array) -> Array:
        """(..., 2) north, east [m] -> (..., 2) latitude, longitude [deg]."""
        points = np.asarray(north_east_m, dtype=float)
        lon, lat = self._projection(points[..., 1], points[..., 0], inverse=True)
        return np.stack([lat, lon], axis=-1)


@dataclass(frozen=True, kw_only=True)
class SeaArea:
    """Where the trial may take place. Polygon coordinates are (east_m, north_m), x to the right, as on a chart."""

    name: str  # for reports
    frame: LocalFrame  # relates metres to latitude and longitude
    # allowed water before any clearance: deep enough, inside the bounds, outside land and no-go zones
    water: shapely.MultiPolygon
    land: shapely.MultiPolygon  # land inside the bounds, for drawing
    depth_rule: str  # the rule for depth, in one sentence
    notes: tuple[str, ...] = ()  # on repairs and assumptions in the chart
    source: str = ""  # chart file and licence notice
    # (charted least depth [m], polygons) from shallow to deep, for drawing; empty where depth is not charted
    depths: tuple[tuple[float, shapely.MultiPolygon], ...] = ()
    named: tuple[tuple[str, shapely.MultiPolygon], ...] = ()  # (name, no-go zone), for drawing

    def safe_water(self, clearance_m: float) -> shapely.MultiPolygon:
        """The water at least `clearance_m` from everything forbidden."""
        return as_multipolygon(eroded(self.water, clearance_m))

    def water_to_plan_in(self, clearance_m: float) -> shapely.MultiPolygon:
        """The safe water, or nearly all of it where the shore has very many corners.

        Corners within a tolerance of the shore without them are then left out, and the clearance is greater by as much.
        """
        return _water_to_plan_in(self.water, clearance_m)


@lru_cache(maxsize=KEPT)
def _water_to_plan_in(water: shapely.MultiPolygon, clearance_m: float) -> shapely.MultiPolygon:
    """Kept, as attempts and remedies ask for the same water again; waters with the same corners are the same."""
    if shapely.get_num_coordinates(water) <= MOST_CORNERS:
        return as_multipolygon(eroded(water, clearance_m))
    tolerance_m = THINNED * clearance_m
    return as_multipolygon(eroded(shapely.simplify(water, tolerance_m), clearance_m + tolerance_m))


def eroded(water: shapely.Geometry, distance_m: float, *, join_style: str = "round") -> shapely.Geometry:
    """The part of a water farther than a distance from its shore.

    A shore with many corners is eroded in growing steps, each of which smooths the shore for the next. The result is
    the same, because the Minkowski sum of discs is a disc, in a tenth of the time.
    """
    dense = DENSE * water.length < distance_m * shapely.get_num_coordinates(water)
    for share in STEPS if dense else (1.0,):
        water = moved(water, -share * distance_m, quad_segs=ARC_SEGMENTS, join_style=join_style)
    return water


def moved(
    water: shapely.Geometry, distance_m: float, *, quad_segs: int = 8, join_style: str = "round"
) -> shapely.Geometry:
    """A water grown by a distance, or shrunk by a negative one, as `shapely.buffer` does it.

    A shore of many corners is moved in tiles, each with the water around that its result depends on. This takes time in
    proportion to n log n for n corners; moved at once, islands take time with the square of their number.
    """
    reach_m = REACHES[join_style] * abs(distance_m)

    def at_once(part: shapely.Geometry) -> shapely.Geometry:
        return shapely.buffer(part, distance_m, quad_segs=quad_segs, join_style=join_style)

    if shapely.get_num_coordinates(water) <= TILE_CORNERS:
        return at_once(water)
    return shapely.union_all(list(_tiles(water, shapely.box(*water.bounds).buffer(reach_m).bounds, reach_m, at_once)))


def _tiles(
    water: shapely.Geometry,
    box: tuple[float, float, float, float],
    reach_m: float,
    change: Callable[[shapely.Geometry], shapely.Geometry],
) -> Iterator[shapely.Geometry]:
    """The changed water of a box (west, south, east, north) in tiles; a change depends on water within reach."""
    west, south, east, north = box
    size_m = max(east - west, north - south)
    if shapely.get_num_coordinates(water) <= TILE_CORNERS or size_m < NARROW * reach_m:
        yield shapely.intersection(change(water), shapely.box(*box))
        return
    middle = (west + east) / 2, (south + north) / 2
    first = (west, south, middle[0], north) if size_m == east - west else (west, south, east, middle[1])
    second = (middle[0], south, east, north) if size_m == east - west else (west, middle[1], east, north)
    for half in (first, second):
        least, most = np.array(half[:2]) - reach_m, np.array(half[2:]) + reach_m
        yield from _tiles(shapely.intersection(water, shapely.box(*least, *most)), half, reach_m, change)


@dataclass(frozen=True, kw_only=True)
class Zones:
    """The zones of a sea area, as valid polygons (east_m, north_m)."""

    bounds: shapely.Geometry  # the trial stays inside
    land: shapely.Geometry  # the trial stays outside
    no_go: shapely.Geometry  # the trial stays outside
    deep: shapely.Geometry | None = None  # water known to be deep enough, or None when depth is not checked
    depths: tuple[tuple[float, shapely.Geometry], ...] = ()  # (charted least depth [m], polygons), for drawing
    named: tuple[tuple[str, shapely.Geometry], ...] = ()  # (name, no-go zone), for drawing


def build_sea_area(
    name: str, *, frame: LocalFrame, zones: Zones, depth_rule: str, notes: tuple[str, ...] = (), source: str = ""
) -> SeaArea:
    """Allowed water: the bounds without land and no-go zones, where it is deep enough.

    Args:
        name: for reports.
        frame: in which the zones are given.
        zones: allowed and forbidden ones.
        depth_rule, notes, source: as in `SeaArea`.
        source: chart file and licence notice.

    Raises:
        NoPlan: no water remains; the message states the reason.
    """
    water = zones.bounds.difference(zones.land)
    reason = "all of it is land" if _dry(water) else ""
    water = water.difference(zones.no_go)
    reason = reason or ("the no-go zones cover all its water" if _dry(water) else "")
    water = water if zones.deep is None else water.intersection(zones.deep)
    reason = reason or ("none of its water is deep enough" if _dry(water) else "")
    if reason:
        raise NoPlan(f"area {name!r} has no allowed water: {reason}")
    land = as_multipolygon(zones.bounds.intersection(zones.land))
    water = as_multipolygon(water)
    drawn = ((depth, as_multipolygon(polygons.intersection(zones.bounds))) for depth, polygons in zones.depths)
    return SeaArea(
        name=name,
        frame=frame,
        water=water,
        land=land,
        depth_rule=depth_rule,
        notes=notes,
        source=source,
        depths=tuple((depth, polygons) for depth, polygons in drawn if not polygons.is_empty),
        named=tuple((zone, as_multipolygon(polygon.intersection(zones.bounds))) for zone, polygon in zones.named),
    )


def _dry(water: shapely.Geometry) -> bool:
    return bool(as_multipolygon(water).is_empty)


def as_multipolygon(geometry: shapely.Geometry) -> shapely.MultiPolygon:
    """The polygons of any geometry, dropping points and lines."""
    parts = [part for part in shapely.get_parts(geometry) if part.geom_type in ("Polygon", "MultiPolygon")]
    polygons = [polygon for part in parts for polygon in shapely.get_parts(part) if not polygon.is_empty]
    return shapely.MultiPolygon(polygons)
