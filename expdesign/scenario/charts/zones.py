"""The tables of an area file; and the zones of a chart, from which allowed water is built, with charted dangers.

Dangers of cells and GeoJSON charts are treated alike. Those without a stated depth count as at the surface. Bridges and
cables are closed if their height or the vessel's air draught is unknown.

Source: International Hydrographic Organization, S-57 edition 3.1 (2000), appendix A (object catalogue).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pyproj
import shapely
from pydantic import Field

from expdesign.scenario.tables import NonNegative, Number, Positive, Table, Text
from expdesign.sea_area import LocalFrame
from expdesign.values import Array

Latitude = Annotated[float, Field(ge=-90, le=90)]
Longitude = Annotated[float, Field(ge=-180, le=360)]


class NameTable(Table):
    """`[area]`."""

    name: Text = Field(description="a name for the area")


class ChartTable(Table):
    """`[chart]`: a GeoJSON file with the layers to use, or an S-57 cell."""

    geojson: Text | None = Field(default=None, description="the path of a GeoJSON chart, from this file")
    s57: Text | None = Field(
        default=None,
        description="the path of an S-57 cell, *.000, instead of geojson; update files in the same folder are applied",
    )
    outlines: Literal["water", "land"] | None = Field(
        default=None,
        description="what the polygons of a GeoJSON chart enclose that name no layer; with 'water', those inside "
        "others are islands, and everything outside is land",
    )
    land_layers: list[Text] = Field(default=["land"], description="the layers of the GeoJSON chart that are land")
    water_layers: list[Text] = Field(
        default=[],
        description="the layers of the GeoJSON chart that are water of unknown depth; everything outside is land",
    )
    layer_property: Text = Field(default="layer", description="the property that names the layer of a GeoJSON feature")
    depth_layers: dict[str, Number] | None = Field(
        default=None, description="the GeoJSON layers of water with their least depth [m], e.g. {seabed5m = 5.0}"
    )
    depth_property: Text | None = Field(
        default=None, description="the property that holds the depth of a GeoJSON area [m], instead of depth_layers"
    )
    depth_positive: Literal["down", "up"] | None = Field(
        default=None,
        description="how depths in a GeoJSON chart count: 'down' for depths, 'up' for heights, which are negative "
        "below the surface; needed where most are negative",
    )
    skip_features: list[int | Text] = Field(
        default=[],
        description="the features of the GeoJSON chart to leave out, by number from 1 or by type of geometry, e.g. "
        "[3, 'LineString']; the report names them",
    )
    danger_layers: list[Text] | None = Field(
        default=None,
        description="the GeoJSON layers of dangers; when not given, features whose layer or type is a word for one; "
        "the report says what each is taken for",
    )
    hazard_margin_m: Positive = Field(default=25.0, description="the distance kept from points of danger [m]")
    air_draught_m: Positive | None = Field(
        default=None, description="the ship's height above water [m]; when not given, bridges and cables are closed"
    )
    notice: str = Field(default="", description="a notice of copyright for the report")

    def below(self, stated_m: float) -> float:
        """The depth below the surface of a depth or height that the GeoJSON chart states [m]."""
        return -stated_m if self.depth_positive == "up" else stated_m


class BoundsTable(Table):
    """`[bounds]`."""

    south_deg: Latitude = Field(description="the southern latitude [deg]")
    west_deg: Longitude = Field(description="the western longitude [deg]")
    north_deg: Latitude = Field(description="the northern latitude [deg]")
    east_deg: Longitude = Field(description="the eastern longitude [deg]")


class DepthTable(Table):
    """`[depth]`: charted depth plus tide must be at least draught plus depth under the keel."""

    under_keel_m: NonNegative = Field(default=1.0, description="the least depth under the keel [m]")
    tide_m: Number = Field(
        default=0.0, description="the height of tide above chart datum [m], one number for the trial"
    )


class NoGoTable(Table):
    """One of `[[no_go]]`."""

    name: Text = Field(description="a name for the zone")
    polygon: list[Annotated[list[Number], Field(min_length=2, max_length=2)]] = Field(
        min_length=3, description="a list of corners [latitude, longitude] in degrees"
    )


class AreaTable(Table):
    """The whole file."""

    topic = "area"

    area: NameTable = Field(description="a table [area] with a name")
    chart: ChartTable = Field(description="a table [chart] with the chart file")
    bounds: BoundsTable | None = Field(
        default=None, description="the table [bounds] of the sea area; the extent of the chart when not given"
    )
    depth: DepthTable = Field(default=DepthTable(), description="the depth under the keel and the tide")
    no_go: list[NoGoTable] = Field(default=[], description="the tables [[no_go]] of zones to keep out of")


LARGEST_EXTENT_KM = 250.0  # of a sea area, so that a local frame holds it
LARGEST_LATITUDE_DEG = 85.0  # the same, near a pole
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


def closed_water(
    objects: Sequence[ChartedObject], rules: ShipRules, window: shapely.Geometry, frame: LocalFrame
) -> tuple[shapely.Geometry, shapely.Geometry, tuple[str, ...]]:
    """The water that objects close to a ship, inside a window [deg].

    Args:
        objects: of any class; depth areas and other classes close nothing by themselves.
        window: (longitude, latitude) [deg].

    Returns:
        Land and obstacles at any depth; dangers, buoys, what is overhead and restricted areas, both (east_m, north_m);
        and how many there are of which kind.
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
    notes = (
        *(f"kept clear of {len(items)} {what}" for what, (items, _) in closed.items() if items),
        *(f"{count} areas closed by rule: {why}" for why, count in whys.items()),
    )
    parts = [united(items, window, frame, margin_m=margin) for items, margin in closed.values()]
    return united(solid, window, frame, margin_m=rules.margin_m), shapely.union_all(parts), notes


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
