import numpy as np
import pytest
import shapely

from expdesign.plan.chart.goal_distance import build_goal_distance
from expdesign.plan.local_planner import SearchSpace, local_planner
from expdesign.plan.runs import Footprint
from expdesign.plan.search.lattice import search_lattice
from expdesign.plan.search.lattice_moves import build_lattice
from plan_case import leg_water

SPACING_M = 60.0


def stamp(name: str, displacement, *, room_m: float = 20.0) -> Footprint:
    """A run along its own chord."""
    chord = np.linspace(0, 1, 8)[:, None] * np.array(displacement[:2])
    return Footprint(
        name=name,
        discs=chord,
        times_s=np.linspace(0, 60, 8),
        room_m=np.full(8, room_m),
        displacement=np.array(displacement, dtype=float),
        duration_s=60.0,
        entry_mps=1.0,
        exit_mps=1.0,
    )


def space(water: shapely.Geometry, goal, *runs: Footprint) -> SearchSpace:
    legs = leg_water(water)
    margin = legs.path_margin_m + legs.field.cell_m / 2
    return SearchSpace(
        footprints=runs,
        frame=legs.area.frame,
        field=legs.field,
        goal_distance=build_goal_distance(legs.narrowest_graph, legs.field, np.array(goal[:2])),
        goal=np.array(goal, dtype=float),
        planner=local_planner(legs),
        hull_m=30.0,
        leg_margin_m=margin,
        current_to=np.zeros(2),
    )


def solve(case: SearchSpace, counts, start):
    problem = build_lattice(case, counts, np.array(start, dtype=float), spacing_m=SPACING_M)
    return problem, search_lattice(problem)


def lattice_origin(case: SearchSpace) -> np.ndarray:
    return case.field.origin + 8 * SPACING_M


OPEN = shapely.box(-1000, -1000, 1500, 1500)


def test_a_straight_way_takes_its_length_at_transit_speed():
    probe = space(OPEN, (0, 0, 0))
    here = lattice_origin(probe)
    case = space(OPEN, (here[0] + 900, here[1], 0))
    _, plan = solve(case, (), (*here, 0.0))
    assert plan.cost == pytest.approx(900 / case.ship.transit_speed_mps, rel=1e-6)
    assert plan.lower_bound == pytest.approx(plan.cost, rel=1e-6)


def test_a_run_on_the_way_saves_its_displacement():
    probe = space(OPEN, (0, 0, 0))
    here = lattice_origin(probe)
    case = space(OPEN, (here[0] + 900, here[1], 0), stamp("ahead", (240, 0, 0)))
    _, plan = solve(case, (2,), (*here, 0.0))
    assert plan.cost == pytest.approx((900 - 480) / case.ship.transit_speed_mps, rel=1e-6)


def test_every_way_is_as_long_as_the_distance_or_longer_and_turns_have_the_ships_radius():
    case = space(OPEN, (700, 800, 2.0), stamp("aside", (100, 130, 0.7)))
    start = np.array([-300.0, -200.0, -1.0])
    _, plan = solve(case, (3,), start)
    carried = 3 * np.hypot(100, 130)
    assert plan.cost >= (np.hypot(*(case.goal - start)[:2]) - carried) / case.ship.transit_speed_mps
    problem = build_lattice(case, (3,), start, spacing_m=10.0)
    side = case.ship.turning_radius_m  # a lattice finer than the turning radius could not be sailed
    rows, columns = (int((size - 1) * case.field.cell_m / side) + 1 for size in case.field.clearance_m.shape)
    assert problem.start == 4 * rows * columns
    between = problem.moves[: problem.start, : problem.start].tocoo()
    cells = np.stack([np.divmod(pose // 4, columns) for pose in between.coords]).astype(float)
    apart_m = side * np.hypot(*(cells[1] - cells[0]))
    turns = between.coords[0] % 4 != between.coords[1] % 4
    sailed_m = between.data * case.ship.transit_speed_mps
    np.testing.assert_allclose(apart_m[turns], side * np.sqrt(2))
    np.testing.assert_allclose(sailed_m[turns], side * np.pi / 2)
    np.testing.assert_allclose(sailed_m[~turns], apart_m[~turns])


def test_runs_begin_only_where_their_discs_have_room():
    water = OPEN.difference(shapely.box(-200, 200, 500, 500))
    case = space(water, (900, 900, 0), stamp("ahead", (240, 0, 0), room_m=80.0))
    start = np.array([-500.0, -500.0, 0.0])
    _, plan = solve(case, (2,), start)
    columns = int(np.floor((case.field.clearance_m.shape[1] - 1) * case.field.cell_m / SPACING_M)) + 1
    begun = [pose for pose, q in plan.steps if q == 0]
    assert len(begun) == 2
    for pose in begun:
        cell, heading = np.array(divmod(pose // 4, columns)), (pose % 4) * np.pi / 2
        begin = case.field.origin + SPACING_M * cell
        end = begin + 240 * np.array([np.cos(heading), np.sin(heading)])
        path = shapely.LineString([begin[::-1], end[::-1]])
        assert shapely.distance(path, shapely.boundary(water)) >= 80.0 - case.field.error_m


def test_mirrored_water_and_runs_cost_the_same():
    water = OPEN.difference(shapely.box(-200, 200, 500, 500))
    case = space(water, (900, 900, 0.5), stamp("aside", (100, 130, 0.7)))
    flipped = shapely.transform(water, lambda points: points * (-1, 1))
    mirror = space(flipped, (900, -900, -0.5), stamp("aside", (100, -130, -0.7)))
    costs = [solve(one, (2,), start)[1].cost for one, start in ((case, (-500, -500, 0.2)), (mirror, (-500, 500, -0.2)))]
    # the lattices begin at opposite sides, so they lie up to a cell apart
    assert costs[0] == pytest.approx(costs[1], abs=2 * SPACING_M / case.ship.transit_speed_mps)
