"""What helps against a refusal, by the kind of obstacle."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from expdesign.errors import NoPlan
from expdesign.plan.problem import PlanProblem
from expdesign.plan.remedies.changes import UNCHECKED, Tell
from expdesign.plan.remedies.paths import for_berth, for_parted, for_passage, for_settings
from expdesign.plan.remedies.places import for_confidence, for_lattice, for_room
from expdesign.plan.remedies.trials import for_risk, for_sailing, for_verification
from expdesign.progress import Progress, silent


def advised(problem: PlanProblem, refused: NoPlan, progress: Progress = silent) -> NoPlan:
    """The refusal with what helps.

    Args:
        problem: that was refused, with the water in which it was.
        refused: by the planner.
        progress: says what is tried.
    """
    progress(f"there is no plan: {refused.obstacle}", math.nan)
    check = CHECKS.get(refused.what)
    if check is None:
        refused.remedies = refused.remedies or (UNCHECKED,)
        return refused
    try:
        found = tuple(check(problem, refused, partial(_tell, progress)))
    except NoPlan as error:  # another obstacle behind this one
        found = (f"a remedy cannot be checked: {error.obstacle}",)
    refused.plan = None
    refused.remedies = (*found, *refused.remedies)
    return refused


def _tell(progress: Progress, tried: str) -> None:
    """Say what is tried; when that ends, nobody knows."""
    progress(f"there is no plan; trying whether this would help: {tried}", math.nan)


CHECKS: Mapping[str, Callable[[PlanProblem, NoPlan, Tell], Iterator[str]]] = {
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
