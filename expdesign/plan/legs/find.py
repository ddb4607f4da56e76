"""Repositioning legs: commands that take the vessel from one state to another in safe water."""

from __future__ import annotations

from expdesign.plan.legs.agile import agile_leg
from expdesign.plan.legs.dubins import curved_leg
from expdesign.plan.legs.helm import helmed_leg
from expdesign.plan.legs.water import LegTask, LegWater, leg_trajectory
from expdesign.values import Array

__all__ = ["LegTask", "LegWater", "find_leg", "leg_trajectory"]


def find_leg(task: LegTask, water: LegWater) -> Array | None:
    """Commands (k, m) that take the vessel from one state to the other in safe water, or None when none is found.

    Ships that are steered by a helm sail arcs that they can turn on, with a run-up before each run. Agile vessels turn
    where they are and go the shortest way; others, and agile ones that find no such leg, sail Dubins curves. The end
    commands of azimuths without angle limits may be whole turns away from the wished ones.
    """
    if water.parted(task.start[:2], task.end[:2]):
        return None
    if water.ship.approach is not None:
        return helmed_leg(task, water)
    found = agile_leg(task, water) if water.ship.agile else None
    return curved_leg(task, water) if found is None else found
