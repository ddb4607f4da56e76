"""Sensors: measurements of a trajectory."""

from __future__ import annotations

from typing import Any

import numpy as np

from expdesign.conventions import rotated, wrap_angle
from expdesign.signals import AUXILIARY, Commands, Trajectory
from expdesign.simulation.environment import Environment, WeatherSeries, weather_rows
from expdesign.simulation.motion import to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Sensors, Vessel, column_name

ROWS = ("north", "east", "heading", "u", "v", "r", "wind_u", "wind_v")
"""Measured channels, in order; a vane's noise on speed and angle takes the places of wind_u and wind_v."""
OWNERS = {"position": (0, 1), "heading": (2,), "velocity": (3, 4), "yaw_rate": (5,), "wind": (6, 7)}
"""Sensor -> its rows."""


def noise_std(sensors: Sensors) -> Array:
    """(8,) standard deviations of the rows."""
    second = sensors.wind_angle_rad if sensors.wind_sensor == "vane" else sensors.wind_mps
    position, velocity = [sensors.position_m] * 2, [sensors.velocity_mps] * 2
    return np.array(
        [*position, sensors.heading_rad, *velocity, sensors.yaw_rate_radps, sensors.wind_mps, second], dtype=float
    )


def prompt(sensors: Sensors) -> bool:
    """Whether every sample is measured at its own time: no delays, no repeated readings."""
    return not any(any(sensors.timing(name)) for name in OWNERS)


def observe(sensors: Sensors, states: Array, air: Array, noise: Array, *, sample_time_s: float) -> None:
    """Measurements of a motion.

        position = north/east + R(heading) (forward, starboard)       heading = heading + bias
        u = u - r starboard     v = v + r forward     along axes turned from the ship's by an angle
        of u, v and r: gain * true + offset (`GAINS_AND_OFFSETS`)
        (u_q, v_q) likewise for the place and the axes of the wind sensor

    all late by each sensor's delay, held over its interval, plus noise; a vane's noise is on speed and angle, and
    (u_q, v_q) = V (cos angle, sin angle). Before the first sample all was as at the first sample.

    Args:
        sensors: noise, places, timing, faults.
        states: (k, 6, ...) pose, heading continuous, and velocity over ground at the samples.
        air: (k, 2, ...) velocity through air (u_q, v_q) of the origin at the samples.
        noise: (k, 8, ...) with the deviations of `noise_std`; becomes the measured rows.
        sample_time_s: time between samples [s].

    Source: F. Ljungberg, doctoral thesis, Linköping University, (5.39)-(5.50), with the angle counted clockwise from
    the bow; T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2011), (2.28) for lever arms.
    """
    for name, rows in OWNERS.items():
        time, origin = _readings(sensors.timing(name), len(states), sample_time_s)
        for row, signal in zip(rows, _SIGNALS[name](sensors, states, air), strict=True):
            if origin is not None:
                noise[:, row] = noise[origin, row]
            if name != "wind" or sensors.wind_sensor != "vane":
                noise[:, row] += _late(signal, time)
        if name == "wind" and sensors.wind_sensor == "vane":
            u_q, v_q = (_late(signal, time) for signal in _wind(sensors, states, air))
            noise[:, 6], noise[:, 7] = _vane(u_q, v_q, noise[:, 6], noise[:, 7])


def _position(sensors: Sensors, states: Array, air: Array) -> tuple[Array, ...]:
    forward, starboard = sensors.place("position")
    if not (forward or starboard):
        return states[:, 0], states[:, 1]
    c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
    return states[:, 0] + c * forward - s * starboard, states[:, 1] + s * forward + c * starboard


def _heading(sensors: Sensors, states: Array, air: Array) -> tuple[Array, ...]:
    return (states[:, 2] + sensors.heading_bias_rad,)


def _velocity(sensors: Sensors, states: Array, air: Array) -> tuple[Array, ...]:
    at_sensor = _moved(sensors.place("velocity"), states[:, 3], states[:, 4], states[:, 5])
    u, v = _along_axes(sensors.velocity_angle_rad, *at_sensor)
    return _shown(sensors, "u", u), _shown(sensors, "v", v)


def _yaw_rate(sensors: Sensors, states: Array, air: Array) -> tuple[Array, ...]:
    return (_shown(sensors, "r", states[:, 5]),)


def _shown(sensors: Sensors, signal: str, true: Array) -> Array:
    gain, offset = sensors.shown(signal)
    return true if (gain, offset) == (1.0, 0.0) else gain * true + offset


def _wind(sensors: Sensors, states: Array, air: Array) -> tuple[Array, ...]:
    return _along_axes(sensors.wind_axis_rad, *_moved(sensors.place("wind"), air[:, 0], air[:, 1], states[:, 5]))


