"""Area files: a chart, bounds, safe depth and no-go zones become allowed water in a local metric frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from expdesign.errors import NoPlan
from expdesign.scenario.charts.area_tables import AreaTable, BoundsTable, NoGoTable
from expdesign.scenario.charts.geojson_zones import open_geojson
from expdesign.scenario.charts.metres import Box, in_metres
from expdesign.scenario.charts.tuning import TUNING
from expdesign.scenario.charts.zones import OpenChart
from expdesign.scenario.tables import Entry, check_table, read_toml, shown
from expdesign.sea_area import LocalFrame, SeaArea, Zones, build_sea_area

KM_PER_DEGREE = 111.2


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
    zones = Zones(
        bounds=in_metres(shapely.box(*box), frame),
        land=found.land,
        no_go=shapely.union(_no_go(file.no_go, frame, entry.at("no_go")), found.closed),
        deep=found.deep,
        depths=found.depths,
    )
    source = f"{chart.path.name}. {file.chart.notice}".strip()
    try:
        return build_sea_area(
            file.area.name,
            frame=frame,
            zones=zones,
            depth_rule=found.depth_rule,
            notes=found.notes,
            source=source,
        )
    except NoPlan as error:
        raise NoPlan("; ".join((f"{path}: {error}", *found.notes))) from None


def _open_chart(file: AreaTable, draught_m: float, given: Box | None, entry: Entry) -> OpenChart:
    chart = file.chart
    if chart.geojson is not None and chart.s57 is not None:
        raise entry.at("s57").error(f"is {shown(chart.s57)} in addition to geojson, expected one chart")
    if chart.s57 is not None:
        from expdesign.scenario.charts.s57_zones import open_cell  # its reader takes a second to load

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
    if max(height_km, width_km) > TUNING.largest_extent_km or max(-south, north) > 85:
        found = "cover" if given else "are missing and the chart covers"
        size = f"{height_km:.0f} x {width_km:.0f} km from latitude {south:.4g} to {north:.4g}"
        raise entry.error(f"{found} {size}, expected at most {TUNING.largest_extent_km:g} km and no pole")
    chart_west, chart_south, chart_east, chart_north = chart.extent
    if given and (west > chart_east or east < chart_west or south > chart_north or north < chart_south):
        covered = f"{chart_south:.5g} to {chart_north:.5g} and longitudes {chart_west:.5g} to {chart_east:.5g}"
        raise entry.error(f"do not meet the chart, expected an overlap with its latitudes {covered}")
    return west, south, east, north


def _frame(box: Box) -> LocalFrame:
    west, south, east, north = box
    return LocalFrame((south + north) / 2, ((west + east) / 2 + 180) % 360 - 180)


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
        polygons.append(in_metres(polygon, frame))
    return shapely.union_all(polygons)
