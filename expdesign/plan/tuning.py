"""The numbers of the planner's own modules that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Work budgets, replanning and warnings.

    Attributes:
        turns_deg: from the heading asked for at start and goal, tried as remedies to both sides [deg].
        replans: plans made after the first one, each with more room where drawn trials of the one before left the
            water.
        transition_beam: partial plans kept in the searches that choose the transitions to optimise.
    """

    turns_deg: tuple[float, ...] = tuple(15.0 * count for count in range(1, 13))
    replans: int = 2
    transition_beam: int = 100


PLAN = Tuning()
