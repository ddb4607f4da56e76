from __future__ import annotations

import numpy as np
import pytest
import shapely

from expdesign.vessel.vessel import covering_discs, disc_points, hull_polygons, swept_area, thinned_poses

HULL = np.array([[15.0, 4.5], [-15.0, 4.5], [-15.0, -4.5], [15.0, -4.5]])


def circle(count: int = 60) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, count)
    return np.stack([100 * np.sin(angle), 100 * (1 - np.cos(angle)), angle], axis=1)


def test_hull_polygon_points_where_the_heading_does():
    east = hull_polygons(np.array([[0.0, 0.0, np.pi / 2]]), HULL)[0]
    assert np.allclose(east.bounds, (-15, -4.5, 15, 4.5))  # (min east, min north, max east, max north)
    assert hull_polygons(np.array([[7.0, 0.0, 0.0]]), HULL)[0].bounds[3] == pytest.approx(22.0)


def test_discs_cover_the_hull_and_little_more():
    centres, radius = covering_discs(30.0, 9.0)
    discs = shapely.union_all(shapely.buffer(shapely.points(np.zeros(3), centres), radius, quad_segs=64))
    hull = hull_polygons(np.zeros((1, 3)), HULL)[0]
    assert discs.buffer(0.01).contains(hull)
    assert radius < 0.8 * np.hypot(15.0, 4.5)


def test_swept_area_holds_every_hull_between_samples():
    pose = circle()
    swept = swept_area(pose, HULL)
    between = (pose[:-1] + pose[1:]) / 2
    hulls = shapely.union_all(hull_polygons(np.concatenate([pose, between]), HULL))
    # the midpoint of a chord lies inside the arc's hulls by less than the sagitta of one step
    sagitta = 15.0 * (1 - np.cos(np.pi / 59))
    assert swept.buffer(2 * sagitta).contains(hulls)


def test_swept_area_of_a_straight_run_is_the_rectangle_of_its_length():
    north = np.linspace(0, 200, 21)
    swept = swept_area(np.stack([north, 0 * north, 0 * north], axis=1), HULL)
    assert swept.area == pytest.approx((200 + 30) * 9)


def test_thinning_skips_no_more_than_the_spacing():
    pose = circle(2000)
    kept = thinned_poses(pose, reach_m=15.0, spacing_m=7.5)
    steps = np.hypot(*np.diff(pose[kept, :2], axis=0).T) + 15 * np.abs(np.diff(pose[kept, 2]))
    one_step = 0.32 + 15 * 2 * np.pi / 1999
    assert steps.max() <= 7.5 + one_step
    assert kept[0] == 0
    assert kept[-1] == len(pose) - 1


def test_disc_points_lie_on_the_centre_line():
    points = disc_points(np.array([[10.0, 20.0, np.pi / 2]]), np.array([-10.0, 0.0, 10.0]))[0]
    assert np.allclose(points, [[10, 10], [10, 20], [10, 30]])
