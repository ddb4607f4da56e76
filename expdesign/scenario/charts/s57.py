"""S-57 cells (electronic navigational charts) to allowed water: deep, clear of solids, dangers, restricted areas.

Unknown depths count as too shallow. GDAL reads the cell and applies the update files in its folder (.001, .002, ...).
Whether it did is checked against the update number that the cell then states; a gap in the chain of updates is refused.

Source: International Hydrographic Organization, S-57 edition 3.1 (2000), appendix A (object catalogue) and B.1 (ENC
product specification).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
import shapely
from pyogrio.errors import DataSourceError

from expdesign.errors import NoPlan
from expdesign.input_files import check_ends
from expdesign.scenario.charts.zones import (
    BUOYS,
    CLEARANCES,
    DANGERS,
    OVERHEAD,
    SOLID,
    UNSURVEYED,
    AreaTable,
    Box,
    ChartedObject,
    ChartZones,
    OpenChart,
    ShipRules,
    around,
    closed_water,
    rule_text,
    united,
)
from expdesign.scenario.tables import Entry
from expdesign.sea_area import LocalFrame

OPTIONS = {"UPDATES": "APPLY", "SPLIT_MULTIPOINT": "YES", "ADD_SOUNDG_DEPTH": "YES"}
DEPTHS = ("DEPARE", "DRGARE")  # areas with a least depth DRVAL1: natural and dredged
KEEP_OUT = {"7": "entry prohibited", "8": "entry restricted", "14": "area to be avoided"}
"""Values of the attribute RESTRN that keep a trial out."""
WGS84, METRES = 2, 1
DATUMS = {
    1: "mean low water springs",
    3: "mean sea level",
    5: "mean low water",
    8: "approximate lowest astronomical tide",
    12: "mean lower low water",
    19: "approximate mean low water",
    23: "lowest astronomical tide",
    24: "local datum",
}
"""Common values of the sounding datum, VERDAT."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Cell:
    """The features of a cell that limit where a ship may go."""

    # of the classes in `DEPTHS`, `SOLID`, `BUOYS`, `DANGERS`, `OVERHEAD`, `UNSURVEYED`; restricted areas
    features: tuple[ChartedObject, ...]
    notes: tuple[str, ...]  # edition, updates, datum, scale, and repairs

    def of(self, *kinds: str) -> tuple[ChartedObject, ...]:
        """The features of some classes."""
        return tuple(feature for feature in self.features if feature.kind in kinds and not feature.why)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """West, south, east, north of the charted depths [deg]."""
        west, south, east, north = shapely.total_bounds([feature.geometry for feature in self.of(*DEPTHS)])
        return float(west), float(south), float(east), float(north)


def read_cell(path: Path) -> Cell:
    """Read a base cell and its updates.

    Args:
        path: the file `NAME.000`, in one folder with its updates `NAME.001`, ...

    Raises:
        FileError: no S-57 cell, not in WGS84 and metres, an update is missing or did not apply, or no depths in it.
    """
    check_ends(path, "an S-57 cell")
    entry = Entry(path)
    updates = _updates(path, entry)
    try:
        layers = {str(name) for name, _ in pyogrio.list_layers(path)}
        header = _header(path, layers, entry)
        repaired: list[str] = []
        features = tuple(feature for layer in sorted(layers) for feature in _features(path, layer, repaired))
    except DataSourceError as error:
        raise entry.error(f"cannot be read as an S-57 cell: {' '.join(str(error).split())}") from None
    if not any(feature.kind in DEPTHS for feature in features):
        raise entry.error("holds no depth areas, expected an S-57 base cell of a navigational chart")
    return Cell(features=features, notes=(*_notes(header, updates, entry), *_counted(repaired)))


def _updates(path: Path, entry: Entry) -> int:
    """The number of update files of the cell."""
    numbers = sorted(
        int(other.suffix[1:])
        for other in path.parent.glob(f"{path.stem}.[0-9][0-9][0-9]")
        if other.suffix != ".000" and other.stem == path.stem
    )
    for expected, number in enumerate(numbers, start=1):
        if number != expected:
            raise entry.error(
                f"has the update {path.stem}.{number:03d} but not {path.stem}.{expected:03d} in its folder, expected "
                "all updates up to the newest, or none"
            )
    return len(numbers)


