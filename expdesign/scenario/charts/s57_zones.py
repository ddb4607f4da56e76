"""Allowed water of an S-57 cell: deep enough, clear of solid objects, dangers and restricted areas.

Unknown depths count as too shallow.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.errors import NoPlan
from expdesign.scenario.charts.area_tables import AreaTable
from expdesign.scenario.charts.dangers import ShipRules, closed_water, united
from expdesign.scenario.charts.metres import Box, around
from expdesign.scenario.charts.s57 import DEPTHS, Cell, read_cell
from expdesign.scenario.charts.zones import ChartZones, OpenChart, rule_text
from expdesign.scenario.tables import Entry
from expdesign.sea_area import LocalFrame

GEOJSON_ONLY = (
    *("outlines", "land_layers", "water_layers", "layer_property", "depth_layers", "depth_property", "depth_positive"),
    *("skip_features", "danger_layers"),
)


def open_cell(file: AreaTable, *, draught_m: float, entry: Entry) -> OpenChart:
    """The cell that an area file names with `chart.s57`."""
    for name in [name for name in GEOJSON_ONLY if name in file.chart.model_fields_set]:
        raise entry.at(name).error("is given with s57, expected it with geojson only: a cell has its own layers")
    path = entry.at("s57").file(file.chart.s57 or "")
    cell = read_cell(path)
    needed_m, required = rule_text(file.depth, draught_m)
    rules = ShipRules(needed_m=needed_m, margin_m=file.chart.hazard_margin_m, air_draught_m=file.chart.air_draught_m)

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


def cell_zones(cell: Cell, rules: ShipRules, box: Box, frame: LocalFrame) -> ChartZones:
    """The zones of a cell inside bounds."""
    window = around(box)
    areas = [feature for feature in cell.of(*DEPTHS) if feature.geometry.intersects(window)]
    found = closed_water(cell.features, rules, window, frame)
    return ChartZones(
        depth_rule="",
        land=found.solid,
        deep=united([area for area in areas if area.depth_m >= rules.needed_m], window, frame),
        closed=found.closed,
        depths=tuple(
            (depth, united([area for area in areas if area.depth_m == depth], window, frame))
            for depth in sorted({area.depth_m for area in areas if not np.isnan(area.depth_m)})
        ),
        notes=found.notes,
    )
