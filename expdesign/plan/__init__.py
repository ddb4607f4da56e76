"""The plan: sea area, placement and order of runs, legs between them, verification."""

from expdesign.plan.area import LocalFrame, SeaArea, as_multipolygon
from expdesign.plan.values import Leg, Placement, Plan, PlanSettings, Verification

__all__ = ["Leg", "LocalFrame", "Placement", "Plan", "PlanSettings", "SeaArea", "Verification", "as_multipolygon"]
