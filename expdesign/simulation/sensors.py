"""Sensors: what a trial would record of a trajectory."""

from __future__ import annotations

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.signals import Commands, Trajectory
from expdesign.simulation.environment import Environment
from expdesign.simulation.motion import to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel, column_name


def draw_environment(forecast: Environment, rng: np.random.Generator) -> Environment:
    """One trial's steady current and wind, drawn around the forecast."""
    return Environment(
        current_to=forecast.current_to + forecast.current_std_mps * rng.standard_normal(2),
        wind_to=forecast.wind_to + forecast.wind_std_mps * rng.standard_normal(2),
    )


def measure(
    vessel: Vessel, commands: Commands, trajectory: Trajectory, *, environment: Environment, rng: np.random.Generator
) -> dict[str, Array]:
    """Measured signals with the vessel's white sensor noise, named and in units as in measured-data files.

    Args:
        vessel: whose sensors measure.
        commands: k samples, recorded without noise.
        trajectory: k + 1 samples; the last is left out, as no command follows it.
        environment: the actual current and wind.
        rng: noise.

    Returns:
        Column name -> (k,). Wind is the relative wind in the b-frame, the air's velocity past the ship taken as
        (u_q, v_q) = velocity - wind.
    """
    count, noise = len(commands), vessel.sensors
    pose, velocity = trajectory.pose[:count], trajectory.velocity[:count]

    def noisy(values: Array, std: float) -> Array:
        return np.asarray(values + std * rng.standard_normal(len(values)))

    u_w, v_w = to_body(environment.wind_to, pose[:, 2], NUMPY)
    columns = {
        "time_s": trajectory.time_s[:count],
        "north_m": noisy(pose[:, 0], noise.position_m),
        "east_m": noisy(pose[:, 1], noise.position_m),
        "heading_rad": wrap_angle(noisy(pose[:, 2], noise.heading_rad)),
        "u_mps": noisy(velocity[:, 0], noise.velocity_mps),
        "v_mps": noisy(velocity[:, 1], noise.velocity_mps),
        "r_radps": noisy(velocity[:, 2], noise.yaw_rate_radps),
        "wind_u_mps": noisy(velocity[:, 0] - u_w, noise.wind_mps),
        "wind_v_mps": noisy(velocity[:, 1] - v_w, noise.wind_mps),
    }
    inputs = {column_name(name): commands.column(name) for name in commands.names}
    return {**columns, **inputs}