def _header(path: Path, layers: set[str], entry: Entry) -> dict[str, Any]:
    if "DSID" not in layers:
        raise entry.error("has no data set identification, expected an S-57 base cell (.000)")
    header = {name: values[0] for name, values in _columns(path, "DSID")[0].items()}
    if header["DSPM_HDAT"] != WGS84:
        raise entry.error(f"has the horizontal datum {header['DSPM_HDAT']}, expected {WGS84} (WGS84)")
    if header["DSPM_DUNI"] != METRES:
        raise entry.error(f"has depth units {header['DSPM_DUNI']}, expected {METRES} (metres)")
    return header


def _columns(path: Path, layer: str) -> tuple[dict[str, Any], Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # encodings of names that are not used
        meta, _, geometry, fields = pyogrio.raw.read(path, layer=layer, **OPTIONS)
    return dict(zip(meta["fields"], fields, strict=True)), geometry


def _features(path: Path, layer: str, repaired: list[str]) -> Iterator[ChartedObject]:
    wanted = {*DEPTHS, *SOLID, *BUOYS, *DANGERS, *OVERHEAD, UNSURVEYED}
    if layer in ("DSID", "C_AGGR", "C_ASSO"):
        return
    columns, raw = _columns(path, layer)
    if raw is None or not (layer in wanted or "RESTRN" in columns):
        return
    geometries = shapely.from_wkb(raw)
    restricted = columns.get("RESTRN", [None] * len(geometries))
    for index, geometry in enumerate(geometries):
        why = _keep_out(restricted[index])
        if geometry is None or geometry.is_empty or not (why or layer in wanted):
            continue
        if not shapely.is_valid(geometry):
            geometry = shapely.make_valid(geometry)
            repaired.append(layer)
        depth = columns.get(DANGERS.get(layer, "DRVAL1"))
        heights = [float(columns[name][index]) for name in CLEARANCES if name in columns]
        found = {
            "kind": layer,
            "geometry": geometry,
            "depth_m": np.nan if depth is None else float(depth[index]),
            "clearance_m": min((height for height in heights if not np.isnan(height)), default=np.nan),
        }
        if layer in wanted:
            yield ChartedObject(**found)
        if why:
            yield ChartedObject(**found, why=why)


def _keep_out(codes: Any) -> str:
    """The reason to keep out, from the list of restrictions of an area, or ""."""
    given = codes if isinstance(codes, Iterable) and not isinstance(codes, str) else str(codes or "").split(",")
    return ", ".join(KEEP_OUT[str(code)] for code in given if str(code) in KEEP_OUT)


def _notes(header: dict[str, Any], updates: int, entry: Entry) -> tuple[str, ...]:
    edition, update, issued = header["DSID_EDTN"], int(header["DSID_UPDN"]), header["DSID_ISDT"]
    if update < updates:
        raise entry.error(f"has {updates} updates in its folder of which {update} apply, expected all to apply")
    state = f"updates 1 to {update} applied" if updates else "no updates in its folder, so none are applied"
    if update and not updates:
        state = f"issued with updates up to {update}, none in its folder"
    datum = DATUMS.get(int(header["DSPM_SDAT"]), f"datum {header['DSPM_SDAT']}")
    return (
        f"edition {edition}, {state}, issued {issued[:4]}-{issued[4:6]}-{issued[6:]}, scale 1:{header['DSPM_CSCL']}",
        f"depths are below {datum}",
    )


def _counted(repaired: list[str]) -> tuple[str, ...]:
    return (f"{len(repaired)} outlines that touch or cross themselves taken apart",) if repaired else ()


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
    solid, closed, notes = closed_water(cell.features, rules, window, frame)
    return ChartZones(
        depth_rule="",
        land=solid,
        deep=united([area for area in areas if area.depth_m >= rules.needed_m], window, frame),
        closed=closed,
        depths=tuple(
            (depth, united([area for area in areas if area.depth_m == depth], window, frame))
            for depth in sorted({area.depth_m for area in areas if not np.isnan(area.depth_m)})
        ),
        notes=notes,
    )
