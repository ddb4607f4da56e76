"""Simulation: equations of motion, integrators, environment and sensors."""

from expdesign.simulation.actuation import (
    ActuatorState,
    SampleMap,
    acting_response,
    deliver,
    deliver_through,
    delivered,
    delivered_at_samples,
    keeps_to,
    mapped,
    positions,
    sample_map,
    step_shares,
)
from expdesign.simulation.ensemble import Ensemble, mean_weather, simulate_ensemble
from expdesign.simulation.environment import CALM, Environment, Variation, WeatherSeries, draw_environment, draw_weather
from expdesign.simulation.helm import Approach, Helm, steady_ahead
from expdesign.simulation.motion import euler_step, motion_rates, relative_velocity, rk4_step, to_body
from expdesign.simulation.run import in_waves, integrate_motion, rudder_angle, simulate, simulate_many, steering_signals
from expdesign.simulation.sensors import measure
from expdesign.simulation.standard_trials import Conduct, pull_out, stopping, turning_circle, zigzag
