"""The zones of a chart, from which allowed water is built, and those that charted dangers and obstacles close.

Dangers of cells and GeoJSON charts are treated alike. Those without a stated depth count as at the surface. Bridges and
cables are closed if their height or the vessel's air draught is unknown.

Source: International Hydrographic Organization, S-57 edition 3.1 (2000), appendix A (object catalogue).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyproj
import shapely

from expdesign.scenario.charts.area_tables import DepthTable
from expdesign.sea_area import LocalFrame
from expdesign.values import Array

LARGEST_EXTENT_KM = 250.0  # of a sea area, so that a local frame holds it


# Chart geometry in degrees: to the metres of a local frame, and where it lies beside the bounds.

STEP_DEG = 0.005
"""Chart edges are straight in latitude and longitude; cut into pieces this long they are straight in the frame too,
to a centimetre."""

KM_PER_DEGREE = 111.2
Box = tuple[float, float, float, float]
"""West, south, east, north [deg]; east is above west even over the antimeridian."""


def around(box: Box) -> shapely.Polygon:
    """The bounds with a margin, so that cut edges do not touch them."""
    west, south, east, north = box
    margin = 0.02 * max(east - west, north - south)
    return shapely.box(west - margin, south - margin, east + margin, north + margin)


def in_metres(geometry: shapely.Geometry, frame: LocalFrame) -> shapely.Geometry:
    """(longitude, latitude) [deg] -> valid geometry (east_m, north_m)."""
    if geometry.is_empty:
        return geometry
    fine = shapely.force_2d(shapely.segmentize(geometry, STEP_DEG))
    metres = shapely.transform(fine, lambda points: frame.to_metres(points[:, ::-1])[:, ::-1])
    return metres if shapely.is_valid(metres) else shapely.make_valid(metres)


def beside(points: Array, box: Box) -> Array:
    """Positions (k, 2) longitude, latitude [deg], with longitudes within half a turn of the middle of the bounds."""
    turns = np.round(((box[0] + box[2]) / 2 - points[:, 0]) / 360)
    return np.column_stack([points[:, 0] + 360 * turns, points[:, 1]])


def swapped_meets(points: Array, box: Box) -> bool:
    """Whether what positions (k, 2) [deg] span would meet the bounds with their two numbers swapped."""
    span = shapely.MultiPoint(beside(points[:, ::-1], box)).convex_hull
    return bool(span.intersects(shapely.box(*box)))


def far_outside(points: Array, box: Box) -> np.ndarray:
    """(k,) which positions (k, 2) [deg] are farther outside the bounds than a sea area may be wide, roughly."""
    west, south, east, north = box
    off = np.maximum(np.maximum((west, south) - points, points - (east, north)), 0.0)
    off[:, 0] *= np.cos(np.radians((south + north) / 2))
    return np.asarray(np.hypot(*off.T) * KM_PER_DEGREE > LARGEST_EXTENT_KM)


def off_km(geometry: shapely.Geometry, box: Box) -> float:
    """Distance of a geometry (longitude, latitude) [deg] from the bounds [km]; zero where they meet."""
    line = shapely.get_coordinates(shapely.shortest_line(geometry, shapely.box(*box)))
    return float(pyproj.Geod(ellps="WGS84").line_length(*line.T)) / 1000


@dataclass(frozen=True, kw_only=True)
class ChartZones:
    """Polygons (east_m, north_m) of a chart inside bounds."""

    land: shapely.Geometry  # land and solid structures
    deep: shapely.Geometry | None  # deep enough, or None when depth is not checked
    closed: shapely.Geometry  # forbidden for other reasons
    depths: tuple[tuple[float, shapely.Geometry], ...]  # (least depth [m], polygons), for drawing
    depth_rule: str  # the rule for depth, in one sentence
    notes: tuple[str, ...]  # on repairs, assumptions and closed areas


@dataclass(frozen=True, kw_only=True)
class OpenChart:
    """An open chart."""

    path: Path  # its file
    extent: Box  # west, south, east, north of its polygons [deg]
    zones: Callable[[Box, LocalFrame], ChartZones]  # bounds and frame -> zones


def rule_text(depth: DepthTable, draught_m: float) -> tuple[float, str]:
    """The required charted depth [m], and its calculation in words."""
    needed_m = draught_m + depth.under_keel_m - depth.tide_m
    tide = f" - {depth.tide_m:g} m tide" if depth.tide_m else ""
    return needed_m, f"{draught_m:g} m draught + {depth.under_keel_m:g} m under the keel{tide} = {needed_m:g} m"


WALL_HALF_WIDTH_M = 1.0  # half the width given to walls and pontoons drawn as lines


SOLID = (
    *("LNDARE", "SLCONS", "PONTON", "HULKES", "FLODOC", "DRYDOC", "GATCON", "DAMCON", "DYKCON", "CAUSWY", "LOGPON"),
    *("MORFAC", "PILPNT", "OFSPLF", "PYLONS", "BCNCAR", "BCNISD", "BCNLAT", "BCNSAW", "BCNSPP", "MARCUL", "FSHFAC"),
)
"""Obstacles at any depth: land, works, moored and floating structures, piles, beacons."""
BUOYS = ("BOYCAR", "BOYINB", "BOYISD", "BOYLAT", "BOYSAW", "BOYSPP", "LITFLT", "LITVES", "ICEARE", "WEDKLP")
DANGERS = {"OBSTRN": "VALSOU", "WRECKS": "VALSOU", "UWTROC": "VALSOU", "SOUNDG": "DEPTH"}
"""Dangers and the attribute with their depth; where it is empty they count as at the surface."""
UNSURVEYED = "UNSARE"
OVERHEAD = ("BRIDGE", "CBLOHD", "PIPOHD", "CONVYR")
CLEARANCES = ("VERCLR", "VERCCL", "VERCSA")


@dataclass(frozen=True, kw_only=True, eq=False)
class ChartedObject:
    """One charted object."""

    kind: str  # its object class in S-57, e.g. "WRECKS".
    geometry: shapely.Geometry  # any, coordinates (longitude, latitude) [deg]
    depth_m: float = np.nan  # least depth below the sounding datum; nan where not stated or meaningless
    clearance_m: float = np.nan  # height below it of what crosses overhead; nan where not stated
    why: str = ""  # what keeps a trial out of a restricted area, else ""


@dataclass(frozen=True, kw_only=True)
class ShipRules:
    """Requirements of the ship."""

    needed_m: float  # least charted depth, with the tide subtracted [m]
    margin_m: float  # least distance from charted points of danger [m]
    air_draught_m: float | None  # height above water [m], or None to close all bridges and cables


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedWater:
    """What objects close, as geometries (east_m, north_m)."""

    solid: shapely.Geometry  # land and obstacles at any depth
    closed: shapely.Geometry  # dangers, buoys, what is overhead, and restricted areas
    notes: tuple[str, ...]  # how many of which kind


def closed_water(
    objects: Sequence[ChartedObject], rules: ShipRules, window: shapely.Geometry, frame: LocalFrame
) -> ClosedWater:
    """The water that objects close to a ship, inside a window [deg].

    Args:
        objects: of any class; depth areas and other classes close nothing by themselves.
        window: (longitude, latitude) [deg].
    """
    objects = [item for item in objects if item.geometry.intersects(window)]
    restricted = [item for item in objects if item.why]
    charted = [item for item in objects if not item.why]
    closed = {
        f"dangers less than {rules.needed_m:g} m deep or of unknown depth": (
            [item for item in charted if item.kind in DANGERS and not item.depth_m >= rules.needed_m],
            rules.margin_m,
        ),
        "unsurveyed areas": ([item for item in charted if item.kind == UNSURVEYED], rules.margin_m),
        "buoys": ([item for item in charted if item.kind in BUOYS], rules.margin_m),
        "bridges, cables and pipes overhead" + _height(rules.air_draught_m): (
            [item for item in charted if item.kind in OVERHEAD and not _passable(item, rules.air_draught_m)],
            WALL_HALF_WIDTH_M,
        ),
        "restricted areas": (restricted, WALL_HALF_WIDTH_M),
    }
    solid = [item for item in charted if item.kind in SOLID]
    whys = Counter(item.why for item in restricted)
    return ClosedWater(
        solid=united(solid, window, frame, margin_m=rules.margin_m),
        closed=shapely.union_all([united(items, window, frame, margin_m=margin) for items, margin in closed.values()]),
        notes=(
            *(f"kept clear of {len(items)} {what}" for what, (items, _) in closed.items() if items),
            *(f"{count} areas closed by rule: {why}" for why, count in whys.items()),
        ),
    )


def united(
    objects: Iterable[ChartedObject], window: shapely.Geometry, frame: LocalFrame, *, margin_m: float = 0.0
) -> shapely.Geometry:
    """The union in metres: points with a margin around them, lines as thin walls, areas as they are."""
    cut = [item.geometry.intersection(window) for item in objects if item.geometry.intersects(window)]
    metres = [in_metres(geometry, frame) for geometry in cut]
    widths = np.array([(margin_m, WALL_HALF_WIDTH_M, 0.0)[shapely.get_dimensions(item)] for item in metres])
    grown = shapely.buffer(metres, widths, quad_segs=8) if metres else []
    return shapely.union_all([item for item in grown if not item.is_empty])


def _passable(item: ChartedObject, air_draught_m: float | None) -> bool:
    return air_draught_m is not None and item.clearance_m >= air_draught_m


def _height(air_draught_m: float | None) -> str:
    return "" if air_draught_m is None else f" lower than {air_draught_m:g} m or of unknown height"
