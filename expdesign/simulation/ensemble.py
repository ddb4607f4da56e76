"""Many simulated trials at once, with everything that disturbs a real one: for Monte Carlo studies.

Every run has its own current and wind, white from sample to sample around a mean in the n-frame, its own sensor noise,
and, if wished, its own commands and parameters. Arrays are (samples, runs, ...). Noise is drawn a stretch of samples at
a time, so memory is that of the result.

Source: F. Ljungberg, doctoral thesis, Linköping University, (3.18), (5.3), (5.61), (6.1)-(6.2).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from expdesign.errors import InputError, ShapeError, UnknownName
from expdesign.signals import Batch
from expdesign.simulation.motion import State, euler_step, motion_rates, rk4_step, to_body
from expdesign.values import Array, readonly, seal
from expdesign.vessel import NUMPY, Vessel

STEPS = {"euler": euler_step, "rk4": rk4_step}
STRETCH = 250
"""Samples for which noise is drawn at once."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Weather:
    """Current and wind of a trial: means in the n-frame and white variation from sample to sample.

    Attributes:
        current_to, wind_to: (2,) means, velocity to north/east [m/s].
        current_std_mps, wind_std_mps: standard deviation of each component from sample to sample [m/s].
    """

    current_to: Array = field(default_factory=lambda: np.zeros(2))
    wind_to: Array = field(default_factory=lambda: np.zeros(2))
    current_std_mps: float = 0.0
    wind_std_mps: float = 0.0

    def __post_init__(self) -> None:
        seal(self, current_to="2", wind_to="2")


@dataclass(frozen=True, kw_only=True, eq=False)
class Ensemble:
    """Simulated and measured trials.

    Attributes:
        sample_time_s: time between samples [s].
        input_names: actuator signals.
        inputs: (k, n, m) commands; n is 1 when all runs share them.
        pose, velocity: (k, n, 3) what happened: n-frame pose, b-frame velocity over ground. Runs whose speeds leave
            what numbers can hold end in nan.
        measured_pose, measured_velocity: (k, n, 3) with sensor noise.
        measured_wind: (k, n, 2) relative wind (u_q, v_q) with sensor noise.
    """

    sample_time_s: float
    input_names: tuple[str, ...]
    inputs: Array
    pose: Array
    velocity: Array
    measured_pose: Array
    measured_velocity: Array
    measured_wind: Array

    def __post_init__(self) -> None:
        for name in ("inputs", "pose", "velocity", "measured_pose", "measured_velocity", "measured_wind"):
            getattr(self, name).setflags(write=False)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return int(self.velocity.shape[1])

    def batch(self, run: int) -> Batch:
        """What was measured in one run."""
        return Batch(
            name=f"run {run}",
            sample_time_s=self.sample_time_s,
            input_names=self.input_names,
            inputs=self.inputs[:, run % self.inputs.shape[1]],
            velocity=self.measured_velocity[:, run],
            pose=self.measured_pose[:, run],
            wind=self.measured_wind[:, run],
        )


def simulate_ensemble(
    vessel: Vessel,
    inputs: Array,
    *,
    runs: int,
    weather: Weather,
    rng: np.random.Generator,
    pose: Array | tuple[float, ...] = (0.0, 0.0, 0.0),
    velocity: Array | tuple[float, ...] = (0.0, 0.0, 0.0),
    parameters: Array | None = None,
    integrator: str = "euler",
    substeps: int = 1,
) -> Ensemble:
    """Simulate and measure many trials.

    Args:
        vessel: model, sample time and sensors.
        inputs: (k, runs, m) commands in the model's order, or (k, m) for all runs alike.
        runs: number of runs.
        weather: means and variation of current and wind.
        rng: all chance.
        pose, velocity: start, (3,) or (runs, 3).
        parameters: (runs, p) in the model's own form, or None for the model's.
        integrator: "euler", the map of discrete parameters (with one substep), or "rk4".
        substeps: integrator steps per sample; current and wind are held over a sample.

    Raises:
        ShapeError: inputs that do not fit.
        UnknownName: no such integrator.
    """
    if integrator not in STEPS:
        raise UnknownName("integrator", integrator, known=STEPS)
    commands = _commands(vessel, inputs, runs)
    theta: Any = vessel.model.parameters if parameters is None else readonly(parameters).T
    samples = len(commands)
    states = np.empty((samples, 6, runs))
    seen = np.empty((samples, 8, runs))
    state = _start(pose, velocity, runs)
    step_s = vessel.sample_time_s / substeps
    with np.errstate(over="ignore", invalid="ignore"):
        for k, current, wind, noise in _chances(vessel, weather, samples, runs, rng):
            states[k] = state
            u_w, v_w = to_body(wind, state[2], NUMPY)
            seen[k, :6] = state
            seen[k, 6], seen[k, 7] = state[3] - u_w, state[4] - v_w
            seen[k] += noise
            held = tuple(commands[k].T)

            def rates(x: State, held: Any = held, current: Array = current, wind: Array = wind) -> State:
                return motion_rates(
                    vessel.model, x, held, current_to=current, wind_to=wind, ops=NUMPY, parameters=theta
                )

            for _ in range(substeps):
                state = STEPS[integrator](rates, state, step_s)
    return Ensemble(
        sample_time_s=vessel.sample_time_s,
        input_names=vessel.model.inputs,
        inputs=commands,
        pose=states[:, :3].swapaxes(1, 2),
        velocity=states[:, 3:].swapaxes(1, 2),
        measured_pose=seen[:, :3].swapaxes(1, 2),
        measured_velocity=seen[:, 3:6].swapaxes(1, 2),
        measured_wind=seen[:, 6:].swapaxes(1, 2),
    )


def _commands(vessel: Vessel, inputs: Array, runs: int) -> Array:
    """(k, runs or 1, m)."""
    commands = np.array(inputs if inputs.ndim == 3 else inputs[:, None, :], dtype=float)
    count = len(vessel.model.inputs)
    if commands.ndim != 3 or commands.shape[1] not in (1, runs) or commands.shape[2] != count:
        raise ShapeError(f"inputs have shape {inputs.shape}, expected (k, {runs}, {count}) or (k, {count})")
    if runs < 1:
        raise InputError(f"runs is {runs}, expected 1 or more")
    return commands


def _start(pose: Any, velocity: Any, runs: int) -> State:
    columns = [np.broadcast_to(np.asarray(start, dtype=float), (runs, 3)).T for start in (pose, velocity)]
    return tuple(row.copy() for rows in columns for row in rows)


def _chances(
    vessel: Vessel, weather: Weather, samples: int, runs: int, rng: np.random.Generator
) -> Iterator[tuple[int, Array, Array, Array]]:
    """(sample, current (2, n), wind (2, n), sensor noise (8, n)) of every sample."""
    s = vessel.sensors
    spread = np.array(
        [weather.current_std_mps] * 2
        + [weather.wind_std_mps] * 2
        + [s.position_m] * 2
        + [s.heading_rad]
        + [s.velocity_mps] * 2
        + [s.yaw_rate_radps]
        + [s.wind_mps] * 2
    )
    mean = np.concatenate([weather.current_to, weather.wind_to, np.zeros(8)])
    for first in range(0, samples, STRETCH):
        count = min(STRETCH, samples - first)
        drawn = rng.standard_normal((count, 12, runs))
        drawn *= spread[:, None]
        drawn += mean[:, None]
        for row in range(count):
            yield first + row, drawn[row, :2], drawn[row, 2:4], drawn[row, 4:]
