"""Runs: one by compiled steps, many at once with arrays; inputs are held between samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.errors import Diverged, InputError
from expdesign.signals import Commands, Trajectory
from expdesign.simulation.actuation import deliver, step_shares
from expdesign.simulation.environment import CALM, Environment, WeatherSeries, weather_rows
from expdesign.simulation.motion import begun, rk4_step
from expdesign.simulation.program import STATES, RatesProgram, march
from expdesign.simulation.rolling import rolled
from expdesign.values import Array
from expdesign.vessel import Vessel, VesselModel

SUBSTEPS = 2
"""Runge-Kutta steps per sample; a step is at most a fifth of the fastest time constant of the reference vessels."""
FEW_RUNS = 50
"""Up to so many runs are quicker one by one than by an operation on all of them at a time."""
LARGEST_SPEED = 1e3
"""Speeds [m/s, rad/s] beyond this mean that the model is unstable."""


def simulate(
    vessel: Vessel,
    commands: Commands,
    *,
    pose: Array | tuple[float, float, float] = (0.0, 0.0, 0.0),
    velocity: Array | tuple[float, float, float] = (0.0, 0.0, 0.0),
    environment: Environment | WeatherSeries = CALM,
    standing: Array | None = None,
    substeps: int = SUBSTEPS,
    integrator: str = "rk4",
) -> Trajectory:
    """Run the commands from a pose and a velocity over ground under an environment's means or a series of weather.

    Args:
        vessel: whose model is integrated.
        commands: k samples, held.
        pose, velocity: (3,) at the first sample.
        environment: its means act as steady n-frame current and wind; a series acts sample by sample.
        standing: (m,) commands that stood before the first sample, from which the actuators begin to move; None for
            those of the first sample. Without lag or dead time it means nothing.
        substeps: integrator steps per sample, at least: where late commands arrive within one, it is divided.
        integrator: "rk4", or "euler" for the map of the discrete parameters (with one substep).

    Raises:
        Diverged: a speed passed `LARGEST_SPEED`.
        InputError: commands of another vessel.
    """
    _check_inputs(vessel, commands)
    shares = (
        substeps
        if integrator == "euler"
        else step_shares(vessel.responses, sample_time_s=commands.sample_time_s, substeps=substeps)
    )
    given = deliver(
        vessel.responses,
        commands.values,
        sample_time_s=commands.sample_time_s,
        substeps=shares,
        standing=standing,
    )
    sea = np.concatenate(weather_rows(environment, len(commands)), axis=1)
    states = _integrated(
        vessel,
        given,
        np.array([*pose, *velocity]),
        sea=sea,
        sample_time_s=commands.sample_time_s,
        substeps=shares,
        integrator=integrator,
    )
    return Trajectory(
        sample_time_s=commands.sample_time_s,
        pose=states[:, :3],
        velocity=states[:, 3:STATES],
        auxiliary=rolled(vessel, states, commands, sea, standing=standing),
    )


def integrate_motion(
    vessel: Vessel,
    delivered: Array,
    start: Array,
    *,
    sea: Array,
    sample_time_s: float,
    substeps: int | Array = SUBSTEPS,
) -> Array:
    """`simulate` for delivered inputs: states (k + 1, 6), pose and velocity, the start first.

    Args:
        vessel: whose model is integrated.
        delivered: (k, substeps, m), or (k, 1, m) where inputs are held over a sample; as `deliver` gives them.
        start: (6,) pose and velocity over ground; a model with a roll mode begins upright.
        sea: (k, 4), or (1, 4) where steady: n-frame current and wind to north and east [m/s].
        sample_time_s: time between samples [s].
        substeps: steps per sample, or the shares of it that they take, for which inputs are delivered.

    Raises:
        Diverged: a speed passed `LARGEST_SPEED`.
    """
    states = _integrated(
        vessel, delivered, start, sea=sea, sample_time_s=sample_time_s, substeps=substeps, integrator="rk4"
    )
    return states[:, :STATES]


def _integrated(
    vessel: Vessel,
    delivered: Array,
    start: Array,
    *,
    sea: Array,
    sample_time_s: float,
    substeps: int | Array,
    integrator: str,
) -> Array:
    """`integrate_motion` with roll: (k + 1, 6 or 8)."""
    from expdesign.simulation._casadi import compiled_integrator  # CasADi is loaded when a motion is integrated

    states = compiled_integrator(vessel.model, integrator).states(
        np.array(begun(vessel.model, tuple(start))), delivered, sea=sea, sample_time_s=sample_time_s, substeps=substeps
    )
    settled = (np.abs(states[1:, 3:]) < LARGEST_SPEED).all(axis=1)
    if not settled.all():
        time_s = (int(np.argmin(settled)) + 1) * sample_time_s
        raise Diverged(
            f"vessel {vessel.name!r}: the simulation diverges after {time_s:.1f} s: "
            f"a speed passes {LARGEST_SPEED:g} m/s or rad/s; the model is unstable under these commands"
        )
    return states


def simulate_many(
    vessel: Vessel,
    commands: Commands | Array,
    *,
    pose: Array,
    velocity: Array,
    current_to: Array,
    wind_to: Array,
    parameters: Array,
    standing: Array | None = None,
    substeps: int = SUBSTEPS,
) -> Array:
    """Many runs at once: the same commands for n truths, or commands of their own for each.

    Args:
        vessel: gives structure and actuators.
        commands: k samples, held, for all runs alike; or (n, k, m) in the model's order.
        pose, velocity: (n, 3) start states.
        current_to, wind_to: n-frame velocities, (n, 2) when steady, or (k, n, 2) sample by sample.
        parameters: (n, p) in the model's own form.
        standing: commands that stood before the first sample, (m,) or with commands of their own (n, m); None for those
            of the first sample.
        substeps: Runge-Kutta steps per sample.

    Returns:
        (k + 1, n, 6) states; runs that diverge are nan instead of raising, for the caller to count.
    """
    if isinstance(commands, Commands):
        _check_inputs(vessel, commands)
        commanded, sample_time_s = commands.values[..., None], commands.sample_time_s
    else:
        commanded, sample_time_s = commands.transpose(1, 2, 0), vessel.sample_time_s
    before = None if standing is None else np.asarray(standing, dtype=float).T.reshape(commanded.shape[1], -1)
    shares = step_shares(vessel.responses, sample_time_s=sample_time_s, substeps=substeps)
    given = deliver(vessel.responses, commanded, sample_time_s=sample_time_s, substeps=shares, standing=before)
    weather = [np.broadcast_to(item, (len(commanded), len(pose), 2)) for item in (current_to, wind_to)]
    runs = _Runs(
        model=vessel.model,
        start=np.array(begun(vessel.model, (*pose.T, *velocity.T))),
        given=given,
        sea=np.concatenate(weather, axis=-1).swapaxes(1, 2),
        parameters=parameters,
        sample_time_s=sample_time_s,
        shares=shares,
    )
    result = runs.one_by_one() if len(pose) <= FEW_RUNS else runs.together()
    settled = np.abs(result[..., 3:]).max(axis=(0, 2)) < LARGEST_SPEED
    result[:, ~settled] = np.nan
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class _Runs:
    """Runs to be integrated.

    Attributes:
        model: their structure.
        start: (6 or 8, n) states.
        given: (k, s or 1, m, n or 1) delivered inputs.
        sea: (k, 4, n) current and wind.
        parameters: (n, p).
        sample_time_s: between samples.
        shares: (s,) of it that integrator steps take.
    """

    model: VesselModel
    start: Array
    given: Array
    sea: Array
    parameters: Array
    sample_time_s: float
    shares: Array

    def one_by_one(self) -> Array:
        """(k + 1, n, 6) states by compiled steps, the quicker way for few runs."""
        from expdesign.simulation._casadi import compiled_integrator  # CasADi is loaded when a motion is integrated

        compiled = compiled_integrator(self.model, "rk4")
        inputs = np.broadcast_to(self.given, (*self.given.shape[:3], len(self.parameters)))
        runs = [
            compiled.states(
                self.start[:, run],
                inputs[..., run],
                sea=self.sea[..., run],
                sample_time_s=self.sample_time_s,
                substeps=self.shares,
                parameters=theta,
            )
            for run, theta in enumerate(self.parameters)
        ]
        return np.stack(runs, axis=1)[..., :STATES]

    def together(self) -> Array:
        """The motion by operations on all runs at once."""
        program = RatesProgram(self.model, runs=len(self.parameters), parameters=self.parameters)
        result = np.empty((len(self.sea) + 1, len(self.parameters), STATES))
        steps_s = self.sample_time_s * self.shares
        states = march(program, self.given, self.start, step=rk4_step, step_s=steps_s, substeps=len(steps_s))
        with np.errstate(over="ignore", invalid="ignore"):
            for row, state, now in zip(result, states, (*self.sea, self.sea[-1:]), strict=True):
                row[...] = state[:STATES].T
                program.sea[...] = now
        return result


def _check_inputs(vessel: Vessel, commands: Commands) -> None:
    if commands.names != vessel.model.inputs:
        raise InputError(
            f"commands {', '.join(commands.names)} do not fit vessel {vessel.name!r}, "
            f"which takes {', '.join(vessel.model.inputs)}"
        )
