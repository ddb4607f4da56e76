from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.errors import NoPlan
from expdesign.plan.chart.goal_distance import build_goal_distance
from expdesign.plan.local_planner import Departure, LegEnds, SearchSpace, local_planner
from expdesign.plan.runs import Footprint
from expdesign.plan.search.lattice import search_lattice
from expdesign.plan.search.lattice_moves import Lattice, build_lattice
from expdesign.plan.search.planners import placed_on_lattice
from plan_case import leg_water

SPACING_M = 60.0


def run(name: str, displacement, *, room_m: float = 20.0) -> Footprint:
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
    margin = legs.leg_margin_m + legs.field.cell_m / 2
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
    lattice = Lattice(space=case, spacing_m=SPACING_M)
    problem = build_lattice(lattice, counts, Departure(pose=np.array(start, dtype=float)))
    return lattice, problem, search_lattice(problem)


def cost(case: SearchSpace, counts, start) -> float:
    return solve(case, counts, start)[2].cost


def leg_s(case: SearchSpace, to, *, exit_mps: float, entry_mps: float) -> float:
    """Time of a leg in open water from the origin, heading north, by the local planner's rule."""
    ends = LegEnds(before=-1, after=-1, exit_mps=exit_mps, entry_mps=entry_mps)
    return float(case.planner.leg_s(case, ends, np.zeros((1, 3)), np.array([to], dtype=float), np.zeros((0, 2)))[0])


def between(lattice: Lattice, problem):
    """Tails and heads (n, 3) of the moves between lattice poses, and their costs."""
    moves = problem.moves[: lattice.size, : lattice.size].tocoo()
    return (*(lattice.poses(poses) for poses in moves.coords), moves.data)


OPEN = shapely.box(-1000, -1000, 1500, 1500)


def origin(case: SearchSpace) -> np.ndarray:
    return case.field.origin + 8 * SPACING_M


def test_what_is_farther_takes_longer_by_its_length_at_transit_speed():
    here = origin(space(OPEN, (0, 0, 0)))
    near, far = (space(OPEN, (here[0] + away, here[1], 0)) for away in (600, 900))
    assert cost(far, (), (*here, 0.0)) - cost(near, (), (*here, 0.0)) == pytest.approx(
        300 / far.ship.transit_speed_mps, rel=1e-6
    )


def test_a_run_on_the_way_costs_only_the_leg_after_it():
    here = origin(space(OPEN, (0, 0, 0)))
    cases = [space(OPEN, (here[0] + away, here[1], 0), run("ahead", (240, 0, 0))) for away in (600, 900)]
    one, two = (cost(case, (runs,), (*here, 0.0)) for runs, case in enumerate(cases, start=1))
    after_s = leg_s(cases[0], (60, 0, 0), exit_mps=1.0, entry_mps=cases[0].ship.transit_speed_mps)
    assert two - one == pytest.approx(after_s, rel=1e-6)


def test_moves_are_straights_arcs_of_the_ships_radius_and_turns_on_the_spot_in_the_time_they_take():
    case = space(OPEN, (700, 800, 2.0))
    lattice, problem, _ = solve(case, (), (-300.0, -200.0, -1.0))
    tails, heads, seconds = between(lattice, problem)
    assert lattice.headings == 8
    apart_m, sailed_m = np.hypot(*(heads - tails)[:, :2].T), seconds * case.ship.transit_speed_mps
    turn = np.abs((heads - tails)[:, 2] + np.pi) % (2 * np.pi) - np.pi
    spot, straight = apart_m == 0, turn == 0
    arc = ~spot & ~straight
    np.testing.assert_allclose(sailed_m[straight], apart_m[straight])
    np.testing.assert_allclose(np.abs(turn[arc]), np.pi / 2)
    side_m, radius_m = apart_m[arc] / np.sqrt(2), case.ship.turning_radius_m
    np.testing.assert_allclose(sailed_m[arc], 2 * (side_m - radius_m) + radius_m * np.pi / 2)
    for angle in np.arange(1, 5) * np.pi / 4:
        alike = spot & np.isclose(np.abs(turn), angle)
        assert alike.any()
        np.testing.assert_allclose(seconds[alike], leg_s(case, (0, 0, angle), exit_mps=0.0, entry_mps=0.0))