_SIGNALS: dict[str, Any] = {
    "position": _position,
    "heading": _heading,
    "velocity": _velocity,
    "yaw_rate": _yaw_rate,
    "wind": _wind,
}


def _moved(place: tuple[float, float], u: Array, v: Array, r: Array) -> tuple[Array, Array]:
    """Velocity of a place on the ship, from that of the origin, in the b-frame."""
    forward, starboard = place
    return (u - r * starboard, v + r * forward) if forward or starboard else (u, v)


def _along_axes(angle_rad: float, u: Array, v: Array) -> tuple[Array, Array]:
    """Components along axes that are turned clockwise from the ship's by an angle."""
    if not angle_rad:
        return u, v
    return rotated((u, v), -angle_rad)


def _readings(timing: tuple[float, float], count: int, sample_time_s: float) -> tuple[Array | None, Any]:
    """Time of the reading shown at each sample [samples], and the sample that first showed it; None without delay."""
    now = np.arange(count, dtype=float)
    delay, interval = (time_s / sample_time_s for time_s in timing)
    if interval <= 1.0:
        return (np.maximum(now - delay, 0.0) if delay > 0 else None), None
    number = np.maximum(np.floor((now - delay) / interval + 1e-9), 0.0)
    _, first, place = np.unique(number, return_index=True, return_inverse=True)
    return number * interval, first[place]


def _late(signals: Array, time: Array | None) -> Array:
    """Signals (k, ...) at other times [samples], straight lines between samples."""
    if time is None:
        return signals
    before = np.minimum(time.astype(int), len(signals) - 1)
    after = np.minimum(before + 1, len(signals) - 1)
    share = (time - before).reshape(-1, *[1] * (signals.ndim - 1))
    return np.asarray((1.0 - share) * signals[before] + share * signals[after])


def _vane(u_q: Array, v_q: Array, speed_noise: Array, angle_noise: Array) -> tuple[Array, Array]:
    """Components as a vane's noisy speed and angle give them."""
    speed, angle = np.hypot(u_q, v_q) + speed_noise, np.arctan2(v_q, u_q) + angle_noise
    return speed * np.cos(angle), speed * np.sin(angle)


def measure(
    vessel: Vessel,
    commands: Commands,
    trajectory: Trajectory,
    *,
    environment: Environment | WeatherSeries,
    rng: np.random.Generator,
) -> dict[str, Array]:
    """Measured signals as the vessel's sensors measure them, named and in units as in measured-data files.

    Args:
        commands: k samples, recorded as they were given.
        trajectory: k + 1 samples; the last is left out, as no command follows it.
        environment: the actual current and wind, steady or sample by sample.

    Returns:
        Column name -> (k,). Wind is the relative wind in the b-frame, the air's velocity past the ship taken as
        (u_q, v_q) = velocity - wind. Ships that roll in radians have columns of roll and acceleration, too.
    """
    count = len(commands)
    states = np.concatenate([trajectory.pose[:count], trajectory.velocity[:count]], axis=1)
    _, wind = weather_rows(environment, count)
    u_w, v_w = to_body(wind.T, states[:, 2], NUMPY)
    air = np.stack([states[:, 3] - u_w, states[:, 4] - v_w], axis=1)
    readings = noise_std(vessel.sensors)[:, None] * rng.standard_normal((len(ROWS), count))
    observe(vessel.sensors, states, air, readings.T, sample_time_s=commands.sample_time_s)
    columns = {
        "time_s": trajectory.time_s[:count],
        "north_m": readings[0],
        "east_m": readings[1],
        "heading_rad": wrap_angle(readings[2]),
        "u_mps": readings[3],
        "v_mps": readings[4],
        "r_radps": readings[5],
        "wind_u_mps": readings[6],
        "wind_v_mps": readings[7],
    }
    inputs = {column_name(name): commands.column(name) for name in commands.names}
    return {**columns, **_auxiliary(vessel.sensors, trajectory, count, rng), **inputs}


def _auxiliary(sensors: Sensors, trajectory: Trajectory, count: int, rng: np.random.Generator) -> dict[str, Array]:
    """Roll and accelerations, where the simulation gives them; drawn last, so that other noise is as without them."""
    if trajectory.auxiliary is None:
        return {}
    given = np.isfinite(trajectory.auxiliary[0])
    values, noise = trajectory.auxiliary[:count, given], _auxiliary_std(sensors)[given]
    values = values + noise * rng.standard_normal(values.shape)
    return dict(zip(np.array(AUXILIARY)[given].tolist(), values.T, strict=True))


def _auxiliary_std(sensors: Sensors) -> Array:
    """(8,) standard deviations of `AUXILIARY`; forces of actuators have none."""
    noise = {"roll_rad": sensors.roll_rad, "roll_rate_radps": sensors.roll_rate_radps}
    return np.array([noise.get(name, sensors.acceleration_mps2 * name.endswith("_mps2")) for name in AUXILIARY])
