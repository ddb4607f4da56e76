"""Roll in radians beside a simulated motion: as its roll mode gives it, or of a pendulum that the motion drives.

Between two samples the pendulum's drive, the moment of side acceleration, yaw rate and rudder, runs along a straight
line; the step of the linear system is then exact.

Source: K. J. Åström and B. Wittenmark, Computer-Controlled Systems (1997), 2.3 and 2.8, for the step.
"""

from __future__ import annotations

import numpy as np
import scipy

from expdesign.signals import AUXILIARY
from expdesign.simulation.motion import motion_rates
from expdesign.simulation.program import STATES
from expdesign.values import Array
from expdesign.vessel import RollPendulum, Vessel


def rolled(vessel: Vessel, states: Array, given: Array, sea: Array, step_s: float) -> Array | None:
    """(k + 1, 8) of `AUXILIARY`, nan where not given; None where the vessel has no roll in radians.

    Accelerations are those just after the inputs of a sample, of the last one's at the end. A pendulum begins upright.

    Args:
        vessel: whose roll is asked for.
        states: (k + 1, 6 or 8) at the samples.
        given: (k, substeps or 1, m) delivered inputs.
        sea: (k or 1, 4) n-frame current and wind.
        step_s: time between samples [s].
    """
    mode, pendulum = vessel.model.roll, vessel.pendulum
    if pendulum is None and (mode is None or not mode.heel_rad_per_mps2):
        return None
    told: dict[str, Array] = {}
    held, last = _held(given[:, 0]), given[:, -1]
    sway = _sway(vessel, states, held, _held(np.broadcast_to(sea, (len(given), 4))))
    told["sway_acceleration_mps2"] = sway
    told["lateral_acceleration_mps2"] = side = sway + states[:, 3] * states[:, 5]
    if mode is not None:
        told["roll_rad"], told["roll_rate_radps"] = mode.heel_rad_per_mps2 * states[:, STATES:].T
    if pendulum is not None:
        end = _sway(vessel, states[1:], last, sea) + states[1:, 3] * states[1:, 5]
        begin, end = (
            pendulum.acceleration(0.0, 0.0, push, states[rows, 5], _rudder(vessel, orders))
            for push, rows, orders in ((side, slice(None), held), (end, slice(1, None), last))
        )
        told["roll_rad"], told["roll_rate_radps"] = roll, rate = _followed(pendulum, begin, end, step_s)
        spin = begin + pendulum.acceleration(roll, rate, 0.0, 0.0, 0.0)
        told["imu_lateral_mps2"] = -pendulum.reading(roll, spin, side)
    return np.column_stack([told.get(name, np.full(len(states), np.nan)) for name in AUXILIARY])


def _held(rows: Array) -> Array:
    return np.concatenate([rows, rows[-1:]])


def _sway(vessel: Vessel, states: Array, inputs: Array, sea: Array) -> Array:
    """dv/dt (k,) [m/s2]."""
    flow = np.broadcast_to(sea, (len(states), 4))
    state, drive, weather = (tuple(np.moveaxis(x, -1, 0)) for x in (states, inputs, flow))
    rates = motion_rates(vessel.model, state, drive, current_to=weather[:2], wind_to=weather[2:])
    return np.asarray(rates[4] + np.zeros(len(states)))


def _rudder(vessel: Vessel, inputs: Array) -> Array:
    """(k,) mean angle of all rudders, or of all azimuths [rad]; zero for a ship that has neither."""
    chosen = [vessel.model.inputs.index(name) for name in steering_signals(vessel.model.inputs)]
    return np.asarray(inputs[:, chosen].mean(axis=1)) if chosen else np.zeros(len(inputs))


def steering_signals(names: tuple[str, ...]) -> tuple[str, ...]:
    """Signals whose mean steers: all rudders, or without rudders all azimuths; none where there are neither."""
    found = (tuple(name for name in names if name.rstrip("0123456789") == kind) for kind in ("rudder", "a"))
    return next(filter(None, found), ())


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
