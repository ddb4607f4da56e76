"""The zones of a chart, from which allowed water is built."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import shapely

from expdesign.scenario.charts.area_tables import DepthTable
from expdesign.scenario.charts.metres import Box
from expdesign.sea_area import LocalFrame


@dataclass(frozen=True, kw_only=True)
class ChartZones:
    """Polygons (east_m, north_m) of a chart inside bounds.

    Attributes:
        land: land and solid structures.
        deep: deep enough, or None when depth is not checked.
        closed: forbidden for other reasons.
        depths: (least depth [m], polygons), for drawing.
        depth_rule: the rule for depth, in one sentence.
        notes: on repairs, assumptions and closed areas.
    """

    land: shapely.Geometry
    deep: shapely.Geometry | None
    closed: shapely.Geometry
    depths: tuple[tuple[float, shapely.Geometry], ...]
    depth_rule: str
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class OpenChart:
    """An open chart.

    Attributes:
        path: its file.
        extent: west, south, east, north of its polygons [deg].
        zones: bounds and frame -> zones.
    """

    path: Path
    extent: Box
    zones: Callable[[Box, LocalFrame], ChartZones]


def rule_text(depth: DepthTable, draught_m: float) -> tuple[float, str]:
    """The required charted depth [m], and its calculation in words."""
    needed_m = draught_m + depth.under_keel_m - depth.tide_m
    tide = f" - {depth.tide_m:g} m tide" if depth.tide_m else ""
    return needed_m, f"{draught_m:g} m draught + {depth.under_keel_m:g} m under the keel{tide} = {needed_m:g} m"
