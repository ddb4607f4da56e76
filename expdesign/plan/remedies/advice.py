"""What helps against a refusal, by the kind of obstacle."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from expdesign.errors import NoPlan
from expdesign.plan.problem import PlanProblem
from expdesign.plan.remedies.changes import UNCHECKED
from expdesign.plan.remedies.paths import for_berth, for_parted, for_passage, for_settings
from expdesign.plan.remedies.places import for_confidence, for_lattice, for_room
from expdesign.plan.remedies.trials import for_risk, for_sailing, for_verification


def advised(problem: PlanProblem, refused: NoPlan) -> NoPlan:
    """The refusal with what helps.

    Args:
        problem: that was refused, with the water in which it was.
        refused: by the planner.
    """
    check = CHECKS.get(refused.what)
    if check is None:
        refused.remedies = refused.remedies or (UNCHECKED,)
        return refused
    try:
        found = tuple(check(problem, refused))
    except NoPlan as error:  # another obstacle behind this one
        found = (f"a remedy cannot be checked: {error.obstacle}",)
    refused.remedies = (*found, *refused.remedies)
    return refused


CHECKS: Mapping[str, Callable[[PlanProblem, NoPlan], Iterator[str]]] = {
    "berth": for_berth,
    "confidence": for_confidence,
    "lattice": for_lattice,
    "parted": for_parted,
    "passage": for_passage,
    "radius": for_settings,
    "risk": for_risk,
    "room": for_room,
    "sailing": for_sailing,
    "speed": for_settings,
    "unstable": for_confidence,
    "verification": for_verification,
}
"""Remedies by the kind of obstacle, as `NoPlan.what` names it."""
