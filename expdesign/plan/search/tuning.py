"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Beam search, local search and lattice search.

    Attributes:
        beam_width: partial plans kept.
        polished_orders: orders of runs of which the best plan is polished; the best one then counts.
        checked_at_once, sorted_at_once: successors checked for clearance at a time, and sorted.
        many_runs, sparse_discs: of more runs than this, every so manieth disc is looked at before all of them.
        cell_hulls, heading_rad: places of which one successor is kept: their size in hull lengths, and in heading.
        shift_hulls, turn_deg: steps of the local search, and with each a turn.
        blocks_at_once: moves of a block looked at together at first, four times as many then.
        sweeps: over all blocks of runs at most.
        same: hull lengths and radians by which a leg may differ from a transition that was tried.
        least_gain_s: for which a block is moved.
        lattice_radii: default distance between cells of the lattice, in turning radii.
        lattice_poses: poses that the default keeps below where the water is large.
        lattice_finer: factors on the default distance that are tried where the lattice holds no plan.
        lattice_suboptimality: plans that could save no more than this share are left out.
        lattice_states: after which the search ends with the bound proved by then.
        lattice_state_s: counted work for each state [s].
        lattice_nearby: cells to each side, at least, within which legs lead from and to the lattice.
        lattice_points: places looked at along a move.
        lattice_least_speed: over ground against a current, in transit speeds.
    """

    beam_width: int = 400
    polished_orders: int = 6
    checked_at_once: int = 1024
    sorted_at_once: int = 8192
    many_runs: int = 50
    sparse_discs: int = 8
    cell_hulls: float = 2.0
    heading_rad: float = 0.4
    shift_hulls: tuple[float, ...] = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125, 0.0625)
    turn_deg: tuple[float, ...] = (90.0, 60.0, 40.0, 25.0, 15.0, 8.0, 4.0, 2.0)
    blocks_at_once: int = 4
    sweeps: int = 20
    same: float = 1e-3
    least_gain_s: float = 0.05
    lattice_radii: float = 1.1
    lattice_poses: int = 60_000
    lattice_finer: tuple[float, ...] = (1.0, 0.7, 0.5)
    lattice_suboptimality: float = 0.02
    lattice_states: float = 1e7
    lattice_state_s: float = 1e-6
    lattice_nearby: int = 2
    lattice_points: int = 8
    lattice_least_speed: float = 0.1


SEARCH = Tuning()
