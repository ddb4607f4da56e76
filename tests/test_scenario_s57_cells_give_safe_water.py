import shutil
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely

from expdesign.errors import FileError, NoPlan
from expdesign.scenario import load_area
from sample_files import SAMPLES

CELL = SAMPLES / "noaa-enc" / "US5WA22M.000"
DRAUGHT_M, NEEDED_M = 2.5, 3.5


def write_area(folder: Path, cell: Path, chart: str = "", rest: str = "") -> Path:
    path = folder / "area.toml"
    path.write_text(f'[area]\nname = "a"\n[chart]\ns57 = "{cell}"\n{chart}\n{rest}', encoding="utf-8")
    return path


def features(layer: str, **options: str):
    """Geometries and columns of a layer, read here on its own."""
    meta, _, raw, columns = pyogrio.raw.read(CELL, layer=layer, **options)
    return shapely.from_wkb(raw), dict(zip(meta["fields"], columns, strict=True))


def in_frame(area, geometries):
    """Degrees to metres, vertex by vertex: cells have short edges."""
    return shapely.transform(geometries, lambda xy: area.frame.to_metres(xy[:, ::-1])[:, ::-1])


@pytest.fixture(scope="module")
def harbour(tmp_path_factory):
    return load_area(write_area(tmp_path_factory.mktemp("cell"), CELL), draught_m=DRAUGHT_M)


@pytest.mark.thorough
def test_no_charted_danger_lies_in_the_water(harbour):
    depths, columns = features("SOUNDG", SPLIT_MULTIPOINT="YES", ADD_SOUNDG_DEPTH="YES")
    shoal = shapely.force_2d(depths[columns["DEPTH"] < NEEDED_M])
    wrecks, values = features("WRECKS")
    dangerous = wrecks[np.isnan(values["VALSOU"]) | (values["VALSOU"] < NEEDED_M)]
    assert len(shoal) > 50
    assert len(dangerous) > 5
    points = in_frame(harbour, np.concatenate([shoal, dangerous]))
    assert shapely.distance(points, harbour.water).min() >= 25.0 * np.cos(np.pi / 32) - 0.01


def test_water_lies_in_areas_charted_deep_enough_and_off_land(harbour):
    deep = []
    for layer in ("DEPARE", "DRGARE"):
        areas, columns = features(layer)
        deep.extend(areas[columns["DRVAL1"] >= NEEDED_M])
    charted = shapely.union_all(in_frame(harbour, np.array(deep)))
    assert harbour.water.difference(charted.buffer(0.01)).area < 1.0
    land, _ = features("LNDARE")
    assert harbour.water.intersection(shapely.union_all(in_frame(harbour, land))).area < 1.0
    assert harbour.water.area > 0.9 * charted.area


def test_the_security_zone_is_closed_and_said(harbour):
    zones, columns = features("RESARE")
    closed = [zone for zone, codes in zip(zones, columns["RESTRN"], strict=True) if "8" in list(codes)]
    assert len(closed) == 1
    assert harbour.water.intersection(in_frame(harbour, closed[0])).area < 1.0
    assert any("1 areas closed by rule: entry restricted" in note for note in harbour.notes)


def test_edition_updates_and_datum_are_noted(harbour):
    assert any("edition 40, updates 1 to 4 applied, issued 2020-06-26" in note for note in harbour.notes)
    assert any("mean lower low water" in note for note in harbour.notes)


@pytest.mark.thorough
def test_missing_update_files_are_noted_and_a_gap_is_refused(tmp_path):
    cell = Path(shutil.copy(CELL, tmp_path))
    area = load_area(write_area(tmp_path, cell), draught_m=DRAUGHT_M)
    assert any("no updates in its folder" in note for note in area.notes)
    shutil.copy(CELL.with_suffix(".002"), tmp_path)
    with pytest.raises(FileError, match=r"US5WA22M\.002 but not US5WA22M\.001 in its folder, expected all updates"):
        load_area(write_area(tmp_path, cell), draught_m=DRAUGHT_M)


@pytest.mark.thorough
def test_tide_opens_water_and_draught_closes_it(tmp_path, harbour):
    high = load_area(write_area(tmp_path, CELL, rest="[depth]\ntide_m = 3.0"), draught_m=DRAUGHT_M)
    deep = load_area(write_area(tmp_path, CELL), draught_m=DRAUGHT_M + 3.0)
    assert deep.water.area < harbour.water.area < high.water.area
    assert deep.water.difference(harbour.water.buffer(0.01)).area < 1.0
    assert "- 3 m tide = 0.5 m" in high.depth_rule


@pytest.mark.thorough
def test_bridges_open_for_ships_that_fit_below(tmp_path, harbour):
    low = load_area(write_area(tmp_path, CELL, "air_draught_m = 6.0"), draught_m=DRAUGHT_M)
    opened = low.water.difference(harbour.water)
    bridges, columns = features("BRIDGE")
    heights = [np.fmin(columns["VERCLR"], columns["VERCCL"]) >= 6.0]
    assert opened.area > 100.0
    crossings = shapely.union_all(in_frame(harbour, bridges[heights[0]]))
    cables, height = features("CBLOHD")
    crossings = crossings.union(shapely.union_all(in_frame(harbour, cables[height["VERCLR"] >= 6.0])))
    assert opened.difference(crossings.buffer(1.1)).area < 1.0


@pytest.mark.thorough
def test_nowhere_deep_enough_names_the_deepest(tmp_path):
    with pytest.raises(NoPlan, match=r"no charted depth reaches .* = 41 m, the deepest is 15\.6 m"):
        load_area(write_area(tmp_path, CELL), draught_m=40.0)


@pytest.mark.parametrize("content", [b"", b"not a chart", b"00266" + b"x" * 400])
def test_files_that_are_no_cells_are_refused(tmp_path, content):
    cell = tmp_path / "CELL.000"
    cell.write_bytes(content)
    with pytest.raises(FileError, match=r"cannot be read as an S-57 cell|has no data set identification"):
        load_area(write_area(tmp_path, cell), draught_m=DRAUGHT_M)


def test_depths_for_drawing_cover_the_water(harbour):
    drawn = shapely.union_all([polygons for _, polygons in harbour.depths])
    assert harbour.water.difference(drawn.buffer(0.01)).area < 1.0
    assert [depth for depth, _ in harbour.depths] == sorted(depth for depth, _ in harbour.depths)
