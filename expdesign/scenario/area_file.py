"""Area files: a chart, bounds, safe depth and no-go zones become allowed water in a local metric frame."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import shapely
from pydantic import Field

from expdesign.errors import FileError, InputError, NoPlan
from expdesign.plan.area import LocalFrame, SeaArea, Zones, build_sea_area
from expdesign.scenario.chart import Chart, read_layers
from expdesign.scenario.geojson import Feature, read_features
from expdesign.scenario.tables import (
    Entry,
    NonNegative,
    Number,
    Table,
    Text,
    check_table,
    read_toml,
    shown,
)

Latitude = Annotated[float, Field(ge=-90, le=90)]
Longitude = Annotated[float, Field(ge=-180, le=360)]
LARGEST_EXTENT_KM = 250.0
KM_PER_DEGREE = 111.2
STEP_DEG = 0.005
"""Chart edges are straight in latitude and longitude; cut into pieces this long they are straight in the frame too,
to a centimetre."""

Box = tuple[float, float, float, float]
"""West, south, east, north [deg]; east is above west even over the antimeridian."""


class NameTable(Table):
    """`[area]`."""

    name: Text = Field(description="a name for the area")


class ChartTable(Table):
    """`[chart]`."""

    geojson: Text | None = None
    s57: Any = None
    land_layers: list[Text] = Field(default=["land"])
    depth_layers: dict[str, Number] | None = None
    notice: str = ""


class BoundsTable(Table):
    """`[bounds]`."""

    south_deg: Latitude = Field(description="the southern latitude [deg]")
    west_deg: Longitude = Field(description="the western longitude [deg]")
    north_deg: Latitude = Field(description="the northern latitude [deg]")
    east_deg: Longitude = Field(description="the eastern longitude [deg]")


class DepthTable(Table):
    """`[depth]`."""

    under_keel_m: NonNegative = 1.0


class NoGoTable(Table):
    """One of `[[no_go]]`."""

    name: Text = Field(description="a name for the zone")
    polygon: list[Annotated[list[Number], Field(min_length=2, max_length=2)]] = Field(
        min_length=3, description="a list of [latitude, longitude]"
    )


class AreaTable(Table):
    """The whole file."""

    area: NameTable = Field(description="a table [area] with a name")
    chart: ChartTable = Field(description="a table [chart] with the chart file")
    bounds: BoundsTable | None = None
    depth: DepthTable = DepthTable()
    no_go: list[NoGoTable] = Field(default=[])


def load_area(path: Path | str, *, draught_m: float) -> SeaArea:
    """Read an area file and its chart.

    Args:
        path: a TOML file with `[area]`, `[chart]` and optionally `[bounds]`, `[depth]` and `[[no_go]]`.
        draught_m: of the vessel; water must be deeper by the file's `under_keel_m` [m].

    Returns:
        Allowed water in a frame centred on the bounds.

    Raises:
        FileError: the file or its chart is unreadable, or something in it is wrong, missing or unknown.
        NoPlan: no water remains; the message says why.
    """
    entry = Entry(Path(path))
    file = check_table(AreaTable, read_toml(entry.path), entry)
    chart_path = _chart_path(file.chart, entry.at("chart"))
    given = _given_bounds(file.bounds, entry.at("bounds"))
    chart = _read_chart(file.chart, read_features(chart_path), given, entry.at("chart"))
    box = _checked_bounds(given, chart, entry.at("bounds"))
    frame = _frame(box)
    deep, depth_rule = _deep_water(file, draught_m, entry.at("chart.depth_layers"))
    zones = Zones(
        bounds=_in_metres(shapely.box(*box), frame),
        land=_layer_union(chart, file.chart.land_layers, box, frame),
        no_go=_no_go(file.no_go, frame, entry.at("no_go")),
        deep=None if deep is None else _layer_union(chart, deep, box, frame),
    )
    notes = (*(f"{chart_path.name}: {note}" for note in chart.notes), *_beyond_chart(box, chart, deep))
    source = f"{chart_path.name}. {file.chart.notice}".strip()
    try:
        return build_sea_area(
            file.area.name, frame=frame, zones=zones, depth_rule=depth_rule, notes=notes, source=source
        )
    except NoPlan as error:
        raise NoPlan(f"{path}: {error}") from None


def _chart_path(chart: ChartTable, entry: Entry) -> Path:
    if chart.s57 is not None:
        raise entry.at("s57").error(f"is {shown(chart.s57)}, expected geojson instead: S-57 cells are not read so far")
    if chart.geojson is None:
        raise entry.at("geojson").error("is missing, expected the path of a GeoJSON chart")
    if not chart.land_layers and not chart.depth_layers:
        raise entry.at("land_layers").error("is an empty list, expected a layer, or depth_layers to be given")
    if chart.depth_layers is not None and not chart.depth_layers:
        raise entry.at("depth_layers").error("is empty, expected layers with their depth, e.g. seabed5m = 5.0")
    return entry.at("geojson").file(chart.geojson)


def _read_chart(table: ChartTable, features: tuple[Feature, ...], given: Box | None, entry: Entry) -> Chart:
    """The layers that the file names."""
    known = sorted({feature.layer for feature in features})
    _check_layers(table, known, entry)
    layers = dict.fromkeys((*table.land_layers, *(table.depth_layers or {})))
    try:
        return read_layers(features, layers, near_lon_deg=None if given is None else (given[0] + given[2]) / 2)
    except FileError:
        raise
    except InputError as error:
        raise entry.at("geojson").error(str(error)) from None


def _check_layers(chart: ChartTable, known: list[str], entry: Entry) -> None:
    for index, name in enumerate(chart.land_layers, start=1):
        if name not in known:
            raise entry.at("land_layers").item(index).unknown(name, known)
    for name in chart.depth_layers or {}:
        if name not in known:
            raise entry.at("depth_layers").unknown(name, known)
        if name in chart.land_layers:
            raise entry.at("depth_layers").at(name).error("is also a land layer, expected one or the other")


def _given_bounds(bounds: BoundsTable | None, entry: Entry) -> Box | None:
    if bounds is None:
        return None
    south, west, north, east = bounds.south_deg, bounds.west_deg, bounds.north_deg, bounds.east_deg
    if not south < north:
        raise entry.at("north_deg").error(f"is {shown(north)}, expected more than south_deg = {shown(south)}")
    width = (east - west) % 360
    if not 0 < width < 180:
        raise entry.at("east_deg").error(f"is {shown(east)}, expected east of west_deg = {shown(west)}")
    return west, south, west + width, north


def _checked_bounds(given: Box | None, chart: Chart, entry: Entry) -> Box:
    """The given bounds, or the chart's extent, if a local frame can hold them."""
    west, south, east, north = given or chart.extent
    height_km = (north - south) * KM_PER_DEGREE
    width_km = (east - west) * KM_PER_DEGREE * float(np.cos(np.radians((south + north) / 2)))
    if max(height_km, width_km) > LARGEST_EXTENT_KM or max(-south, north) > 85:
        found = "cover" if given else "are missing and the chart covers"
        size = f"{height_km:.0f} x {width_km:.0f} km from latitude {south:.4g} to {north:.4g}"
        raise entry.error(f"{found} {size}, expected at most {LARGEST_EXTENT_KM:g} km and no pole")
    chart_west, chart_south, chart_east, chart_north = chart.extent
    if given and (west > chart_east or east < chart_west or south > chart_north or north < chart_south):
        covered = f"{chart_south:.5g} to {chart_north:.5g} and longitudes {chart_west:.5g} to {chart_east:.5g}"
        raise entry.error(f"do not meet the chart, expected an overlap with its latitudes {covered}")
    return west, south, east, north


