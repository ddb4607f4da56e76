"""GeoJSON charts to zones: land layers, and layers or single areas of known least depth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import shapely

from expdesign.errors import FileError, InputError, NoPlan
from expdesign.scenario.charts.area_tables import AreaTable, ChartTable
from expdesign.scenario.charts.chart import Chart, read_layers
from expdesign.scenario.charts.dangers import ShipRules, closed_water
from expdesign.scenario.charts.geojson import LAYER_OF_BARE_POLYGONS, POLYGON_TYPES, Feature, read_features
from expdesign.scenario.charts.geojson_dangers import dangers, kind_of, not_used, taken_for
from expdesign.scenario.charts.metres import Box, around, in_metres
from expdesign.scenario.charts.zones import ChartZones, OpenChart, rule_text
from expdesign.scenario.tables import LARGEST, Entry, shown
from expdesign.sea_area import LocalFrame


def open_geojson(file: AreaTable, *, draught_m: float, given: Box | None, entry: Entry) -> OpenChart:
    """The chart that an area file names with `chart.geojson`."""
    path = _chart_path(file.chart, entry)
    features = read_features(path, layer_property=file.chart.layer_property)
    charted = [feature for feature in features if _is_area(feature) or not kind_of(feature, file.chart)]
    areas, depths = _with_depths(charted, file.chart, entry)
    unused = [area for area, before in zip(areas, charted, strict=True) if not kind_of(before, file.chart)]
    chart = _read_chart(file.chart, features, areas, depths, given, entry)
    objects = dangers(features, file.chart, (chart.extent[0] + chart.extent[2]) / 2)
    rules = ShipRules(
        needed_m=rule_text(file.depth, draught_m)[0],
        margin_m=file.chart.hazard_margin_m,
        air_draught_m=file.chart.air_draught_m,
    )

    def zones(box: Box, frame: LocalFrame) -> ChartZones:
        deep, rule = _deep_water(file, depths, draught_m, entry)
        found = closed_water(objects, rules, around(box), frame)
        return ChartZones(
            land=shapely.union(_layer_union(chart, file.chart.land_layers, box, frame), found.solid),
            deep=None if deep is None else _deep_union(file.chart, chart, deep, depths, box, frame),
            closed=found.closed,
            depths=tuple(
                (depths[name], _layer_union(chart, [name], box, frame))
                for name in sorted(depths, key=depths.__getitem__)
            ),
            depth_rule=rule,
            notes=(
                *(f"{path.name}: {note}" for note in (*_assumed(areas, file.chart), *chart.notes, *found.notes)),
                *(f"{path.name}: {note}" for note in taken_for(features, file.chart)),
                *(f"{path.name}: {note}" for note in not_used(unused, {*file.chart.land_layers, *depths})),
                *_beyond_chart(box, chart, deep),
            ),
        )

    return OpenChart(path=path, extent=chart.extent, zones=zones)


def _chart_path(chart: ChartTable, entry: Entry) -> Path:
    if not chart.land_layers and not chart.depth_layers and not chart.depth_property:
        raise entry.at("land_layers").error("is an empty list, expected a layer, or depth_layers to be given")
    if chart.depth_layers is not None and not chart.depth_layers:
        raise entry.at("depth_layers").error("is empty, expected layers with their depth, e.g. seabed5m = 5.0")
    if chart.depth_layers is not None and chart.depth_property is not None:
        raise entry.at("depth_property").error("is given with depth_layers, expected one of the two")
    return entry.at("geojson").file(chart.geojson or "")


def _with_depths(
    features: Sequence[Feature], chart: ChartTable, entry: Entry
) -> tuple[tuple[Feature, ...], dict[str, float]]:
    """The features, those with a depth among their properties in a layer of that depth; and layers with their depth."""
    key = chart.depth_property
    if key is None:
        return tuple(features), dict(chart.depth_layers or {})
    depths: dict[str, float] = {}
    sorted_out = []
    for feature in features:
        value = feature.properties.get(key)
        if value is not None:
            if type(value) not in (int, float) or not abs(value) < LARGEST:
                raise feature.entry.error(f"has {key} = {shown(value)}, expected a depth in metres, a number")
            layer = f"{key} = {value:g}"
            depths[layer] = float(value)
            feature = replace(feature, layer=layer)
        sorted_out.append(feature)
    if not depths:
        raise entry.at("depth_property").unknown(key, sorted({name for item in features for name in item.properties}))
    return tuple(sorted_out), depths


def _assumed(features: tuple[Feature, ...], chart: ChartTable) -> tuple[str, ...]:
    land = sum(feature.assumed and feature.layer == LAYER_OF_BARE_POLYGONS for feature in features)
    some = any(feature.assumed and feature.properties for feature in features)
    return (f"no feature names its {chart.layer_property}, so {land} count as land",) if land and some else ()


def _is_area(feature: Feature) -> bool:
    return feature.geometry["type"] in POLYGON_TYPES


def _read_chart(
    table: ChartTable,
    features: tuple[Feature, ...],
    areas: tuple[Feature, ...],
    depths: Mapping[str, float],
    given: Box | None,
    entry: Entry,
) -> Chart:
    """The layers of areas that the file names."""
    _check_layers(table, sorted({feature.layer for feature in features}), entry)
    layers = dict.fromkeys((*table.land_layers, *depths))
    try:
        return read_layers(areas, layers, near_lon_deg=None if given is None else (given[0] + given[2]) / 2)
    except FileError:
        raise
    except InputError as error:
        raise entry.at("geojson").error(str(error)) from None


def _check_layers(chart: ChartTable, known: list[str], entry: Entry) -> None:
    optional = chart.depth_property is not None and "land_layers" not in chart.model_fields_set
    for index, name in enumerate(chart.land_layers, start=1):
        if name not in known and not optional:
            raise entry.at("land_layers").item(index).unknown(name, known)
    for name in chart.depth_layers or {}:
        if name not in known:
            raise entry.at("depth_layers").unknown(name, known)
        if name in chart.land_layers:
            raise entry.at("depth_layers").at(name).error("is also a land layer, expected one or the other")
    for index, name in enumerate(chart.danger_layers or [], start=1):
        if name not in known:
            raise entry.at("danger_layers").item(index).unknown(name, known)
        if name in chart.land_layers or name in (chart.depth_layers or {}):
            raise entry.at("danger_layers").item(index).error(f"is {shown(name)}, also a layer of land or depth")


def _deep_water(
    file: AreaTable, depths: Mapping[str, float], draught_m: float, entry: Entry
) -> tuple[list[str] | None, str]:
    """The layers that are deep enough, or None when depth is not checked, and the rule in one sentence."""
    needed_m, required = rule_text(file.depth, draught_m)
    if not depths:
        return None, "Depth is not checked: no depth layers are named, all water outside land counts as deep enough."
    deep = sorted((name for name in depths if depths[name] >= needed_m), key=lambda name: depths[name])
    key = file.chart.depth_property
    if not deep:
        deepest = max(depths, key=lambda name: depths[name])
        found = f"no layer is as deep as {required}, the deepest is {deepest!r} with {depths[deepest]:g} m"
        raise NoPlan(str(entry.at("depth_property" if key else "depth_layers").error(found)))
    where = f"where {key} is" if key else f"in the layers {', '.join(deep)}:"
    return deep, f"Allowed water lies {where} at least {depths[deep[0]]:g} m{'' if key else ' deep'} for {required}."


def _deep_union(
    table: ChartTable, chart: Chart, deep: list[str], depths: Mapping[str, float], box: Box, frame: LocalFrame
) -> shapely.Geometry:
    """Water deep enough. Layers state a least depth and may overlap; so may areas with a depth property.

    Where areas with a depth property overlap, the least depth counts.
    """
    water = _layer_union(chart, deep, box, frame)
    shallow = [name for name in depths if name not in deep] if table.depth_property else []
    return shapely.difference(water, _layer_union(chart, shallow, box, frame)) if shallow else water


def _layer_union(chart: Chart, names: Iterable[str], box: Box, frame: LocalFrame) -> shapely.Geometry:
    """The named layers around the bounds, in metres."""
    window = around(box)
    polygons = [polygon for name in names for polygon in chart.layers[name] if polygon.intersects(window)]
    cut = [polygon if window.contains(polygon) else polygon.intersection(window) for polygon in polygons]
    return in_metres(shapely.union_all(cut), frame)


def _beyond_chart(box: Box, chart: Chart, deep: list[str] | None) -> tuple[str, ...]:
    west, south, east, north = chart.extent
    if deep is not None or (box[0] >= west and box[1] >= south and box[2] <= east and box[3] <= north):
        return ()
    return ("the bounds reach beyond the polygons of the chart; the area outside counts as water",)
