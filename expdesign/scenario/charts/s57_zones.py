"""Allowed water of an S-57 cell: deep enough, clear of solid objects, dangers and restricted areas.

Unknown depths count as too shallow, dangers without a stated depth as at the surface. Bridges and cables are closed if
their height or the vessel's air draught is unknown.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import shapely

from expdesign.errors import NoPlan
from expdesign.scenario.charts.area_tables import AreaTable
from expdesign.scenario.charts.metres import Box, around, in_metres
from expdesign.scenario.charts.s57 import BUOYS, DANGERS, DEPTHS, OVERHEAD, SOLID, Cell, Feature57, read_cell
from expdesign.scenario.charts.tuning import TUNING
from expdesign.scenario.charts.zones import ChartZones, OpenChart, rule_text
from expdesign.scenario.tables import Entry
from expdesign.sea_area import LocalFrame

GEOJSON_ONLY = ("land_layers", "layer_property", "depth_layers", "depth_property")


@dataclass(frozen=True, kw_only=True)
class CellRules:
    """Requirements of the ship.

    Attributes:
        needed_m: least charted depth, with the tide subtracted [m].
        margin_m: least distance from charted points of danger [m].
        air_draught_m: height above water [m], or None to close all bridges and cables.
    """

    needed_m: float
    margin_m: float
    air_draught_m: float | None


def open_cell(file: AreaTable, *, draught_m: float, entry: Entry) -> OpenChart:
    """The cell that an area file names with `chart.s57`."""
    for name in [name for name in GEOJSON_ONLY if name in file.chart.model_fields_set]:
        raise entry.at(name).error("is given with s57, expected it with geojson only: a cell has its own layers")
    path = entry.at("s57").file(file.chart.s57 or "")
    cell = read_cell(path)
    needed_m, required = rule_text(file.depth, draught_m)
    rules = CellRules(needed_m=needed_m, margin_m=file.chart.hazard_margin_m, air_draught_m=file.chart.air_draught_m)

    def zones(box: Box, frame: LocalFrame) -> ChartZones:
        found = cell_zones(cell, rules, box, frame)
        if found.deep is None or found.deep.is_empty:
            deepest = max((depth for depth, _ in found.depths), default=float("nan"))
            raise NoPlan(
                str(entry.at("s57").error(f"no charted depth reaches {required}, the deepest is {deepest:g} m"))
            )
        return replace(
            found,
            depth_rule=f"Allowed water lies in charted areas at least {needed_m:g} m deep: {required}.",
            notes=tuple(f"{path.name}: {note}" for note in (*cell.notes, *found.notes)),
        )

    return OpenChart(path=path, extent=cell.extent, zones=zones)


def cell_zones(cell: Cell, rules: CellRules, box: Box, frame: LocalFrame) -> ChartZones:
    """The zones of a cell inside bounds."""
    window = around(box)
    areas = [feature for feature in cell.of(*DEPTHS) if feature.geometry.intersects(window)]
    deep = [feature for feature in areas if feature.depth_m >= rules.needed_m]
    dangers = [
        feature for feature in cell.of(*DANGERS) if np.isnan(feature.depth_m) or feature.depth_m < rules.needed_m
    ]
    overhead = [feature for feature in cell.of(*OVERHEAD) if not _passable(feature, rules.air_draught_m)]
    closed = {
        f"dangers less than {rules.needed_m:g} m deep or of unknown depth": (dangers, rules.margin_m),
        "buoys": (cell.of(*BUOYS), rules.margin_m),
        "bridges, cables and pipes overhead" + _height(rules.air_draught_m): (overhead, TUNING.wall_half_width_m),
        "restricted areas": (cell.restricted, TUNING.wall_half_width_m),
    }
    found = {
        what: [feature for feature in features if feature.geometry.intersects(window)]
        for what, (features, _) in closed.items()
    }
    return ChartZones(
        depth_rule="",
        land=_united(cell.of(*SOLID), window, frame, margin_m=rules.margin_m),
        deep=_united(deep, window, frame),
        closed=shapely.union_all(
            [_united(found[what], window, frame, margin_m=margin) for what, (_, margin) in closed.items()]
        ),
        depths=tuple(
            (depth, _united([item for item in areas if item.depth_m == depth], window, frame))
            for depth in sorted({item.depth_m for item in areas if not np.isnan(item.depth_m)})
        ),
        notes=_notes(found),
    )


def _passable(feature: Feature57, air_draught_m: float | None) -> bool:
    return air_draught_m is not None and feature.clearance_m >= air_draught_m


def _height(air_draught_m: float | None) -> str:
    return "" if air_draught_m is None else f" lower than {air_draught_m:g} m or of unknown height"


def _united(
    features: Iterable[Feature57], window: shapely.Geometry, frame: LocalFrame, *, margin_m: float = 0.0
) -> shapely.Geometry:
    """The union in metres: points with a margin around them, lines as thin walls, areas as they are."""
    cut = [item.geometry.intersection(window) for item in features if item.geometry.intersects(window)]
    metres = [in_metres(geometry, frame) for geometry in cut]
    widths = np.array([(margin_m, TUNING.wall_half_width_m, 0.0)[shapely.get_dimensions(item)] for item in metres])
    grown = shapely.buffer(metres, widths, quad_segs=8) if metres else []
    return shapely.union_all([item for item in grown if not item.is_empty])


def _notes(found: dict[str, list[Feature57]]) -> tuple[str, ...]:
    notes = [f"kept clear of {len(features)} {what}" for what, features in found.items() if features]
    whys = Counter(feature.why for feature in found["restricted areas"])
    return (*notes, *(f"{count} areas closed by rule: {why}" for why, count in whys.items()))
