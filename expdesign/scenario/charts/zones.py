"""What any chart gives: the zones that allowed water is made of."""

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
        land: solid things.
        deep: deep enough, or None when depth is not checked.
        closed: kept out of for other reasons.
        depths: (least depth [m], polygons), for drawing.
        depth_rule: one sentence on how depth was taken into account.
        notes: what was repaired, assumed or closed.
    """

    land: shapely.Geometry
    deep: shapely.Geometry | None
    closed: shapely.Geometry
    depths: tuple[tuple[float, shapely.Geometry], ...]
    depth_rule: str
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class OpenChart:
    """A chart that was read.

    Attributes:
        path: its file.
        extent: west, south, east, north of what is drawn in it [deg].
        zones: bounds and frame -> zones.
    """

    path: Path
    extent: Box
    zones: Callable[[Box, LocalFrame], ChartZones]


def rule_text(depth: DepthTable, draught_m: float) -> tuple[float, str]:
    """The charted depth that is needed, and the sum that says why."""
    needed_m = draught_m + depth.under_keel_m - depth.tide_m
    tide = f" - {depth.tide_m:g} m tide" if depth.tide_m else ""
    return needed_m, f"{draught_m:g} m draught + {depth.under_keel_m:g} m under the keel{tide} = {needed_m:g} m"
