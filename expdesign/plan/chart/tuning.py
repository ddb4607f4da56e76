"""Numbers of this package that are chosen, not derived, and that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Clearance grid, visibility graph and distance to the goal."""

    # of a simplified water at most, by the least tolerance, in those asked for, at which so many are accepted: more
    # make the graph slow, but water that shrinks further loses its passages. A thousand islands have four thousand
    # corners, however straight their shores. Water that grows has the first number at most.
    corners: tuple[tuple[float, int], ...] = ((1.0, 700), (16.0, 2500), (128.0, 5000))
    # corners of a water above which a coarser one is made of a finer one that was tried, not of the water
    dense: int = 16_000
    pairs: int = 1_000_000  # of corners that are tested for sight at a time
    kept_graphs: int = 12  # visibility graphs, clearance grids and tables of distances that a process keeps


CHART = Tuning()