def test_no_way_is_shorter_than_the_distance_less_what_runs_make_good():
    case = space(OPEN, (700, 800, 2.0), run("aside", (100, 130, 0.7)))
    start = np.array([-300.0, -200.0, -1.0])
    made_good_m = 3 * np.hypot(100, 130)
    least_m = np.hypot(*(case.goal - start)[:2]) - made_good_m
    assert cost(case, (3,), start) >= least_m / case.ship.transit_speed_mps


def test_a_current_helps_and_hinders():
    still, swept = space(OPEN, (700, 800, 2.0)), space(OPEN, (700, 800, 2.0))
    swept = replace(swept, current_to=np.array([0.4, 0.0]))
    costs = []
    for case in (still, swept):
        lattice, problem, _ = solve(case, (), (-300.0, -200.0, -1.0))
        tails, heads, seconds = between(lattice, problem)
        steps = np.round((heads - tails) / SPACING_M).astype(int)
        straight = (heads - tails)[:, 2] == 0
        costs.append({tuple(step): s for step, s in zip(steps[straight, :2].tolist(), seconds[straight], strict=True)})
    v = still.ship.transit_speed_mps
    assert costs[1][1, 0] == pytest.approx(SPACING_M / (v + 0.4))
    assert costs[1][-1, 0] == pytest.approx(SPACING_M / (v - 0.4))
    assert costs[1][0, 1] == pytest.approx(SPACING_M / np.sqrt(v**2 - 0.4**2))
    assert costs[0][1, 0] == pytest.approx(SPACING_M / v)


def test_runs_begin_only_where_their_discs_have_room():
    water = OPEN.difference(shapely.box(-200, 200, 500, 500))
    case = space(water, (900, 900, 0), run("ahead", (240, 0, 0), room_m=80.0))
    found = placed_on_lattice(case, (2,), Departure(pose=np.array([-500.0, -500.0, 0.0])), spacing_m=SPACING_M)
    begun = [placement.pose for placement in found.runs]
    assert len(begun) == 2
    for pose in begun:
        end = pose[:2] + 240 * np.array([np.cos(pose[2]), np.sin(pose[2])])
        path = shapely.LineString([pose[1::-1], end[::-1]])
        assert shapely.distance(path, shapely.boundary(water)) >= 80.0 - case.field.error_m


def test_no_run_begins_again_where_one_has_failed_and_legs_after_get_longer():
    case = space(OPEN, (700, 800, 2.0), run("ahead", (240, 0, 0)))
    start = np.array([-300.0, -200.0, -1.0])
    first = placed_on_lattice(case, (2,), Departure(pose=start), spacing_m=SPACING_M)
    refusing = case.refusing("ahead", first.runs[1])
    second = placed_on_lattice(refusing, (2,), Departure(pose=start), spacing_m=SPACING_M)
    poses = np.array([placement.pose for placement in second.runs])
    assert not refusing.is_refused(poses).any()
    assert second.lattice.cost_s >= first.lattice.lower_bound_s
    ends = poses[0, :2] + 240 * np.array([np.cos(poses[0, 2]), np.sin(poses[0, 2])])
    assert np.hypot(*(poses[1, :2] - ends)) >= (1.5 + 0.5) * case.hull_m - 1e-9


def test_a_lattice_without_a_plan_says_which_and_what_was_not_tried():
    case = space(shapely.box(-400, -400, 400, 400), (200, 200, 0), run("ahead", (240, 0, 0), room_m=500.0))
    with pytest.raises(NoPlan, match=r"^no room for 'ahead' on a lattice of 60 m; not tried: a plan.lattice_spac"):
        placed_on_lattice(case, (1,), Departure(pose=np.zeros(3)), spacing_m=60.0)


@pytest.mark.thorough
def test_mirrored_water_and_runs_cost_the_same():
    water = OPEN.difference(shapely.box(-200, 200, 500, 500))
    case = space(water, (900, 900, 0.5), run("aside", (100, 130, 0.7)))
    flipped = shapely.transform(water, lambda points: points * (-1, 1))
    mirror = space(flipped, (900, -900, -0.5), run("aside", (100, -130, -0.7)))
    costs = [cost(one, (2,), start) for one, start in ((case, (-500, -500, 0.2)), (mirror, (-500, 500, -0.2)))]
    # the lattices begin at opposite sides, so they lie up to a cell apart
    assert costs[0] == pytest.approx(costs[1], abs=2 * SPACING_M / case.ship.transit_speed_mps)
