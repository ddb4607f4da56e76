"""Runs: one by compiled steps, many at once with arrays; inputs are held between samples.

Roll in radians stands beside a motion, as its roll mode gives it, or of a pendulum that the motion drives. Between two
samples the pendulum's drive, the moment of side acceleration, yaw rate and rudder, runs along a straight line; the step
of the linear system is then exact.

Source: K. J. Åström and B. Wittenmark, Computer-Controlled Systems (1997), 2.3 and 2.8, for the step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.errors import Diverged, InputError
from expdesign.signals import AUXILIARY, Commands, Trajectory
from expdesign.simulation.actuation import deliver, delivered_at_samples, positions, step_shares
from expdesign.simulation.environment import CALM, Environment, WeatherSeries, weather_rows
from expdesign.simulation.motion import begun, motion_rates, rk4_step
from expdesign.simulation.program import STATES, RatesProgram, march
from expdesign.values import Array
from expdesign.vessel import RollPendulum, Vessel, VesselModel

# Roll in radians beside a simulated motion: as its roll mode gives it, or of a pendulum that the motion drives.


def rolled(
    vessel: Vessel, states: Array, commands: Commands, sea: Array, *, standing: Array | None = None
) -> Array | None:
    """(k + 1, 8) columns of `AUXILIARY`, nan where not given; None where the vessel has no roll in radians.

    Accelerations are those just after the inputs of a sample, of the last one's at the end. A pendulum begins upright.

    Args:
        states: (k + 1, 6 or 8) at the samples.
        commands: k samples.
        sea: (k or 1, 4) n-frame current and wind.
        standing: (m,) commands before the first sample; None for those of the first sample.
    """
    mode, pendulum = vessel.model.roll, vessel.pendulum
    if pendulum is None and (mode is None or not mode.heel_rad_per_mps2):
        return None
    columns: dict[str, Array] = {}
    first, last = _at_ends(vessel, commands, standing)
    first = np.concatenate([first, last[-1:]])
    flow = np.broadcast_to(sea, (len(commands), 4))
    sway = _sway(vessel, states, first, np.concatenate([flow, flow[-1:]]))
    columns["sway_acceleration_mps2"] = sway
    columns["lateral_acceleration_mps2"] = side = sway + states[:, 3] * states[:, 5]
    if mode is not None:
        columns["roll_rad"], columns["roll_rate_radps"] = mode.heel_rad_per_mps2 * states[:, STATES:].T
    if pendulum is not None:
        end_side = _sway(vessel, states[1:], last, flow) + states[1:, 3] * states[1:, 5]
        begin = pendulum.acceleration(0.0, 0.0, side, states[:, 5], _mean_angle(commands.names, first))
        end = pendulum.acceleration(0.0, 0.0, end_side, states[1:, 5], _mean_angle(commands.names, last))
        roll, rate = _followed(pendulum, begin, end, commands.sample_time_s)
        columns["roll_rad"], columns["roll_rate_radps"] = roll, rate
        spin = begin + pendulum.acceleration(roll, rate, 0.0, 0.0, 0.0)
        columns["imu_lateral_mps2"] = -pendulum.reading(roll, spin, side)
    return np.column_stack([columns.get(name, np.full(len(states), np.nan)) for name in AUXILIARY])


def in_waves(vessel: Vessel, sailed: Trajectory, rng: np.random.Generator) -> Trajectory:
    """The motion with the roll that drawn waves add, upright at first; unchanged where the vessel file states none.

    Roll is linear, so that theirs comes on top. Their moment is the righting moment by their slope.
    """
    pendulum = vessel.pendulum
    if pendulum is None or pendulum.waves is None or sailed.auxiliary is None:
        return sailed
    slope = pendulum.waves.slope(sailed.pose, sailed.sample_time_s, rng)
    drive = pendulum.acceleration(slope, 0.0, 0.0, 0.0, 0.0)
    roll, rate = _followed(pendulum, drive, drive[1:], sailed.sample_time_s)
    spin = drive + pendulum.acceleration(roll, rate, 0.0, 0.0, 0.0)
    added = {"roll_rad": roll, "roll_rate_radps": rate, "imu_lateral_mps2": -pendulum.reading(roll, spin, 0.0)}
    columns = [sailed.auxiliary[:, place] + added.get(name, 0.0) for place, name in enumerate(AUXILIARY)]
    return replace(sailed, auxiliary=np.column_stack(columns))


def _at_ends(vessel: Vessel, commands: Commands, standing: Array | None) -> tuple[Array, Array]:
    """Delivered inputs (k, m) at the begin and at the end of every sample; held ones are the command at both."""
    values, step_s = commands.values, commands.sample_time_s
    exact = delivered_at_samples(vessel.responses, values, sample_time_s=step_s, standing=standing)
    acting, _ = positions(vessel.responses, values, sample_time_s=step_s, standing=standing)
    held = np.array([response.follows for response in vessel.responses]) & (acting == values)
    return np.where(held, values, exact[:-1]), np.where(held, values, exact[1:])


def rudder_angle(vessel: Vessel, commands: Commands, *, standing: Array | None = None) -> Array:
    """(k,) mean angle of what steers at the samples, as the actuators deliver it [rad]; zero where nothing steers."""
    return _mean_angle(commands.names, _at_ends(vessel, commands, standing)[0])


def steering_signals(names: tuple[str, ...]) -> tuple[str, ...]:
    """Signals whose mean steers: all rudders, or without rudders all azimuths; none where there are neither."""
    found = (tuple(name for name in names if name.rstrip("0123456789") == kind) for kind in ("rudder", "a"))
    return next(filter(None, found), ())


def _mean_angle(names: tuple[str, ...], inputs: Array) -> Array:
    chosen = [names.index(name) for name in steering_signals(names)]
    return np.asarray(inputs[:, chosen].mean(axis=1)) if chosen else np.zeros(len(inputs))


def _sway(vessel: Vessel, states: Array, inputs: Array, sea: Array) -> Array:
    """dv/dt (k,) [m/s2]."""
    state, drive, weather = (tuple(np.moveaxis(x, -1, 0)) for x in (states, inputs, sea))
    rates = motion_rates(vessel.model, state, drive, current_to=weather[:2], wind_to=weather[2:])
    return np.asarray(rates[4] + np.zeros(len(states)))


def _followed(pendulum: RollPendulum, begin: Array, end: Array, step_s: float) -> Array:
    """(2, k + 1) roll and its rate from the drive [rad/s2] at the begin (k + 1,) and end (k,) of every step."""
    lean = [pendulum.acceleration(1.0, 0.0, 0.0, 0.0, 0.0), pendulum.acceleration(0.0, 1.0, 0.0, 0.0, 0.0)]
    system = np.zeros((4, 4))  # roll, its rate, the drive, and the drive's change in a step
    system[0, 1], system[1, :2], system[1, 2], system[2, 3] = 1.0, lean, 1.0, 1.0 / step_s
    step = scipy.linalg.expm(system * step_s)[:2]
    pushed = np.outer(begin[:-1], step[:, 2]) + np.outer(end - begin[:-1], step[:, 3])
    result = np.zeros((len(begin), 2))
    for k, push in enumerate(pushed):
        result[k + 1] = step[:, :2] @ result[k] + push
    return result.T


SUBSTEPS = 2
"""Runge-Kutta steps per sample; a step is at most a fifth of the fastest time constant of the reference vessels."""
FEW_RUNS = 50  # up to so many runs are quicker one by one than by an operation on all of them at a time
LARGEST_SPEED = 1e3  # speeds [m/s, rad/s] beyond this mean that the model is unstable


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
    """Runs to be integrated."""

    model: VesselModel  # their structure
    start: Array  # (6 or 8, n) states
    given: Array  # (k, s or 1, m, n or 1) delivered inputs
    sea: Array  # (k, 4, n) current and wind
    parameters: Array  # (n, p)
    sample_time_s: float  # between samples
    shares: Array  # (s,) of it that integrator steps take

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
