"""Simulation of the extended model over all windows, and its linearisation."""

from expdesign.diagnosis.motion.equations_of_motion import stacked_rates
from expdesign.diagnosis.motion.inputs import exogenous_inputs
from expdesign.diagnosis.motion.linearisation import (
    Disturbance,
    LinearisedMotion,
    Motion,
    channels_apart,
    disturbance_of,
    linearise,
    linearised_like,
    responses,
    start_responses,
    term_disturbances,
)
from expdesign.diagnosis.motion.simulation import (
    fitted_start,
    initial_states,
    longest_windows,
    simulate_from_measured,
    simulate_nearby,
    simulate_windows,
    stable_windows,
)
