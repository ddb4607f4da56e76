"""Capability of ships on legs, and the controllers that steer them along references."""

from expdesign.plan.control.acceleration_limits import LegEnd, SpeedChanges, least_loss, leg_end, to_work_s
from expdesign.plan.control.helm_capability import HELM_SHARE, STEADY_HULLS, full_ahead, stopped
from expdesign.plan.control.ships import (
    APPROACH_HULLS,
    RUN_UP_TIME_CONSTANTS,
    SETTLING_HULLS,
    TRACK_LEAD,
    USABLE_SHARE,
    AgileShip,
    Capability,
    DubinsShip,
    HelmShip,
    capability,
    needs_helm,
)
from expdesign.plan.control.tracking import CATCH_UP, Helmsman, Reference, lengths, over_ground
