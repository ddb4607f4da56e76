"""Simulation: equations of motion, integrators, environment and sensors."""

from expdesign.simulation.environment import CALM, Environment
from expdesign.simulation.motion import euler_step, motion_rates, relative_velocity, rk4_step, to_body
from expdesign.simulation.run import simulate, simulate_many
from expdesign.simulation.sensors import draw_environment, measure

__all__ = [
    "CALM",
    "Environment",
    "draw_environment",
    "euler_step",
    "measure",
    "motion_rates",
    "relative_velocity",
    "rk4_step",
    "simulate",
    "simulate_many",
    "to_body",
]
