"""Independent verification of a plan; imports nothing of the planner but its values."""

from expdesign.plan.verify.checks import hull_clearance, verify_plan
from expdesign.plan.verify.efficiency import (
    about_ship,
    expected_errors,
    part_of_track,
    realised_efficiencies,
    track_covariance,
    track_information,
)
