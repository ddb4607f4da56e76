"""Order and placement of the runs: beam search, heuristic, local search, state lattice."""

from expdesign.plan.search.beam import place_runs
from expdesign.plan.search.heuristic import path_exceeds_displacement
from expdesign.plan.search.lattice import LatticePlan, search_lattice
from expdesign.plan.search.lattice_moves import build_lattice

__all__ = [
    "LatticePlan",
    "build_lattice",
    "path_exceeds_displacement",
    "place_runs",
    "search_lattice",
]
