import itertools
import math

import numpy as np
import pytest
import shapely

from expdesign import sea_area
from expdesign.errors import NoAnswer, NoPlan
from expdesign.sea_area import DENSE, LocalFrame, Zones, as_multipolygon, build_sea_area

EMPTY = shapely.MultiPolygon()
BOUNDS = shapely.box(-500, -500, 500, 500)
ISLAND = shapely.box(-50, -50, 50, 50)


def _area(*, land=EMPTY, no_go=EMPTY, deep=None, bounds=BOUNDS):
    zones = Zones(bounds=bounds, land=land, no_go=no_go, deep=deep)
    return build_sea_area("test", frame=LocalFrame(60.0, 25.0), zones=zones, depth_rule="by hand")


def test_water_is_the_bounds_without_land_and_no_go_zones():
    assert _area().water.area == 1000**2
    assert _area(land=ISLAND).water.area == 1000**2 - 100**2
    assert _area(land=ISLAND, no_go=shapely.box(0, 0, 100, 100)).water.area == 1000**2 - 100**2 - 100**2 + 50**2


def test_only_deep_water_counts_when_depth_is_known():
    deep = shapely.box(0, -2000, 2000, 2000)
    assert _area(land=ISLAND, deep=deep).water.area == 1000**2 / 2 - 100**2 / 2
    assert _area(land=ISLAND, deep=BOUNDS.buffer(9)).water.equals(_area(land=ISLAND).water)


def test_land_is_what_lies_inside_the_bounds():
    assert _area(land=shapely.box(400, 400, 900, 900)).land.area == 100**2


def test_clearance_takes_a_rim_with_rounded_corners_off_islands():
    area, clearance = _area(land=ISLAND), 30.0
    rim = 100**2 + 4 * 100 * clearance + math.pi * clearance**2
    exact = (1000 - 2 * clearance) ** 2 - rim
    assert area.safe_water(clearance).area == pytest.approx(exact, abs=0.01 * math.pi * clearance**2)
    assert area.safe_water(0.0).equals(area.water)


def test_clearance_closes_a_channel_exactly_when_it_reaches_half_its_width():
    walls = BOUNDS.difference(shapely.box(-20, -600, 20, 600)).difference(shapely.box(-600, 100, 600, 600))
    south, north = shapely.Point(0, -300), shapely.Point(0, 300)
    joined = [
        any(part.covers(south) and part.covers(north) for part in _area(land=walls).safe_water(clearance).geoms)
        for clearance in (19.9, 20.1)
    ]
    assert joined == [True, False]


def test_more_clearance_never_frees_water():
    area = _area(land=shapely.union_all([ISLAND, shapely.Point(200, 200).buffer(80)]))
    waters = [area.safe_water(clearance) for clearance in (0, 5, 20, 60, 150)]
    for wide, narrow in itertools.pairwise(waters):
        assert narrow.difference(wide).area < 1e-9
    assert area.safe_water(600).is_empty


@pytest.mark.parametrize(
    ("zones", "reason"),
    [
        ({"land": BOUNDS.buffer(1)}, "all of it is land"),
        ({"no_go": BOUNDS.buffer(1)}, "no-go zones cover all its water"),
        ({"deep": EMPTY}, "none of its water is deep enough"),
        ({"land": ISLAND, "deep": ISLAND}, "none of its water is deep enough"),
        ({"land": BOUNDS.difference(ISLAND), "no_go": ISLAND}, "no-go zones cover all its water"),
    ],
)
def test_an_area_without_water_says_what_took_it(zones, reason):
    with pytest.raises(NoPlan, match=reason) as caught:
        _area(**zones)
    assert isinstance(caught.value, NoAnswer)
    assert "\n" not in str(caught.value)


def test_points_and_lines_are_no_polygons():
    mixed = shapely.GeometryCollection([shapely.Point(0, 0), shapely.LineString([(0, 0), (1, 1)]), ISLAND])
    assert as_multipolygon(mixed).equals(ISLAND)
    assert as_multipolygon(shapely.Point(0, 0)).is_empty
    assert as_multipolygon(shapely.MultiPolygon([ISLAND])).equals(ISLAND)


@pytest.mark.parametrize("clearance_m", [5.0, pytest.param(20.0, marks=pytest.mark.slow)])
def test_clearance_from_a_shore_of_many_corners_is_the_same_in_steps_as_at_once(clearance_m):
    """At once, GEOS leaves out corners by up to a hundredth of the distance, and chords cut arcs by 0.12 per cent."""
    rng = np.random.default_rng(4)
    angle = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    radius = 150 + 20 * np.sin(5 * angle) + 0.1 * rng.normal(size=len(angle))
    shore = shapely.Polygon(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))
    assert DENSE * shore.length < clearance_m * len(angle)
    safe = _area(bounds=shore).safe_water(clearance_m)
    assert safe.distance(shore.boundary) > clearance_m * (1 - 0.012)
    assert safe.covers(shore.buffer(-1.012 * clearance_m))
    assert shore.buffer(-0.988 * clearance_m).covers(safe)


@pytest.mark.parametrize("clearance_m", [5.0, 20.0])
def test_water_to_plan_in_is_safe_and_lacks_at_most_twice_its_tolerance(monkeypatch, clearance_m):
    """GEOS errs by 1.2 per cent of the distance itself, as above."""
    rng = np.random.default_rng(5)
    angle = np.linspace(0, 2 * np.pi, 8000, endpoint=False)
    radius = 150 + 20 * np.sin(5 * angle) + 0.005 * rng.normal(size=len(angle))
    shore = shapely.Polygon(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))
    area = _area(bounds=shore)
    assert area.water_to_plan_in(clearance_m).equals(area.safe_water(clearance_m))
    monkeypatch.setattr(sea_area, "MOST_CORNERS", len(angle) // 2)
    sea_area._water_to_plan_in.cache_clear()  # it keeps what it found with the usual number
    thinned = area.water_to_plan_in(clearance_m)
    assert shapely.get_num_coordinates(thinned) < shapely.get_num_coordinates(area.safe_water(clearance_m)) / 4
    assert shore.buffer(-0.988 * clearance_m).covers(thinned)
    assert thinned.covers(shore.buffer(-(1.012 + 2 * sea_area.THINNED) * clearance_m))
