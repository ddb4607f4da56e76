"""What runs save of the path at most: closed forms, random placements, and plans planted in random charts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.plan.bounds.branch_and_bound import (
    CELL_HEADINGS,
    LEVELS,
    GoalTimes,
    Saving,
    _near_corners,
    first_cells,
    goal_times,
    grown_times,
    next_cells,
    spread_m,
    time_saved_s,
)
from expdesign.plan.bounds.displacement import SIDES, Headway, displacement_of, track_of
from expdesign.plan.chart.visibility_graph import build_visibility_graph
from expdesign.simulation import Environment
from plan_case import primitive, random_path, ship

SPEED = 1.2
STILL = Headway(speed_mps=SPEED, current_to=np.zeros(2))


def bent_run(name: str, turn_rad: np.ndarray, step_m: float):
    """A run whose heading is its course, in as many steps as there are headings."""
    straight = primitive(ship())
    away = np.cumsum(step_m * np.stack([np.cos(turn_rad), np.sin(turn_rad)], axis=1), axis=0)
    pose = np.column_stack([away - away[0], turn_rad])
    time = straight.trajectory.time_s
    fit = np.stack([np.interp(np.linspace(0, 1, len(time)), np.linspace(0, 1, len(pose)), x) for x in pose.T], axis=1)
    return replace(straight, name=name, trajectory=replace(straight.trajectory, pose=fit))


def half_turn(name: str = "half turn"):
    """Half a circle of 25 m radius."""
    turn = np.linspace(0, np.pi, 121)
    return bent_run(name, turn, 25 * np.pi / 120)


def displacements(runs, headway):
    sea = Environment(current_to=headway.current_to)
    return {run.name: displacement_of(ship(), run, sea, headway) for run in runs}


def saved_by(runs, water, ends, headway=STILL):
    counts = {run.name: 1 for run in runs}
    return time_saved_s(runs, displacements(runs, headway), counts, water, ends, headway, ship())


def test_cells_of_every_level_cover_all_places_and_headings_and_ends_stay_within_their_spread() -> None:
    rng = np.random.default_rng(5)
    cell_m, reach_m, points = 7.0, 40.0, rng.uniform([-20, -15, 0], [20, 15, 2 * np.pi], (60, 3))
    cells = first_cells(shapely.box(-15, -20, 15, 20), 0.0, cell_m)
    for level in range(4):
        apart = points[:, None] - cells
        apart[..., 2] = (apart[..., 2] + np.pi) % (2 * np.pi) - np.pi
        edges = np.array([cell_m / 2, cell_m / 2, np.pi / CELL_HEADINGS]) * 0.5**level
        inside = (np.abs(apart) <= edges + 1e-9).all(axis=2)
        assert (inside.sum(axis=1) == 1).all()
        own = cells[inside.argmax(axis=1)]
        far = own[:, :2] - points[:, :2] + reach_m * (unit(own[:, 2]) - unit(points[:, 2]))
        assert (np.hypot(*far.T) <= spread_m(cell_m, reach_m, level)).all()
        assert np.hypot(*far.T).max() > spread_m(cell_m, reach_m, level) / 3  # which is no empty promise
        cells = next_cells(np.unique(own, axis=0), cell_m, level)


def unit(heading_rad: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=-1)


def test_times_to_the_goal_are_those_of_the_fastest_paths():
    rng = np.random.default_rng(0)
    rocks = shapely.union_all(shapely.buffer(shapely.points(rng.uniform(-150, 150, (6, 2))), 30.0, quad_segs=3))
    water = shapely.box(-200, -200, 200, 200).difference(rocks)
    graph, goal = build_visibility_graph(water), np.array([-190.0, 190.0])
    for current in (np.zeros(2), np.array([0.3, -0.4])):
        headway = Headway(speed_mps=SPEED, current_to=current)
        times: GoalTimes = goal_times(graph, goal, headway)
        points = rng.uniform(-195, 195, (40, 2))
        points = points[shapely.contains_xy(water, points[:, 1], points[:, 0])]
        expected = [graph.least_cost(point, goal, headway.seconds) for point in points]
        np.testing.assert_allclose(times.at(points), expected, atol=1e-6)
    assert np.isinf(times.at(np.array([[1000.0, 0.0]]))).all()


@pytest.mark.parametrize("seed", range(3))
def test_cells_are_kept_where_a_corner_may_be_in_the_hull_of_the_track(seed):
    """By every side of the hull, with the corner turned into the axes of the run by complex numbers."""
    rng = np.random.default_rng(seed)
    track = track_of(half_turn(), ship(), rng.uniform(-0.05, 0.05, 2))
    cells = rng.uniform([-90, -90, 0], [90, 90, 2 * np.pi], (3000, 3))
    corners, farther_m = rng.uniform(-60, 60, (4, 2)), rng.uniform(1.0, 6.0)
    away = (corners @ [1, 1j]) - (cells[:, :2] @ [1, 1j])[:, None]
    turned = away * np.exp(-1j * cells[:, 2])[:, None]
    along = turned.real[..., None] * SIDES[:, 0] + turned.imag[..., None] * SIDES[:, 1]
    near = (along <= track.hull_m + track.drift_m + farther_m).all(axis=-1).any(axis=1)
    assert 0.01 < near.mean() < 0.5
    np.testing.assert_array_equal(_near_corners(track, cells, corners, farther_m), cells[near])


def test_places_at_every_island_are_looked_at():
    """A half circle round each of four rocks, with the rock on its chord."""
    rng = np.random.default_rng(7)
    rocks, headings = np.array([[-90, -90], [90, -90], [-90, 90], [90, 90.0]]), rng.uniform(0, 2 * np.pi, 4)
    beside = np.array([-11.0, 0.0])  # of the chord, seen from the middle of the track
    c, s = np.cos(headings), np.sin(headings)
    places = rocks - np.stack([c * beside[0] - s * beside[1], s * beside[0] + c * beside[1]], axis=1)
    cells = np.column_stack([places, headings])
    water = shapely.box(-200, -200, 200, 200)
    water = water.difference(shapely.union_all([shapely.box(e - 7, n - 7, e + 7, n + 7) for n, e in rocks]))
    times = grown_times([track_of(half_turn(), ship(), np.zeros(2))], water, np.array([0.0, 0.0]), STILL, ship())
    assert times is not None
    saving = Saving(track=track_of(half_turn(), ship(), np.zeros(2)), times=times, water=water, cell_m=5.0)
    np.testing.assert_array_equal(saving._possible(cells, LEVELS), cells)
    away = cells + np.array([0.0, 0.0, np.pi])  # the chord leads away from the rock
    assert len(saving._possible(away, LEVELS)) == 0


@pytest.mark.parametrize("current", [(0.0, 0.0), (0.3, -0.4)])
def test_what_a_cell_may_save_beyond_its_middle_is_its_spread_at_the_slowest_speed_over_ground(current):
    """Dead against the current, at both ends of the run."""
    headway = Headway(speed_mps=SPEED, current_to=np.array(current))
    water = shapely.box(-100, -100, 100, 100)
    times = goal_times(build_visibility_graph(water), np.zeros(2), headway)
    saving = Saving(track=track_of(half_turn(), ship(), headway.current_to), times=times, water=water, cell_m=5.0)
    courses = np.linspace(0, 2 * np.pi, 721)
    slowest = headway.seconds(unit(courses)).max()
    assert saving._slowness == pytest.approx(slowest, rel=1e-4)
    assert saving._slowness >= slowest - 1e-12


def test_what_a_cell_near_the_shore_saves_is_unknown_until_cells_are_small() -> None:
    """An end in the middle of a large cell may be ashore, or have no straight way, where others in the cell do not."""
    water, track = shapely.box(-100, -100, 100, 100), track_of(half_turn(), ship(), np.zeros(2))
    times = goal_times(build_visibility_graph(water), np.zeros(2), STILL)
    saving = Saving(track=track, times=times, water=water, cell_m=5.0)
    farthest_m = max(end[0, 0] for end in track.ends(np.zeros((1, 3))))
    beyond_m = np.array([-1.5, -0.5, 0.5]) * saving._spread_m(track.ends_m, 0)
    cells = np.column_stack([100.0 - farthest_m + beyond_m, np.zeros((3, 2))])
    inside, near, ashore = saving._saved(cells, 0)[0].tolist()
    assert np.isfinite(inside)
    assert near == ashore == np.inf
    small = saving._saved(cells, LEVELS)[0]
    assert np.isfinite(small[:2]).all()
    assert small[2] == -np.inf


def test_in_open_water_a_run_saves_what_its_chord_takes():
    run = half_turn()
    whole_s, saved = saved_by([run], shapely.box(-300, -300, 300, 300), (np.array([-250.0, 0]), np.array([250.0, 0])))
    chord_s = 50.0 / SPEED
    assert whole_s == pytest.approx(500 / SPEED)
    assert chord_s <= saved["half turn"] <= chord_s + 5.0


CHORD_S, PIER_HALF_M = 50.0 / SPEED, 5.0
AROUND_S = (2 * np.hypot(25.0 - PIER_HALF_M, 25.0) + 2 * PIER_HALF_M) / SPEED
"""From end to end of a half circle of 25 m radius round the two corners of a pier, if only amidships needs water."""


@pytest.mark.parametrize(
    ("to_goal", "least_s", "most_s"),
    [
        pytest.param(1.0, CHORD_S + 10.0, AROUND_S, id="pier to starboard"),
        pytest.param(-1.0, CHORD_S, CHORD_S + 1.0, id="pier to port"),
    ],
)
def test_a_half_circle_to_starboard_saves_the_detour_round_a_pier_on_that_side_only(to_goal, least_s, most_s):
    pier = shapely.box(0, -PIER_HALF_M, 300, PIER_HALF_M)
    water = shapely.box(-300, -200, 300, 200).difference(pier)
    start = np.array([-150.0 * to_goal, 250.0])
    run = half_turn()
    whole_s, saved = saved_by([run], water, (start, start * [-1, 1]))
    assert whole_s > 1.5 * 300.0 / SPEED  # the pier has to be rounded
    assert least_s < saved[run.name] < most_s


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (0, 2, 3, 4))])
def test_no_random_placement_saves_more_than_the_bound(seed):
    rng = np.random.default_rng(seed)
    headway = Headway(speed_mps=SPEED, current_to=rng.uniform(-0.3, 0.3, 2) * (seed > 0))
    rocks = shapely.union_all(shapely.buffer(shapely.points(rng.uniform(-250, 250, (8, 2))), 40.0, quad_segs=2))
    water = shapely.box(-300, -300, 300, 300).difference(rocks)
    water = max(shapely.get_parts(water), key=shapely.area)
    run = bent_run("bent", np.linspace(0, rng.uniform(1.5, 4.0), 121), rng.uniform(0.5, 0.9))
    start, goal = (
        shapely.get_coordinates(
            shapely.point_on_surface(water.intersection(shapely.box(low, low, low + 150, low + 150)))
        )[0, ::-1]
        for low in (-300, 150)
    )
    whole_s, bound = saved_by([run], water, (start, goal), headway)
    assert whole_s <= build_visibility_graph(water).least_cost(start, goal, headway.seconds)
    times = grown_times([track_of(run, ship(), headway.current_to)], water, goal, headway, ship())
    pose, when = run.trajectory.pose, run.trajectory.time_s
    arm = (ship().length_m - ship().beam_m) / 2
    places, headings = rng.uniform(-320, 320, (10_000, 2)), rng.uniform(-np.pi, np.pi, 10_000)
    tracks = []
    for k in np.linspace(0, len(pose) - 1, 25).astype(int):
        for ahead in (0.0, arm, -arm):
            x, y = pose[k, :2] + ahead * np.array([np.cos(pose[k, 2]), np.sin(pose[k, 2])])
            c, s = np.cos(headings), np.sin(headings)
            at = places + np.stack([c * x - s * y, s * x + c * y], axis=1) + headway.current_to * when[k]
            tracks.append(at)
            kept = shapely.contains_xy(water, at[:, 1], at[:, 0])
            places, headings = places[kept], headings[kept]
            tracks = [track[kept] for track in tracks]
    most = times.at(tracks[0]) - times.at(tracks[-3])
    assert len(most) > 500
    assert most.max() <= bound["bent"]
    assert most.max() > bound["bent"] - 8.0  # and little less


@pytest.mark.parametrize("seed", range(8))
def test_a_planted_plan_costs_no_less_than_the_path_less_what_its_runs_save(seed):
    """The water is laid around a plan: winding legs at full speed, runs at random headings, in a random current."""
    rng = np.random.default_rng(seed)
    headway = Headway(speed_mps=SPEED, current_to=rng.uniform(-0.4, 0.4, 2) * (seed % 3 > 0))
    runs = [bent_run(name, rng.uniform(-4, 4) * np.linspace(0, 1, 121), rng.uniform(0.3, 0.9)) for name in ("a", "b")]
    arm = (ship().length_m - ship().beam_m) / 2
    here, spent, lines, counts = np.zeros(2), 0.0, [], {"a": 0, "b": 0}
    for which in [*rng.integers(0, 2, 3), None]:
        leg = random_path(rng, here, int(rng.integers(1, 6)))
        spent, here = spent + headway.seconds(np.diff(leg, axis=0)).sum(), leg[-1]
        lines.append(leg)
        if which is None:
            break
        run = runs[which]
        counts[run.name] += 1
        heading, pose = rng.uniform(-np.pi, np.pi), run.trajectory.pose
        c, s = np.cos(heading), np.sin(heading)
        for ahead in (arm, -arm, 0.0):
            body = pose[:, :2] + ahead * np.stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])], axis=1)
            track = here + body @ np.array([[c, s], [-s, c]]) + headway.current_to * run.trajectory.time_s[:, None]
            lines.append(track)
        here = track[-1]
    water = shapely.union_all([shapely.buffer(shapely.LineString(line[:, ::-1]), 3.0) for line in lines])
    used = [run for run in runs if counts[run.name]]
    found = time_saved_s(used, displacements(used, headway), counts, water, (np.zeros(2), here), headway, ship())
    assert found is not None
    assert found[0] - sum(counts[name] * most_s for name, most_s in found[1].items()) <= spent + 1e-6