def _frame(box: Box) -> LocalFrame:
    west, south, east, north = box
    return LocalFrame((south + north) / 2, ((west + east) / 2 + 180) % 360 - 180)


def _deep_water(file: AreaTable, draught_m: float, entry: Entry) -> tuple[list[str] | None, str]:
    """The layers that are deep enough, or None when depth is not checked, and the sentence that says so."""
    margin_m = file.depth.under_keel_m
    needed_m = draught_m + margin_m
    depths = file.chart.depth_layers
    if depths is None:
        return None, "Depth is not checked: no depth layers are named, all water outside land counts as deep enough."
    deep = sorted((name for name in depths if depths[name] >= needed_m), key=lambda name: depths[name])
    wish = f"{draught_m:g} m draught + {margin_m:g} m under the keel = {needed_m:g} m"
    if not deep:
        deepest = max(depths, key=lambda name: depths[name])
        found = f"no layer is as deep as {wish}, the deepest is {deepest!r} with {depths[deepest]:g} m"
        raise NoPlan(str(entry.error(found)))
    return deep, f"Allowed water lies in the layers {', '.join(deep)}: at least {depths[deep[0]]:g} m deep for {wish}."


def _layer_union(chart: Chart, names: Iterable[str], box: Box, frame: LocalFrame) -> shapely.Geometry:
    """The named layers around the bounds, in metres."""
    west, south, east, north = box
    margin = 0.02 * max(east - west, north - south)
    around = shapely.box(west - margin, south - margin, east + margin, north + margin)
    polygons = [polygon for name in names for polygon in chart.layers[name] if polygon.intersects(around)]
    cut = [polygon if around.contains(polygon) else polygon.intersection(around) for polygon in polygons]
    return _in_metres(shapely.union_all(cut), frame)


def _in_metres(geometry: shapely.Geometry, frame: LocalFrame) -> shapely.Geometry:
    """(longitude, latitude) [deg] -> valid geometry (east_m, north_m)."""
    if geometry.is_empty:
        return geometry
    fine = shapely.segmentize(geometry, STEP_DEG)
    metres = shapely.transform(fine, lambda points: frame.to_metres(points[:, ::-1])[:, ::-1])
    return metres if shapely.is_valid(metres) else shapely.make_valid(metres)


def _no_go(zones: list[NoGoTable], frame: LocalFrame, entry: Entry) -> shapely.Geometry:
    polygons = []
    for index, zone in enumerate(zones, start=1):
        place = entry.item(index).at("polygon")
        corners = np.array(zone.polygon)
        for number, (lat, lon) in enumerate(zone.polygon, start=1):
            if not (abs(lat) <= 90 and -180 <= lon <= 360):
                raise place.item(number).error(f"is [{lat:g}, {lon:g}], expected [latitude, longitude] in degrees")
        corners[:, 1] += 360 * np.round((frame.lon_deg - corners[:, 1]) / 360)
        polygon = shapely.Polygon(corners[:, ::-1])
        if not shapely.is_valid(polygon) or polygon.area == 0:
            raise place.error(f"of {zone.name!r} crosses itself or has no area, expected a simple outline")
        polygons.append(_in_metres(polygon, frame))
    return shapely.union_all(polygons)


def _beyond_chart(box: Box, chart: Chart, deep: list[str] | None) -> tuple[str, ...]:
    west, south, east, north = chart.extent
    if deep is not None or (box[0] >= west and box[1] >= south and box[2] <= east and box[3] <= north):
        return ()
    return ("the bounds reach beyond everything drawn in the chart; what lies there counts as water",)
