"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Beam search and local search.

    Attributes:
        beam_width: partial plans kept.
        polished_orders: orders of runs of which the best plan is polished; the best one then counts.
        checked_at_once: successors checked for clearance at a time.
        cell_hulls, heading_rad: places of which one successor is kept: their size in hull lengths, and in heading.
        shift_hulls, turn_deg: steps of the local search, and with each a turn.
        sweeps: over all blocks of runs at most.
        same: hull lengths and radians by which a leg may differ from a transition that was tried.
        least_gain_s: for which a block is moved.
    """

    beam_width: int = 400
    polished_orders: int = 6
    checked_at_once: int = 4096
    cell_hulls: float = 2.0
    heading_rad: float = 0.4
    shift_hulls: tuple[float, ...] = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125, 0.0625)
    turn_deg: tuple[float, ...] = (90.0, 60.0, 40.0, 25.0, 15.0, 8.0, 4.0, 2.0)
    sweeps: int = 20
    same: float = 1e-3
    least_gain_s: float = 0.05


SEARCH = Tuning()
