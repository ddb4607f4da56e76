import numpy as np
import pytest
from scipy.sparse import csr_array

from expdesign.errors import InputError, NoPlan
from expdesign.plan.search.lattice import LatticeProblem, search_lattice
from lattice_case import Run, World, as_problem, astar_thesis, cost_of, dijkstra_plain, random_world

RUNS = (Run(3, 0, 0, 1), Run(2, 0, 0, 0), Run(0, 2, 1, 0))
COSTS = [{"step": 1.0, "turn": 1.0}, {"step": 1.0, "turn": 2.5}, {"step": 0.7310, "turn": 1.1931}]


@pytest.mark.parametrize("costs", COSTS)
@pytest.mark.parametrize("seed", range(12))
def test_cost_equals_exhaustive_search(seed, costs):
    rng = np.random.default_rng(seed)
    world = random_world(rng, (9, 11), RUNS, rng.integers(0, 3, 3).tolist(), blocks=int(rng.integers(0, 8)), **costs)
    least, _ = dijkstra_plain(world)
    problem = as_problem(world)
    if np.isinf(least):
        with pytest.raises(NoPlan, match="no path from start to goal"):
            search_lattice(problem)
        return
    plan = search_lattice(problem)
    assert plan.cost == pytest.approx(least, abs=1e-9)
    assert plan.lower_bound == pytest.approx(least, abs=1e-7)
    assert cost_of(world, problem, plan.steps) == pytest.approx(least, abs=1e-9)


@pytest.mark.parametrize("suboptimality", [0.05, 0.3, 2.0])
@pytest.mark.parametrize("seed", range(6))
def test_bounded_search_keeps_its_bound(seed, suboptimality):
    world = random_world(np.random.default_rng(seed), (10, 12), RUNS, (2, 1, 2), blocks=4, **COSTS[2])
    least, _ = dijkstra_plain(world)
    if np.isinf(least):
        return
    problem = as_problem(world)
    plan = search_lattice(problem, suboptimality=suboptimality)
    assert plan.lower_bound <= least + 1e-9 <= plan.cost + 2e-9
    assert plan.cost <= (1 + suboptimality) * least + 1e-9
    assert plan.gap <= suboptimality / (1 + suboptimality) + 1e-9
    assert cost_of(world, problem, plan.steps) == pytest.approx(plan.cost, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_never_costlier_than_the_weighted_heuristic(seed):
    world = random_world(np.random.default_rng(100 + seed), (12, 14), RUNS, (2, 2, 1), blocks=5)
    cost, _ = astar_thesis(world)
    if np.isfinite(cost):
        assert search_lattice(as_problem(world)).cost <= cost + 1e-9


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("most_states", [0, 1000, 5000])
def test_a_search_that_ends_early_still_proves_a_bound(seed, most_states):
    world = random_world(np.random.default_rng(seed), (10, 12), RUNS, (2, 1, 2), blocks=4, **COSTS[2])
    least, _ = dijkstra_plain(world)
    problem = as_problem(world)
    if np.isinf(least):
        return
    plan = search_lattice(problem, most_states=most_states)
    assert plan.lower_bound <= least + 1e-9 <= plan.cost + 2e-9
    assert cost_of(world, problem, plan.steps) == pytest.approx(plan.cost, abs=1e-9)


def test_runs_that_lead_to_the_goal_cost_nothing():
    world = World(np.ones((8, 3), dtype=bool), (Run(2, 0, 0, 0),), (3,), (0, 1, 0), (6, 1, 0))
    plan = search_lattice(as_problem(world))
    assert (plan.cost, plan.lower_bound, plan.gap) == (0.0, 0.0, 0.0)
    assert [q for _, q in plan.steps] == [0, 0, 0, -1]


def test_without_runs_it_is_the_shortest_way():
    world = World(np.ones((8, 5), dtype=bool), (), (), (0, 0, 0), (7, 4, 1))
    assert search_lattice(as_problem(world)).cost == 7 + 4 + 1


def test_mirrored_worlds_cost_the_same():
    world = random_world(np.random.default_rng(3), (10, 12), RUNS, (1, 2, 1), blocks=5, **COSTS[1])
    mirrored = World(
        world.free[:, ::-1],
        tuple(Run(run.ahead, -run.starboard, -run.turn, run.room) for run in world.runs),
        world.counts,
        (0, 11, 0),
        (9, 0, 0),
        world.step,
        world.turn,
    )
    assert search_lattice(as_problem(mirrored)).cost == pytest.approx(search_lattice(as_problem(world)).cost)


def test_moves_that_pay_are_refused():
    moves = csr_array((np.array([-1.0]), (np.array([0]), np.array([1]))), shape=(2, 2))
    with pytest.raises(InputError, match="cheapest move costs -1, expected 0 or more"):
        LatticeProblem(moves=moves, runs=(), counts=(), start=0, goal=1)


def test_progress_is_told_and_grows():
    told = []
    world = random_world(np.random.default_rng(0), (8, 8), RUNS, (1, 1, 1), blocks=0)
    search_lattice(as_problem(world), progress=lambda what, share: told.append(share))
    assert told[: sum(world.counts) + 1] == sorted(told[: sum(world.counts) + 1])
    assert all(0 <= share < 1 for share in told)
