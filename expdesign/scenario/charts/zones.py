"""The zones of a chart, from which allowed water is built."""

from __future__ import annotations

from collections.abc import Callable
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
