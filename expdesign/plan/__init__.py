"""The plan: sea area, placement and order of runs, legs between them, verification."""

from expdesign.plan.values import Leg, Placement, Plan, PlanSettings, Verification
from expdesign.sea_area import LocalFrame, SeaArea, as_multipolygon
