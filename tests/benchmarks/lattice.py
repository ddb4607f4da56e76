"""The exact lattice search against plain Python, on the thesis's size and on one 121 times larger.

``python tests/benchmarks/lattice.py``: 35 x 44 cells, four headings, three runs three times each, moves of equal cost
(F. Ljungberg, doctoral thesis, Linköping University, section 9.4), on invented islands, several worlds. Beside it a
plain Dijkstra that proves the same optimum state by state, and A* with the thesis's heuristic, (8.9)-(8.12), weights 1.
Then five runs five times each, 47,900,160 states.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from expdesign.plan.search.lattice import search_lattice
from lattice_case import Run, as_problem, astar_thesis, dijkstra_plain, random_world

THREE = (Run(5, 0, 0, 1), Run(3, 0, 0, 2), Run(0, 4, 0, 1))
BEST_OF = 3  # each search is timed as its quickest run of so many
FIVE = (*THREE, Run(4, 2, 1, 1), Run(0, 0, 0, 3))


def timed(function, *arguments, **options):
    """Result and seconds."""
    began = time.perf_counter()
    result = function(*arguments, **options)
    return result, time.perf_counter() - began


def quickest(function, *arguments):
    """The same, of the quickest run."""
    return min((timed(function, *arguments) for _ in range(BEST_OF)), key=lambda pair: pair[1])


def main() -> None:
    """Print both tables."""
    print("world  cost  bound  expansions  seconds | Dijkstra seconds  ratio | A* (8.9) cost  seconds")
    for seed in (0, 1, 2, 3):
        world = random_world(np.random.default_rng(seed), (35, 44), THREE, (3, 3, 3), blocks=8)
        problem = as_problem(world)
        plan, seconds = quickest(search_lattice, problem)
        (least, _), plain = quickest(dijkstra_plain, world)
        (cost, _), astar = quickest(astar_thesis, world)
        assert plan.cost == plan.lower_bound == least <= cost
        print(
            f"{seed:5d} {plan.cost:5g} {plan.lower_bound:6g} {plan.expansions:11d} {seconds:8.3f} | {plain:16.2f} "
            f"{plain / seconds:6.0f} | {cost:13g} {astar:8.2f}"
        )
    for seed in (0, 1):
        problem = as_problem(random_world(np.random.default_rng(seed), (35, 44), FIVE, (5,) * 5, blocks=8))
        plan, seconds = timed(search_lattice, problem)
        print(
            f"five runs five times each, world {seed}: {problem.states} states, cost {plan.cost:g}, bound "
            f"{plan.lower_bound:g} (gap {plan.gap:.1%}), {plan.expansions} expansions, {seconds:.1f} s"
        )


if __name__ == "__main__":
    main()
