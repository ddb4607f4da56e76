"""The one place where a kind of ship gets its local planner."""

from __future__ import annotations

from collections.abc import Sequence

from expdesign.dictionary import Primitive
from expdesign.plan.control import AgileShip, DubinsShip, HelmShip
from expdesign.plan.legs import LegWater
from expdesign.plan.local_planner.agile import AgilePlanner
from expdesign.plan.local_planner.dubins import DubinsPlanner
from expdesign.plan.local_planner.helm import HelmPlanner, recoveries
from expdesign.plan.local_planner.protocol import LocalPlanner


def local_planner(water: LegWater, runs: Sequence[Primitive] = ()) -> LocalPlanner:
    """The local planner of the ship that sails in a water, for a search that places these runs."""
    match water.ship:
        case AgileShip() as ship:
            return AgilePlanner(ship=ship, vessel=water.vessel)
        case HelmShip() as ship:
            return HelmPlanner(ship=ship, recoveries=recoveries(ship, water, runs))
        case DubinsShip() as ship:
            return DubinsPlanner(ship=ship)
        case other:
            raise TypeError(f"no local planner for {type(other).__name__}")
