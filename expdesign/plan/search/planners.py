"""The planners by name: searches for the order and the places of the runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.errors import NoPlan, NoRoom
from expdesign.plan.local_planner import Departure, SearchSpace
from expdesign.plan.search.beam import POLISHED_ORDERS, place_runs
from expdesign.plan.search.lattice import search_lattice
from expdesign.plan.search.lattice_moves import Lattice, build_lattice
from expdesign.plan.values import LatticeProof, Placement, Placements, PlanSettings, WorkBudget
from expdesign.progress import Progress, silent

DRAFT_ORDERS = 2  # orders of runs of which the best plan is polished in a draft
LATTICE_RADII = 1.1  # default distance between cells of the lattice, in turning radii
LATTICE_POSES = 60_000  # poses that the default keeps below where the water is large
LATTICE_FINER = (1.0, 0.7, 0.5)  # factors on the default distance that are tried where the lattice holds no plan
LATTICE_SUBOPTIMALITY = 0.02  # plans that could save no more than this share are left out
LATTICE_STATES = 1e7  # after which the search ends with the bound proved by then
LATTICE_STATE_S = 1e-6  # counted work for each state [s]


def placed_runs(
    settings: PlanSettings, space: SearchSpace, repeats: Sequence[int], departure: Departure, progress: Progress
) -> Placements:
    """Start poses of all runs in the order in which they are to be done, by the planner that the settings name.

    Args:
        settings: with the planner, and what it takes.
        repeats: of each of the space's runs.
        departure: where the search begins.

    Raises:
        NoPlan: some run does not fit anywhere the search can reach, or no path leads to the goal.
    """
    if settings.planner == "beam":
        budget, orders = WorkBudget(), DRAFT_ORDERS if settings.draft else POLISHED_ORDERS
        runs = place_runs(space, repeats, departure, orders=orders, budget=budget, progress=progress)
        return Placements(runs=runs, work_s=budget.spent_s)
    return placed_on_lattice(space, repeats, departure, spacing_m=settings.lattice_spacing_m, progress=progress)


def placed_on_lattice(
    space: SearchSpace,
    repeats: Sequence[int],
    departure: Departure,
    *,
    spacing_m: float | None = None,
    progress: Progress = silent,
) -> Placements:
    """The cheapest plan on the lattice, finer ones being tried where the default one holds none.

    Args:
        space, repeats, departure, progress: of `placed_runs`.
        spacing_m: between cells, or None for one that suits the ship and the size of the water.

    Raises:
        NoPlan: no lattice tried holds a plan; says for which spacing.
    """
    spacings = _spacings(space, spacing_m)
    for each_m in spacings:
        try:
            return _placed(Lattice(space=space, spacing_m=each_m), repeats, departure, progress)
        except NoPlan as error:
            refusal = error
    finer = "smaller" if spacing_m or len(spacings) == 1 else f"smaller than {spacings[-1]:.4g}"
    raise NoRoom(f"{refusal}; not tried: a plan.lattice_spacing_m {finer}", what="lattice")


def _spacings(space: SearchSpace, asked_m: float | None) -> tuple[float, ...]:
    """Distances between cells to try; ships that cannot turn on the spot need a turning radius."""
    turns = space.ship.spot_rate_radps > 0
    least_m = 0.0 if turns else space.ship.turning_radius_m
    if asked_m is not None:
        return (max(asked_m, least_m),)
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
