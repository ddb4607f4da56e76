"""Order and placement of the runs: the planners by name, beam search, local search, state lattice."""

from expdesign.plan.search.beam import path_exceeds_displacement, place_runs
from expdesign.plan.search.local_search import have_room, measured_s, with_another
from expdesign.plan.search.planners import placed_runs
