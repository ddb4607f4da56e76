"""Area files: a chart, bounds, safe depth and no-go zones become allowed water in a local metric frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from expdesign.errors import NoPlan
from expdesign.scenario.charts.geojson_zones import open_geojson
from expdesign.scenario.charts.zones import (
    KM_PER_DEGREE,
    LARGEST_EXTENT_KM,
    LARGEST_LATITUDE_DEG,
    AreaTable,
    BoundsTable,
    Box,
    NoGoTable,
    OpenChart,
    beside,
    far_outside,
    in_metres,
    off_km,
    swapped_meets,
)
from expdesign.scenario.tables import Entry, check_table, read_toml, shown
from expdesign.sea_area import LocalFrame, SeaArea, Zones, build_sea_area
from expdesign.values import Array

LAT_LON_SWAPPED = ", expected [latitude, longitude]: with the two swapped it lies in the area"


def load_area(path: Path | str, *, draught_m: float) -> SeaArea:
    """Read an area file and its chart.

    Args:
        path: a TOML file with `[area]`, `[chart]` and optionally `[bounds]`, `[depth]` and `[[no_go]]`.
        draught_m: of the vessel; water must be deeper by the file's `under_keel_m` [m].

    Returns:
        Allowed water in a frame centred on the bounds.

    Raises:
        FileError: the file or its chart is unreadable, or something in it is wrong, missing or unknown.
        NoPlan: no water remains; the message states the reason.
    """
    entry = Entry(Path(path))
    file = check_table(AreaTable, read_toml(entry.path), entry)
    given = _given_bounds(file.bounds, entry.at("bounds"))
    chart = _open_chart(file, draught_m, given, entry.at("chart"))
    box = _checked_bounds(given, chart, entry.at("bounds"))
    frame = _frame(box)
    found = chart.zones(box, frame)
    named, without_effect = _no_go(file.no_go, box, frame, entry.at("no_go"))
    zones = Zones(
        bounds=in_metres(shapely.box(*box), frame),
        land=found.land,
        no_go=shapely.union_all([*(polygon for _, polygon in named), found.closed]),
        named=named,
        deep=found.deep,
        depths=found.depths,
    )
    notes = (*found.notes, *without_effect)
    source = f"{chart.path.name}. {file.chart.notice}".strip()
    try:
        return build_sea_area(
            file.area.name,
            frame=frame,
            zones=zones,
            depth_rule=found.depth_rule,
            notes=notes,
            source=source,
        )
    except NoPlan as error:
        raise NoPlan("; ".join((f"{path}: {error}", *notes))) from None


def _open_chart(file: AreaTable, draught_m: float, given: Box | None, entry: Entry) -> OpenChart:
    chart = file.chart
    if chart.geojson is not None and chart.s57 is not None:
        raise entry.at("s57").error(f"is {shown(chart.s57)} in addition to geojson, expected one chart")
    if chart.s57 is not None:
        from expdesign.scenario.charts.s57 import open_cell  # its reader takes a second to load

        return open_cell(file, draught_m=draught_m, entry=entry)
    if chart.geojson is None:
        raise entry.at("geojson").error("is missing, expected the path of a GeoJSON chart, or s57 with that of a cell")
    return open_geojson(file, draught_m=draught_m, given=given, entry=entry)


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


def _checked_bounds(given: Box | None, chart: OpenChart, entry: Entry) -> Box:
    """The given bounds, or the chart's extent, if a local frame can hold them."""
    west, south, east, north = given or chart.extent
    height_km = (north - south) * KM_PER_DEGREE
    width_km = (east - west) * KM_PER_DEGREE * float(np.cos(np.radians((south + north) / 2)))
    if max(height_km, width_km) > LARGEST_EXTENT_KM or max(-south, north) > LARGEST_LATITUDE_DEG:
        found = "cover" if given else "are missing and the chart covers"
        sides = " x ".join(f"{side:.0f}" if side >= 10.0 else f"{side:.2g}" for side in (height_km, width_km))
        allowed = f"at most {LARGEST_EXTENT_KM:g} km, at most {LARGEST_LATITUDE_DEG:g} degrees from the equator"
        raise entry.error(f"{found} {sides} km from latitude {south:.4g} to {north:.4g}, expected {allowed}")
    chart_west, chart_south, chart_east, chart_north = chart.extent
    extent = shapely.box(*chart.extent)
    if given and not shapely.box(*given).intersects(extent):
        covered = f"{chart_south:.5g} to {chart_north:.5g} and longitudes {chart_west:.5g} to {chart_east:.5g}"
        swapped = "; with latitudes and longitudes swapped, here or in the chart, they meet"
        meet = shapely.box(south, west, north, east).intersects(extent)
        raise entry.error(
            f"do not meet the chart, expected an overlap with its latitudes {covered}{swapped if meet else ''}"
        )
    return west, south, east, north


def _frame(box: Box) -> LocalFrame:
    west, south, east, north = box
    return LocalFrame((south + north) / 2, ((west + east) / 2 + 180) % 360 - 180)


def _no_go(
    zones: list[NoGoTable], box: Box, frame: LocalFrame, entry: Entry
) -> tuple[tuple[tuple[str, shapely.Geometry], ...], tuple[str, ...]]:
    """Name and polygon in metres of the zones, and one sentence for each that closes nothing."""
    named, notes = [], []
    for index, zone in enumerate(zones, start=1):
        place = entry.item(index).at("polygon")
        for number, (lat, lon) in enumerate(zone.polygon, start=1):
            if not (abs(lat) <= 90 and -180 <= lon <= 360):
                swapped = LAT_LON_SWAPPED if swapped_meets(np.array([[lon, lat]]), box) else ""
                raise place.item(number).error(
                    f"is [{lat:g}, {lon:g}], expected [latitude, longitude] in degrees{swapped}"
                )
        corners = beside(np.array(zone.polygon)[:, ::-1], box)
        _check_near(corners, zone.name, box, place)
        polygon = shapely.Polygon(corners)
        if not shapely.is_valid(polygon) or polygon.area == 0:
            raise place.error(f"of {zone.name!r} crosses itself or has no area, expected a simple outline")
        if polygon.intersects(shapely.box(*box)):
            named.append((zone.name, in_metres(polygon, frame)))
        else:
            off = f"{off_km(polygon, box):.3g} km outside the bounds"
            notes.append(f"no-go zone {zone.name!r} lies {off} and closes nothing")
    return tuple(named), tuple(notes)


def _check_near(corners: Array, name: str, box: Box, place: Entry) -> None:
    """Raise for a zone, or a corner of one, that lies far outside the bounds, or in them with its numbers swapped.

    A zone outside the bounds may well be meant, but closes nothing.
    """
    off = off_km(shapely.MultiPoint(corners).convex_hull, box)
    swapped = swapped_meets(corners, box)
    if off > 0 and (swapped or off > LARGEST_EXTENT_KM):
        expected = LAT_LON_SWAPPED if swapped else ", expected corners [latitude, longitude] near them"
        raise place.error(f"of {name!r} lies {off:.4g} km outside the bounds{expected}")
    for number in np.flatnonzero(far_outside(corners, box)).tolist():
        if not swapped_meets(corners[number : number + 1], box):
            continue
        (lon, lat), off = corners[number], off_km(shapely.Point(corners[number]), box)
        raise place.item(number + 1).error(f"is [{lat:g}, {lon:g}], {off:.4g} km outside the bounds{LAT_LON_SWAPPED}")
