"""Which causes explain the data: forward search, pruning, and what tells two apart."""

from expdesign.diagnosis.select.discriminating_manoeuvre import Proposal, most_telling, standard_proposals
from expdesign.diagnosis.select.forward_search import ALARM, LARGE_WANDER_MPS, search
from expdesign.diagnosis.select.pruning import LEAST_GAIN, kept, only_moves
from expdesign.diagnosis.select.search_state import Search, Step

__all__ = [
    "ALARM",
    "LARGE_WANDER_MPS",
    "LEAST_GAIN",
    "Proposal",
    "Search",
    "Step",
    "kept",
    "most_telling",
    "only_moves",
    "search",
    "standard_proposals",
]
