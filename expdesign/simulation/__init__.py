"""Simulation: equations of motion, integrators, environment and sensors."""

from expdesign.simulation.ensemble import Ensemble, Weather, simulate_ensemble
from expdesign.simulation.environment import CALM, Environment
from expdesign.simulation.helm import Approach, Helm, service_speed, steady_ahead
from expdesign.simulation.helmsman import Conduct
from expdesign.simulation.motion import euler_step, motion_rates, relative_velocity, rk4_step, to_body
from expdesign.simulation.run import simulate, simulate_many
from expdesign.simulation.sensors import draw_environment, measure
from expdesign.simulation.standard_trials import initial_turn, pull_out, stopping, turning_circle, zigzag

__all__ = [
    "CALM",
    "Approach",
    "Conduct",
    "Ensemble",
    "Environment",
    "Helm",
    "Weather",
    "draw_environment",
    "euler_step",
    "initial_turn",
    "measure",
    "motion_rates",
    "pull_out",
    "relative_velocity",
    "rk4_step",
    "service_speed",
    "simulate",
    "simulate_ensemble",
    "simulate_many",
    "steady_ahead",
    "stopping",
    "to_body",
    "turning_circle",
    "zigzag",
]
