"""The simulation model with effects added to it, and how well it simulates the data."""

from expdesign.diagnosis.model.accuracy import accuracy, first_states, simulate_from_first, sums
from expdesign.diagnosis.model.delivered_inputs import grouped, input_groups, members
from expdesign.diagnosis.model.extended import ANGLE_STEMS, ROLL, Extended
from expdesign.diagnosis.model.motion import (
    Linear,
    Motion,
    Push,
    linearise,
    push_of,
    responses,
    simulate_windows,
    start_responses,
)
from expdesign.diagnosis.model.residuals import ENOUGH, Dependence, dependence, on_the_whole, short_residuals
from expdesign.diagnosis.model.support import check_support, still_inputs
from expdesign.diagnosis.model.surroundings import mean_wind
from expdesign.diagnosis.model.terms import (
    AIR_SIGNALS,
    ahead_force,
    ahead_force_text,
    is_coriolis,
    is_damping,
    is_thrust,
    own_lean_terms,
    reads_rudder,
    scales,
    turns_by_force,
)

__all__ = [
    "AIR_SIGNALS",
    "ANGLE_STEMS",
    "ENOUGH",
    "ROLL",
    "Dependence",
    "Extended",
    "Linear",
    "Motion",
    "Push",
    "accuracy",
    "ahead_force",
    "ahead_force_text",
    "check_support",
    "dependence",
    "first_states",
    "grouped",
    "input_groups",
    "is_coriolis",
    "is_damping",
    "is_thrust",
    "linearise",
    "mean_wind",
    "members",
    "on_the_whole",
    "own_lean_terms",
    "push_of",
    "reads_rudder",
    "responses",
    "scales",
    "short_residuals",
    "simulate_from_first",
    "simulate_windows",
    "start_responses",
    "still_inputs",
    "sums",
    "turns_by_force",
]
