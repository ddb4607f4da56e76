"""The plan: sea area, placement and order of runs, legs between them, verification."""

from expdesign.plan.values import Leg, Plan, PlanSettings
from expdesign.sea_area import LocalFrame, SeaArea, as_multipolygon
