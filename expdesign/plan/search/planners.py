"""The planners by name: searches for the order and the places of the runs, one interface for all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from expdesign.errors import NoPlan, NoRoom
from expdesign.plan.local_planner import SearchSpace
from expdesign.plan.search.beam import place_runs
from expdesign.plan.search.lattice import search_lattice
from expdesign.plan.search.lattice_moves import Departure, Lattice, build_lattice
from expdesign.plan.values import LatticeProof, Placement, Placements, PlannerName, PlanSettings
from expdesign.progress import Progress, silent
from expdesign.values import Array

LATTICE_RADII = 1.1  # default distance between cells of the lattice, in turning radii
LATTICE_POSES = 60_000  # poses that the default keeps below where the water is large
LATTICE_FINER = (1.0, 0.7, 0.5)  # factors on the default distance that are tried where the lattice holds no plan
LATTICE_SUBOPTIMALITY = 0.02  # plans that could save no more than this share are left out
LATTICE_STATES = 1e7  # after which the search ends with the bound proved by then
LATTICE_STATE_S = 1e-6  # counted work for each state [s]


# The lattice planner: order and placement of the runs by the exact search on a state lattice, with its proof.


@dataclass(frozen=True, kw_only=True)
class LatticeSearch:
    """Places runs on a lattice."""

    spacing_m: float | None = None  # between cells, or None for one that suits the ship and the size of the water

    @property
    def tries_transitions(self) -> bool:
        """No: legs between runs are long enough for the rule for leg times."""
        return False

    def place(
        self,
        space: SearchSpace,
        repeats: Sequence[int],
        *,
        start: Array,
        exit_mps: float = 0.0,
        last: str = "",
        progress: Progress = silent,
    ) -> Placements:
        """The cheapest plan on the lattice, finer ones being tried where the default one holds none.

        Raises:
            NoPlan: no lattice tried holds a plan; says for which spacing.
        """
        names = [item.name for item in space.footprints]
        departure = Departure(pose=start, exit_mps=exit_mps, last=names.index(last) if last in names else -1)
        spacings = self._spacings(space)
        for spacing_m in spacings:
            try:
                return _placed(Lattice(space=space, spacing_m=spacing_m), repeats, departure, progress)
            except NoPlan as error:
                refusal = error
        finer = "smaller" if self.spacing_m or len(spacings) == 1 else f"smaller than {spacings[-1]:.4g}"
        raise NoRoom(f"{refusal}; not tried: a plan.lattice_spacing_m {finer}", what="lattice")

    def _spacings(self, space: SearchSpace) -> tuple[float, ...]:
        """Distances between cells to try; ships that cannot turn on the spot need a turning radius."""
        turns = space.ship.spot_rate_radps > 0
        least_m = 0.0 if turns else space.ship.turning_radius_m
        if self.spacing_m is not None:
            return (max(self.spacing_m, least_m),)
        usual_m = max(LATTICE_RADII * space.ship.turning_radius_m, space.hull_m)
        water_m2 = np.count_nonzero(space.field.clearance_m >= space.leg_margin_m) * space.field.cell_m**2
        base_m = max(usual_m, float(np.sqrt(water_m2 * (8 if turns else 4) / LATTICE_POSES)))
        return tuple(sorted({max(factor * base_m, least_m) for factor in LATTICE_FINER}, reverse=True))


def _placed(lattice: Lattice, repeats: Sequence[int], departure: Departure, progress: Progress) -> Placements:
    problem = build_lattice(lattice, repeats, departure)
    where = f"on a lattice of {lattice.spacing_m:.4g} m"
    for item, edges, count in zip(lattice.space.footprints, problem.runs, problem.counts, strict=True):
        if count and not edges.nnz:
            raise NoPlan(f"no room for {item.name!r} {where}")
    try:
        found = search_lattice(
            problem, suboptimality=LATTICE_SUBOPTIMALITY, most_states=LATTICE_STATES, progress=progress
        )
    except NoPlan as error:
        raise NoPlan(f"{error}, {where}") from None
    proof = LatticeProof(
        spacing_m=lattice.spacing_m,
        headings=lattice.headings,
        cost_s=found.cost,
        lower_bound_s=found.lower_bound,
    )
    return Placements(
        runs=_placements(lattice, found.steps),
        work_s=LATTICE_STATE_S * found.expansions,
        lattice=proof,
    )


def _placements(lattice: Lattice, steps: Sequence[tuple[int, int]]) -> tuple[Placement, ...]:
    """Where the runs of a lattice plan begin, in its order."""
    runs = [(pose, q) for pose, q in steps if q >= 0]
    poses = lattice.poses(np.array([pose for pose, _ in runs], dtype=int))
    names = [item.name for item in lattice.space.footprints]
    return tuple(Placement(primitive=names[q], pose=pose) for (_, q), pose in zip(runs, poses, strict=True))


class PlacementSearch(Protocol):
    """Orders and places runs."""

    @property
    def tries_transitions(self) -> bool:
        """Whether it makes use of transitions between runs that were tried before."""

    def place(
        self,
        space: SearchSpace,
        repeats: Sequence[int],
        *,
        start: Array,
        exit_mps: float = 0.0,
        last: str = "",
        progress: Progress = silent,
    ) -> Placements:
        """Start poses of all runs in the order in which they are to be done.

        Args:
            space: the runs and the water.
            repeats: of each of the space's runs.
            start: (3,) pose where the search begins.
            exit_mps: surge speed there.
            last: name of the run that ends there, if any.
            progress: of the search.

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
        self,
        space: SearchSpace,
        repeats: Sequence[int],
        *,
        start: Array,
        exit_mps: float = 0.0,
        last: str = "",
        progress: Progress = silent,
    ) -> Placements:
        """The best plan that the beam keeps."""
        runs = place_runs(space, repeats, start=start, exit_mps=exit_mps, last=last, progress=progress)
        return Placements(runs=runs)


def placement_search(settings: PlanSettings) -> PlacementSearch:
    """The search that the settings name."""
    planners: Mapping[PlannerName, PlacementSearch] = {
        "beam": BeamSearch(),
        "lattice": LatticeSearch(spacing_m=settings.lattice_spacing_m),
    }
    return planners[settings.planner]
