"""The planners by name: searches for the order and the places of the runs, one interface for all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from expdesign.plan.local_planner import SearchSpace
from expdesign.plan.search.beam import place_runs
from expdesign.plan.search.lattice_search import LatticeSearch
from expdesign.plan.values import Placements, PlannerName, PlanSettings
from expdesign.values import Array


class PlacementSearch(Protocol):
    """Orders and places runs."""

    @property
    def tries_transitions(self) -> bool:
        """Whether it makes use of transitions between runs that were tried before."""

    def place(
        self, space: SearchSpace, repeats: Sequence[int], *, start: Array, exit_mps: float = 0.0, last: str = ""
    ) -> Placements:
        """Start poses of all runs in the order in which they are to be done.

        Args:
            space: the runs and the water.
            repeats: of each of the space's runs.
            start: (3,) pose where the search begins.
            exit_mps: surge speed there.
            last: name of the run that ends there, if any.

        Raises:
            NoPlan: some run does not fit anywhere the search can reach, or no path leads to the goal.
        """


@dataclass(frozen=True, kw_only=True)
class BeamSearch:
    """The beam search over continuous poses, polished."""

    @property
    def tries_transitions(self) -> bool:
        """Yes: runs may begin close to the end of the one before."""
        return True

    def place(
        self, space: SearchSpace, repeats: Sequence[int], *, start: Array, exit_mps: float = 0.0, last: str = ""
    ) -> Placements:
        """The best plan that the beam keeps."""
        return Placements(runs=place_runs(space, repeats, start=start, exit_mps=exit_mps, last=last))


def placement_search(settings: PlanSettings) -> PlacementSearch:
    """The search that the settings name."""
    planners: Mapping[PlannerName, PlacementSearch] = {
        "beam": BeamSearch(),
        "lattice": LatticeSearch(spacing_m=settings.lattice_spacing_m),
    }
    return planners[settings.planner]
