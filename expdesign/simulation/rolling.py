"""Roll in radians beside a simulated motion: as its roll mode gives it, or of a pendulum that the motion drives.

Between two samples the pendulum's drive, the moment of side acceleration, yaw rate and rudder, runs along a straight
line; the step of the linear system is then exact.

Source: K. J. Åström and B. Wittenmark, Computer-Controlled Systems (1997), 2.3 and 2.8, for the step.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from expdesign.signals import AUXILIARY, Commands, Trajectory
from expdesign.simulation.actuation import delivered_at_samples, positions
from expdesign.simulation.motion import motion_rates
from expdesign.simulation.program import STATES
from expdesign.values import Array
from expdesign.vessel import RollPendulum, Vessel


def rolled(
    vessel: Vessel, states: Array, commands: Commands, sea: Array, *, standing: Array | None = None
) -> Array | None:
    """(k + 1, 8) columns of `AUXILIARY`, nan where not given; None where the vessel has no roll in radians.

    Accelerations are those just after the inputs of a sample, of the last one's at the end. A pendulum begins upright.

    Args:
        vessel: whose roll is asked for.
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
    acting = positions(vessel.responses, values, sample_time_s=step_s, standing=standing).means
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
