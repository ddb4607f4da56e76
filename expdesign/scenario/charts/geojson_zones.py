"""GeoJSON charts to zones: land, water, and layers or single areas of known least depth.

Which side of an outline is water is never guessed: its layer says it, or the area file.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import reduce
from pathlib import Path

import numpy as np
import shapely

from expdesign.errors import FileError, InputError, NoPlan
from expdesign.scenario.charts.geojson import UNNAMED, Chart, Feature, positions_in, read_features, read_layers
from expdesign.scenario.charts.geojson_dangers import dangers, kind_of, not_used, taken_for
from expdesign.scenario.charts.zones import (
    KM_PER_DEGREE,
    LARGEST_EXTENT_KM,
    AreaTable,
    Box,
    ChartedObject,
    ChartTable,
    ChartZones,
    OpenChart,
    ShipRules,
    around,
    beside,
    closed_water,
    far_outside,
    in_metres,
    off_km,
    rule_text,
    swapped_meets,
)
from expdesign.scenario.tables import LARGEST, Entry, offer, shown
from expdesign.sea_area import LocalFrame

ROUNDING = 1e-9  # share of an area that is rounding


def open_geojson(file: AreaTable, *, draught_m: float, given: Box | None, entry: Entry) -> OpenChart:
    """The chart that an area file names with `chart.geojson`."""
    table, path = file.chart, _chart_path(file.chart, entry)
    with _or_skipped(path, table, entry):
        features = read_features(
            path,
            layer_property=table.layer_property,
            skip=table.skip_features,
            stated_at=entry.at("skip_features"),
        )
        charted = [feature for feature in features if _is_charted(feature, table)]
        _check_unnamed(charted, path, table, entry)
        areas, depths = _with_depths(charted, features, table, entry)
        unused = [area for area, before in zip(areas, charted, strict=True) if not kind_of(before, table)]
        chart = _read_chart(table, features, areas, depths, given, entry)
        objects = dangers(features, table, (chart.extent[0] + chart.extent[2]) / 2)
        used = {*table.land_layers, *table.water_layers, *depths, UNNAMED}
        counted = [item for item in features if item.layer in used or kind_of(item, table)]
        if given is None:
            _check_order(counted, _middle(counted), "most of the chart")
    signs = _sign_of_depths(depths, objects, path, table, entry)
    rules = ShipRules(
        needed_m=rule_text(file.depth, draught_m)[0],
        margin_m=table.hazard_margin_m,
        air_draught_m=table.air_draught_m,
    )

    def zones(box: Box, frame: LocalFrame) -> ChartZones:
        with _or_skipped(path, table, entry):
            _check_order(counted, box, "the bounds")
        deep, rule = _deep_water(file, depths, draught_m, entry)
        solid, closed, rules_notes = closed_water(objects, rules, around(box), frame)
        return ChartZones(
            land=shapely.union(_land(chart, table, depths, box, frame), solid),
            deep=None if deep is None else _deep_union(table, chart, deep, depths, box, frame),
            closed=closed,
            depths=tuple(
                (depths[name], _layer_union(chart, [name], box, frame))
                for name in sorted(depths, key=depths.__getitem__)
            ),
            depth_rule=rule,
            notes=(
                *(
                    f"{path.name}: {note}"
                    for note in (
                        *_said_of_outlines(areas, chart, table),
                        *_said_of_skipped(table),
                        *signs,
                        *chart.notes,
                        *rules_notes,
                        *taken_for(features, table),
                        *not_used(unused, used),
                    )
                ),
                *_beyond_chart(box, chart, table, deep),
            ),
        )

    return OpenChart(path=path, extent=chart.extent, zones=zones)


@contextmanager
def _or_skipped(path: Path, table: ChartTable, entry: Entry) -> Iterator[None]:
    """Add to the refusal of a feature how to leave it out."""
    try:
        yield
    except FileError as error:
        found = re.match(r"feature (\d+)", error.key) if error.path == path else None
        if found is None:
            raise
        numbers = ", ".join(map(repr, (*table.skip_features, int(found[1]))))
        way_out = (
            f"or skip_features = [{numbers}] below [chart] of {entry.path.name}, which leaves it out: land or a danger "
            "in it would then count as water"
        )
        raise FileError(path, error.key, f"{error.problem}; {way_out}") from None


def _middle(features: Sequence[Feature]) -> Box:
    """A box around where most corners are, as large as a sea area may be."""
    lon, lat = np.median([corner for feature in features for corner in positions_in(feature.geometry)], axis=0)
    half = LARGEST_EXTENT_KM / KM_PER_DEGREE / 2
    wide = half / max(float(np.cos(np.radians(lat))), 0.05)
    return lon - wide, lat - half, lon + wide, lat + half


def _check_order(features: Sequence[Feature], box: Box, name: str) -> None:
    """Refuse a feature far outside a box that lies in it with longitude and latitude swapped."""
    first = beside(np.array([next(positions_in(feature.geometry)) for feature in features]), box)
    for index in np.flatnonzero(far_outside(first, box)).tolist():
        feature = features[index]
        if swapped_meets(np.array(list(positions_in(feature.geometry))), box):
            raise feature.entry.error(
                f"lies {off_km(shapely.Point(first[index]), box):.4g} km outside {name}, expected [longitude, "
                "latitude]: with the two swapped it lies inside"
            )


def _is_charted(feature: Feature, table: ChartTable) -> bool:
    """Whether a feature is no danger, or an area of a named layer, which may be one besides."""
    return (feature.is_area and feature.layer != UNNAMED) or not kind_of(feature, table)


def _check_unnamed(features: Sequence[Feature], path: Path, table: ChartTable, entry: Entry) -> None:
    """Refuse features that name no layer where nothing says what they enclose."""
    unnamed = [feature for feature in features if feature.layer == UNNAMED]
    for feature in unnamed:
        if not feature.is_area:
            found = f"is a {feature.geometry['type']} that names no {table.layer_property}"
            raise feature.entry.error(f"{found}, expected Polygon or MultiPolygon")
    if not unnamed or table.outlines is not None or table.depth_property is not None:
        return
    names = sorted({name for item in unnamed for name, value in item.properties.items() if isinstance(value, str)})
    other = f"; or layer_property, one of {', '.join(names)}, with land_layers or water_layers" if names else ""
    counted = f"{len(unnamed)} outlines enclose" if len(unnamed) > 1 else "the outline encloses"
    raise entry.at("outlines").error(
        f"is missing, and no property {table.layer_property!r} in {path.name} says what {counted}, expected 'water' or "
        f"'land'{other}"
    )


def _chart_path(chart: ChartTable, entry: Entry) -> Path:
    if not (chart.land_layers or chart.outlines or chart.water_layers or chart.depth_layers or chart.depth_property):
        raise entry.at("land_layers").error("is an empty list, expected a layer, or depth_layers to be given")
    if chart.depth_layers is not None and not chart.depth_layers:
        raise entry.at("depth_layers").error("is empty, expected layers with their depth, e.g. seabed5m = 5.0")
    if chart.depth_layers is not None and chart.depth_property is not None:
        raise entry.at("depth_property").error("is given with depth_layers, expected one of the two")
    return entry.at("geojson").file(chart.geojson or "")


def _with_depths(
    features: Sequence[Feature], spots: Sequence[Feature], chart: ChartTable, entry: Entry
) -> tuple[tuple[Feature, ...], dict[str, float]]:
    """The features, those with a depth among their properties in a layer of that depth; and layers with their depth.

    `spots` are all features, soundings among them.
    """
    key = chart.depth_property
    if key is None:
        return tuple(features), {name: chart.below(depth) for name, depth in (chart.depth_layers or {}).items()}
    depths: dict[str, float] = {}
    sorted_out = []
    for feature in features:
        value = feature.properties.get(key)
        if value is not None:
            if type(value) not in (int, float) or not abs(value) < LARGEST:
                raise feature.entry.error(f"has {key} = {shown(value)}, expected a depth in metres, a number")
            depth = chart.below(float(value))
            layer = f"{key} = {value:g}"
            depths[layer] = depth
            feature = replace(feature, layer=layer)
        sorted_out.append(feature)
    if not depths:
        if any(kind_of(item, chart) == "SOUNDG" for item in spots):
            raise entry.at("depth_property").error(
                f"is {shown(key)}, which only points state, expected areas of water with it: what lies between "
                "soundings is not known"
            )
        raise entry.at("depth_property").unknown(key, sorted({name for item in features for name in item.properties}))
    return tuple(sorted_out), depths


def _said_of_outlines(areas: Sequence[Feature], chart: Chart, table: ChartTable) -> Iterator[str]:
    """What polygons that name no layer count as."""
    unnamed, polygons = sum(area.layer == UNNAMED for area in areas), chart.layers.get(UNNAMED, ())
    if unnamed and table.outlines is None:
        yield f"{unnamed} polygons name no {table.layer_property} and no {table.depth_property}, so they count as land"
    elif unnamed:
        yield f"{unnamed} polygons name no {table.layer_property} and enclose {table.outlines}, as outlines says"
    if table.outlines == "water" and _islands(polygons).area < shapely.union_all(polygons).area * (1 - ROUNDING):
        yield "outlines in others are islands: what an even number of them encloses counts as land"


def _said_of_skipped(table: ChartTable) -> Iterator[str]:
    if table.skip_features:
        yield f"left out, as skip_features says: features {', '.join(map(str, table.skip_features))}"


def _sign_of_depths(
    depths: Mapping[str, float], objects: Sequence[ChartedObject], path: Path, table: ChartTable, entry: Entry
) -> tuple[str, ...]:
    """Say which depths are above water; refuse a chart where most would be, unless the file says how they count.

    Only rocks, wrecks and obstructions usually dry.
    """
    found = [*depths.values(), *(item.depth_m for item in objects if item.kind == "SOUNDG")]
    found = [depth for depth in found if not np.isnan(depth)]
    dry = [depth for depth in found if depth < 0]
    if not dry:
        return ()
    heights = table.depth_positive == "up"
    stated = (
        f"{len(dry)} of {len(found)} depths of {path.name} are {'heights above the surface' if heights else 'negative'}"
    )
    if 2 * len(dry) >= len(found) and table.depth_positive is None:
        raise entry.at("depth_positive").error(
            f"is missing, and {stated} ({min(dry):g} to {max(dry):g} m), expected 'up' where they are heights, "
            "negative below the surface, or 'down' where they are depths of what dries"
        )
    return (f"{stated.replace(f' of {path.name}', '')}, which count as above water",)


def _read_chart(
    table: ChartTable,
    features: tuple[Feature, ...],
    areas: tuple[Feature, ...],
    depths: Mapping[str, float],
    given: Box | None,
    entry: Entry,
) -> Chart:
    """The layers of areas that the file names."""
    _check_layers(table, sorted({feature.layer for feature in features} - {UNNAMED}), entry)
    layers = dict.fromkeys((*table.land_layers, *table.water_layers, *depths, UNNAMED))
    try:
        return read_layers(areas, layers, near_lon_deg=None if given is None else (given[0] + given[2]) / 2)
    except FileError:
        raise
    except InputError as error:
        raise entry.at("geojson").error(str(error)) from None


def _check_layers(chart: ChartTable, known: list[str], entry: Entry) -> None:
    optional = bool(chart.depth_property or chart.water_layers or chart.outlines)
    for index, name in enumerate(chart.land_layers, start=1):
        if name not in known and not (optional and "land_layers" not in chart.model_fields_set):
            other = "; water_layers and depth_layers name those of water"
            raise entry.at("land_layers").item(index).error(f"is {shown(name)}, {offer(name, tuple(known))}{other}")
    for index, name in enumerate(chart.water_layers, start=1):
        if name not in known:
            raise entry.at("water_layers").item(index).unknown(name, known)
        if name in chart.land_layers:
            raise entry.at("water_layers").item(index).error(f"is {shown(name)}, also a layer of land")
    for name in chart.depth_layers or {}:
        if name not in known:
            raise entry.at("depth_layers").unknown(name, known)
        if name in chart.land_layers:
            raise entry.at("depth_layers").at(name).error("is also a land layer, expected one or the other")
    for index, name in enumerate(chart.danger_layers or [], start=1):
        if name not in known:
            raise entry.at("danger_layers").item(index).unknown(name, known)
        if name in (*chart.land_layers, *chart.water_layers, *(chart.depth_layers or {})):
            raise entry.at("danger_layers").item(index).error(f"is {shown(name)}, also a layer of land or water")


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


def _land(chart: Chart, table: ChartTable, depths: Iterable[str], box: Box, frame: LocalFrame) -> shapely.Geometry:
    """Land layers, and what is outside the water where the chart says what water is."""
    outlines = [] if table.outlines == "water" else [UNNAMED]
    land = _layer_union(chart, [*table.land_layers, *outlines], box, frame)
    if not table.water_layers and outlines:
        return land
    water = _layer_union(chart, [*table.water_layers, *depths], box, frame)
    if not outlines:
        islands = _islands(chart.layers[UNNAMED]).intersection(around(box))
        water = shapely.union(water, in_metres(islands, frame))
    return shapely.union(land, shapely.difference(in_metres(around(box), frame), water))


def _islands(polygons: Sequence[shapely.Polygon]) -> shapely.Geometry:
    """What an odd number of polygons encloses: the water of outlines in which others are islands."""
    return reduce(shapely.symmetric_difference, polygons, shapely.MultiPolygon())


def _layer_union(chart: Chart, names: Iterable[str], box: Box, frame: LocalFrame) -> shapely.Geometry:
    """The named layers around the bounds, in metres."""
    window = around(box)
    polygons = [polygon for name in names for polygon in chart.layers[name] if polygon.intersects(window)]
    cut = [polygon if window.contains(polygon) else polygon.intersection(window) for polygon in polygons]
    return in_metres(shapely.union_all(cut), frame)


def _beyond_chart(box: Box, chart: Chart, table: ChartTable, deep: list[str] | None) -> tuple[str, ...]:
    west, south, east, north = chart.extent
    closed = deep is not None or table.outlines == "water" or table.water_layers
    if closed or (box[0] >= west and box[1] >= south and box[2] <= east and box[3] <= north):
        return ()
    return ("the bounds reach beyond the polygons of the chart; the area outside counts as water",)
