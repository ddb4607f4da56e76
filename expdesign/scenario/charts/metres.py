"""Chart geometry from degrees to the metres of a local frame."""

from __future__ import annotations

import shapely

from expdesign.sea_area import LocalFrame

STEP_DEG = 0.005
"""Chart edges are straight in latitude and longitude; cut into pieces this long they are straight in the frame too,
to a centimetre."""

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
