"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Clearance grid, visibility graph and distance to the goal.

    Attributes:
        grid_cells: of the clearance grid at most; a larger area gets a coarser grid.
        fine_hulls: spacing of that grid in hull lengths above which a smaller part of the chart is planned in.
        kept: share of the extent of the water, from which on nothing is left out for being unreachable.
        least_reach_hulls: hull lengths that this part reaches from start and goal at least.
        routing_cells: of the grid on which the narrowest passage is located.
        corners: of a simplified water at most, by the least tolerance, in those asked for, at which so many are
            accepted: more make the graph slow, but water that shrinks further loses its passages. A thousand islands
            have four thousand corners, however straight their shores. Water that grows has the first number at most.
        more_corners: the same, where no path was found through water with so few.
        straight: share of the tolerance by which moved shores are straightened; the rest is for moving them.
        dense: corners of a water above which a coarser one is made of a finer one that was tried, not of the water.
        pairs: of corners that are tested for sight at a time.
        kept_graphs, kept_grids, kept_tables: visibility graphs, clearance grids and tables of distances that a process
            keeps.
        slit_m: growth of the water before lines of sight are tested, as a path may touch the shore.
        glances: shares of a line of sight at which it is tested first.
        taut: share of the water's size by which a path may miss a corner that it bends at.
        table_cells: of the table of distances to the goal.
        table_chunk: cells of that table processed at a time.
    """

    grid_cells: int = 3_000_000
    fine_hulls: float = 0.25
    kept: float = 0.9
    least_reach_hulls: float = 60.0
    routing_cells: int = 400_000
    corners: tuple[tuple[float, int], ...] = ((1.0, 700), (16.0, 2500), (128.0, 5000))
    more_corners: tuple[tuple[float, int], ...] = ((1.0, 700), (16.0, 12000))
    straight: float = 0.98
    dense: int = 16_000
    pairs: int = 1_000_000
    kept_graphs: int = 12
    kept_grids: int = 3
    kept_tables: int = 6
    slit_m: float = 1e-3
    glances: tuple[float, ...] = (0.5, 0.75, 0.25, 0.9, 0.1, 0.625, 0.375)
    taut: float = 1e-3
    table_cells: int = 60_000
    table_chunk: int = 1000


CHART = Tuning()
