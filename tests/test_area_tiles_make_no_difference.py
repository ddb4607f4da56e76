"""A shore that is moved in tiles is moved as at once, and simplified water never holds what is forbidden."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from expdesign import sea_area
from expdesign.plan.chart import CORNERS, simplified, visibility_graph
from expdesign.sea_area import moved

HALF_M = 500.0
SHARES = 0.4, 1.0  # least and largest radius of a corner of an island, in shares of the island's


def islands(seed: int, *, corners: int, radius_m: float = 40.0, count: int = 60) -> shapely.Geometry:
    """A square of water with star-shaped islands, some of which overlap."""
    rng = np.random.default_rng(seed)
    middles = rng.uniform(-HALF_M, HALF_M, (count, 1, 2))
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False) + rng.uniform(0, 2 * np.pi, (count, 1))
    radius = radius_m * rng.uniform(*SHARES, (count, corners))
    rings = middles + radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return shapely.box(-HALF_M, -HALF_M, HALF_M, HALF_M).difference(shapely.union_all(shapely.polygons(rings)))


@pytest.fixture
def small_tiles(monkeypatch):
    monkeypatch.setattr(sea_area, "TILE_CORNERS", 60)
    monkeypatch.setattr(visibility_graph, "DENSE", 60)


def at_once(water: shapely.Geometry, distance_m: float, **options) -> shapely.Geometry:
    return shapely.buffer(water, distance_m, **options)


@pytest.mark.parametrize("join_style", ["round", "mitre"])
@pytest.mark.parametrize("distance_m", [-12.0, -2.0, 5.0])
@pytest.mark.parametrize("seed", range(4))
def test_a_shore_moved_in_tiles_is_the_shore_moved_at_once(small_tiles, seed, distance_m, join_style):
    water = islands(seed, corners=7)
    tiled = moved(water, distance_m, join_style=join_style)
    whole = at_once(water, distance_m, join_style=join_style)
    assert tiled.symmetric_difference(whole).area < 1e-9 * whole.area
    assert len(shapely.get_parts(tiled)) == len(shapely.get_parts(whole))
    assert shapely.hausdorff_distance(tiled.boundary, whole.boundary) < 1e-6
    assert tiled.is_valid


@pytest.mark.parametrize("seed", range(2))
def test_a_shore_of_many_corners_keeps_its_distance_in_tiles(small_tiles, seed):
    """GEOS leaves out corners by up to a hundredth of the distance, whichever comes first; chords take half of one."""
    water, distance_m = islands(seed, corners=200, count=6), 10.0
    tiled = moved(water, -distance_m)
    assert tiled.distance(water.boundary) > (1 - 0.015) * distance_m
    assert tiled.covers(at_once(water, -1.015 * distance_m, quad_segs=64))


def test_a_water_narrower_than_the_distance_vanishes_in_tiles(small_tiles):
    assert moved(islands(1, corners=30), -2 * HALF_M).is_empty


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("tolerance_m", [0.5, 3.0])
def test_simplified_water_adds_and_lacks_nothing_whatever_corner_its_shores_begin_at(small_tiles, seed, tolerance_m):
    water = shapely.MultiPolygon([*shapely.get_parts(islands(seed, corners=40, count=25))])
    corners = ((1.0, 150), *CORNERS[1:])
    less, more = (simplified(water, grow=grow, tolerance_m=tolerance_m, corners=corners) for grow in (False, True))
    assert less.difference(water).area < 1e-9
    assert water.difference(more).area < 1e-9
    assert shapely.get_num_coordinates(less) < shapely.get_num_coordinates(water) / 2
