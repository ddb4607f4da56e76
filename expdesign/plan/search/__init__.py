"""Order and placement of the runs: beam search, heuristic, local search, state lattice."""

from expdesign.plan.search.beam import is_carried, place_runs
from expdesign.plan.search.lattice import LatticePlan, search_lattice
from expdesign.plan.search.lattice_moves import build_lattice
from expdesign.plan.search.state import SearchSpace, Stamp, refusing, stamp
from expdesign.plan.search.transitions import pairs_of, settled

__all__ = [
    "LatticePlan",
    "SearchSpace",
    "Stamp",
    "build_lattice",
    "is_carried",
    "pairs_of",
    "place_runs",
    "refusing",
    "search_lattice",
    "settled",
    "stamp",
]
