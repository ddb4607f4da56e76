"""The sea area: allowed water as polygons in a local metric frame.

The frame is a transverse Mercator projection centred on the area: north_m along the central meridian, east_m across
it, scale 1 at the centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyproj
import shapely

from expdesign.values import Array


@dataclass(frozen=True)
class LocalFrame:
    """Relates latitude/longitude (WGS84) to north/east metres.

    Attributes:
        lat_deg, lon_deg: the origin.
    """

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
    """Where the trial may take place. Polygon coordinates are (east_m, north_m), x to the right, as on a chart.

    Attributes:
        name: for reports.
        frame: relates metres to latitude and longitude.
        water: allowed water before any clearance: deep enough, inside the bounds, outside land and no-go zones.
        land: land inside the bounds, for drawing.
        depth_rule: one sentence on how depth was taken into account.
        notes: what was repaired or assumed while reading the chart.
        source: chart file and licence notice.
    """

    name: str
    frame: LocalFrame
    water: shapely.MultiPolygon
    land: shapely.MultiPolygon
    depth_rule: str
    notes: tuple[str, ...] = ()
    source: str = ""

    def safe_water(self, clearance_m: float) -> shapely.MultiPolygon:
        """The water that a hull may touch when it must keep `clearance_m` from everything forbidden."""
        return as_multipolygon(self.water.buffer(-clearance_m))


def as_multipolygon(geometry: shapely.Geometry) -> shapely.MultiPolygon:
    """The polygons of any geometry, dropping points and lines."""
    parts = [part for part in shapely.get_parts(geometry) if part.geom_type in ("Polygon", "MultiPolygon")]
    polygons = [polygon for part in parts for polygon in shapely.get_parts(part) if not polygon.is_empty]
    return shapely.MultiPolygon(polygons)
