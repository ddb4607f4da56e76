"""Manoeuvring indices of IMO MSC.137(76): from simulated and from measured standard trials, with their criteria.

Advance, transfer and tactical diameter are those of the midship point, the origin of the b-frame, counted from the
rudder order along and across the heading of the approach. SI units and radians; sides are "starboard" and "port".
"""

from expdesign.indices.criteria import (
    BEAUFORT_MPS,
    DEPTH_BY_DRAUGHT,
    HIGHEST_SEA,
    STRONGEST_WIND,
    Circle,
    Condition,
    Conditions,
    Stop,
    Verdict,
    ZigZag,
    admissibility,
    beaufort,
    criteria,
    judge,
)
from expdesign.indices.measured import NotStandard, measured_trial, with_drift_of_circles
from expdesign.indices.outcomes import OUTCOMES, StandardResults, outcome_gradients, outcomes, standard_results
from expdesign.indices.read import steered_run
