"""Many simulated trials at once, with current, wind and sensor noise: for Monte Carlo studies.

Every run has its own current and wind, varying around a mean of its own in the n-frame, its own sensor noise, and
commands and parameters of its own where given. Arrays are (samples, runs, ...). Noise is drawn a stretch of samples at
a time, so memory is that of the result.

Source: F. Ljungberg, doctoral thesis, Linköping University, (3.18), (5.3), (5.61), (6.1)-(6.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from expdesign.errors import InputError, ShapeError
from expdesign.signals import Batch
from expdesign.simulation.actuation import deliver, step_shares, step_times
from expdesign.simulation.environment import Environment, vary
from expdesign.simulation.motion import begun, integrator_step, turns_current
from expdesign.simulation.program import STATES, RatesProgram, march
from expdesign.simulation.sensors import ROWS, noise_std, observe, prompt
from expdesign.values import Array
from expdesign.vessel import Vessel

STRETCH = 32  # samples for which noise is drawn at once


@dataclass(frozen=True, kw_only=True, eq=False)
class Ensemble:
    """Simulated and measured trials."""

    sample_time_s: float  # time between samples [s]
    input_names: tuple[str, ...]  # actuator signals
    inputs: Array  # (k, n, m) commands; n is 1 when all runs share them
    # pose, velocity: (k, n, 3) true n-frame pose and b-frame velocity over ground. Runs that diverge end in nan.
    pose: Array
    velocity: Array
    # measured_pose, measured_velocity: (k, n, 3) with sensor noise
    measured_pose: Array
    measured_velocity: Array
    measured_wind: Array  # (k, n, 2) relative wind (u_q, v_q) with sensor noise

    def __post_init__(self) -> None:
        for name in ("inputs", "pose", "velocity", "measured_pose", "measured_velocity", "measured_wind"):
            getattr(self, name).setflags(write=False)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return int(self.velocity.shape[1])

    def batch(self, run: int) -> Batch:
        """Measurements of one run."""
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
    environment: Environment,
    rng: np.random.Generator,
    pose: Array | tuple[float, ...] = (0.0, 0.0, 0.0),
    velocity: Array | tuple[float, ...] = (0.0, 0.0, 0.0),
    parameters: Array | None = None,
    standing: Array | None = None,
    weather: Array | None = None,
    integrator: str = "euler",
    substeps: int = 1,
) -> Ensemble:
    """Simulate and measure many trials.

    Args:
        inputs: (k, runs, m) commands in the model's order, or (k, m) for all runs alike.
        environment: forecast; every run draws its own means around it, where they are not given, and its own
            variation.
        pose, velocity: start, (3,) or (runs, 3).
        parameters: (runs, p) in the model's own form, or None for the model's.
        standing: (m,) commands that stood before the first sample; None for those of the first sample.
        weather: (4, runs) mean current and wind of each run to north and east [m/s], as by `mean_weather`.
        integrator: "euler", the map of discrete parameters (with one substep), or "rk4".
        substeps: integrator steps per sample; current and wind are held over a sample.

    Raises:
        ShapeError: inputs that do not fit.
        UnknownName: no such integrator.
        InputError: Euler's map for a model that rolls.
    """
    step = integrator_step(integrator, vessel.model)
    commands = _commands(vessel, inputs, runs)
    standing = None if standing is None else np.asarray(standing, dtype=float).reshape(commands.shape[2], 1)
    program = RatesProgram(vessel.model, runs=runs, parameters=parameters, turning=turns_current(integrator))
    shares: int | Array = substeps
    if integrator == "rk4":
        shares = step_shares(vessel.responses, sample_time_s=vessel.sample_time_s, substeps=substeps)
    given = deliver(
        vessel.responses,
        commands.swapaxes(1, 2),
        sample_time_s=vessel.sample_time_s,
        substeps=shares,
        standing=standing,
    )
    steps_s = step_times(shares, vessel.sample_time_s)
    marching = partial(march, program, step=step, step_s=steps_s, substeps=len(steps_s))
    means = mean_weather(environment, runs, rng) if weather is None else weather
    draw = partial(_stretches, vessel, environment, means, rng=rng)
    states, seen = _sailed(vessel, program, given, _start(vessel, pose, velocity, runs), marching=marching, draw=draw)
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


def _sailed(
    vessel: Vessel,
    program: RatesProgram,
    given: Array,
    state: Array,
    *,
    marching: Callable[[Array, Array], Iterator[Array]],
    draw: Callable[[Array], Iterator[tuple[slice, Array]]],
) -> tuple[Array, Array]:
    """States (k, 6, n) at the samples and their measurements (k, 8, n).

    Sensors without delay measure each stretch as it is simulated, delayed ones after the last sample.
    """
    samples, runs = len(given), state.shape[1]
    states, seen = np.empty((samples, STATES, runs)), np.empty((samples, len(ROWS), runs))
    late = not prompt(vessel.sensors)
    air = np.empty((samples if late else STRETCH, 2, runs))
    with np.errstate(over="ignore", invalid="ignore"):
        for part, sea in draw(seen):
            stops = marching(given[part], state)
            winds = air[part] if late else air[: len(sea)]
            for row, wind, now in zip(states[part], winds, sea, strict=True):
                row[...], program.sea[...], program.air = next(stops)[:STATES], now, wind
            state = next(stops)
            if not late:
                observe(vessel.sensors, states[part], winds, seen[part], sample_time_s=vessel.sample_time_s)
        if late:
            observe(vessel.sensors, states, air, seen, sample_time_s=vessel.sample_time_s)
    return states, seen


def _commands(vessel: Vessel, inputs: Array, runs: int) -> Array:
    """(k, runs or 1, m)."""
    commands = np.array(inputs if inputs.ndim == 3 else inputs[:, None, :], dtype=float)
    count = len(vessel.model.inputs)
    if commands.ndim != 3 or commands.shape[1] not in (1, runs) or commands.shape[2] != count:
        raise ShapeError(f"inputs have shape {inputs.shape}, expected (k, {runs}, {count}) or (k, {count})")
    if runs < 1:
        raise InputError(f"runs is {runs}, expected 1 or more")
    return commands


def _start(vessel: Vessel, pose: Any, velocity: Any, runs: int) -> Array:
    """(6 or 8, n)."""
    parts = [np.broadcast_to(np.asarray(start, dtype=float), (runs, 3)).T for start in (pose, velocity)]
    return np.array(begun(vessel.model, tuple(np.concatenate(parts))))


def _stretches(
    vessel: Vessel, environment: Environment, mean: Array, noise: Array, *, rng: np.random.Generator
) -> Iterator[tuple[slice, Array]]:
    """Stretch after stretch of samples with its sea (k, 4, n); fills in the sensor noise (all samples, 8, n).

    A thread draws the numbers of the next stretch meanwhile; only it uses the generator, in order.
    """
    samples = len(noise)
    spread = noise_std(vessel.sensors)
    parts = [slice(first, min(first + STRETCH, samples)) for first in range(0, samples, STRETCH)]
    variations = (environment.current_variation, environment.wind_variation)
    before: list[Array | None] = [None, None]
    draw = partial(_drawn, rng, spread, noise)
    with ThreadPoolExecutor(1) as thread:
        waiting = thread.submit(draw, slice(0, min(STRETCH, samples)))
        for part, later in zip(parts, [*parts[1:], slice(0, 0)], strict=True):
            sea, waiting = waiting.result(), thread.submit(draw, later)
            for index, variation in enumerate(variations):
                both = sea[:, 2 * index : 2 * index + 2]
                both[...] = vary(variation, both, sample_time_s=vessel.sample_time_s, before=before[index])
                before[index] = both[-1].copy()
            sea += mean
            yield part, sea


def _drawn(rng: np.random.Generator, spread: Array, noise: Array, part: slice) -> Array:
    """Standard normal numbers (k, 4, n) for the sea of a stretch; its sensor noise is filled in."""
    part_noise = noise[part]
    count, rows, runs = part_noise.shape
    drawn = rng.standard_normal((count, 4 + rows, runs))
    np.multiply(drawn[:, 4:], spread[:, None], out=part_noise)
    return drawn[:, :4]


def mean_weather(environment: Environment, runs: int, rng: np.random.Generator) -> Array:
    """(4, runs) mean current and wind of each run to north and east [m/s], drawn around a forecast."""
    mean = np.concatenate([environment.current_to, environment.wind_to])[:, None]
    spread = np.repeat([environment.current_std_mps, environment.wind_std_mps], 2)[:, None]
    return mean + spread * rng.standard_normal((4, runs)) if spread.any() else np.tile(mean, runs)
