"""Repositioning legs: the water they share, and optimised commands for each kind of ship."""

from expdesign.plan.legs._ompl import dubins_curve
from expdesign.plan.legs.agile import agile_leg, free_leg
from expdesign.plan.legs.dubins import curved_leg
from expdesign.plan.legs.helm import helm_leg
from expdesign.plan.legs.recovery import displaced, recover
from expdesign.plan.legs.water import (
    BEYOND_ENDS,
    FoundLeg,
    LegPath,
    LegTask,
    LegWater,
    acceptable,
    check_ends,
    escapes,
    last_state,
    leg_speed_mps,
    nearest_turns,
    through_water,
)
