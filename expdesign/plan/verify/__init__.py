"""Independent verification of a plan; imports no other room of the planner."""

from expdesign.plan.verify.checks import hull_clearance, verify_plan
from expdesign.plan.verify.efficiency import realised_efficiencies

__all__ = ["hull_clearance", "realised_efficiencies", "verify_plan"]
