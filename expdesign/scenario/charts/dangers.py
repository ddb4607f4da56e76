"""Charted dangers and obstacles, of cells and GeoJSON charts alike, to water that is closed.

Dangers without a stated depth count as at the surface. Bridges and cables are closed if their height or the vessel's
air draught is unknown.

Source: International Hydrographic Organization, S-57 edition 3.1 (2000), appendix A (object catalogue).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from expdesign.scenario.charts.zones import in_metres
from expdesign.sea_area import LocalFrame

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
        rules: of the ship.
        window: (longitude, latitude) [deg].
        frame: of the result.
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
