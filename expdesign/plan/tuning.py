"""The numbers of the planner's own modules that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Work budgets, replanning and warnings."""

    # from the heading asked for at start and goal, tried as remedies to both sides [deg]
    turns_deg: tuple[float, ...] = tuple(15.0 * count for count in range(1, 13))
    # plans made after the first one, each with more room where drawn trials of the one before left the water
    replans: int = 2
    transition_beam: int = 100  # partial plans kept in the searches that choose the transitions to optimise


PLAN = Tuning()
