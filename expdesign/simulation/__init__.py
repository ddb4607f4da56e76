"""Simulation: equations of motion, integrators, environment and sensors."""

from expdesign.simulation.ensemble import Ensemble, Weather, simulate_ensemble
from expdesign.simulation.environment import CALM, Environment
from expdesign.simulation.motion import euler_step, motion_rates, relative_velocity, rk4_step, to_body
from expdesign.simulation.run import simulate, simulate_many
from expdesign.simulation.sensors import draw_environment, measure

__all__ = [
    "CALM",
    "Ensemble",
    "Environment",
    "Weather",
    "draw_environment",
    "euler_step",
    "measure",
    "motion_rates",
    "relative_velocity",
    "rk4_step",
    "simulate",
    "simulate_ensemble",
    "simulate_many",
    "to_body",
]
