"""Information of a manoeuvre at a load about roll parameters, as efficient instruments would use it.

The equation of roll, phi'' + alpha1 phi' + alpha2 phi - beta1 a_s - kappa1 r - gamma1 delta = e, has noise of the
sensors with the spectrum

    S(w) = |i w + alpha1 + alpha2 / (i w)|^2 s_p^2 + beta1^2 s_s^2 + kappa1^2 s_r^2

of gyro, accelerometer and yaw-rate gyro, and of the moment of the waves that the vessel file states, as met at the
manoeuvre's mean speed on any course. Weighted by it, the noise-free signals x (k, 5) give X = sum_w x* x / S, and
J^T X J with the derivatives J of the coefficients by the parameters. What the model misses comes on top.

Source: doctoral thesis on grey-box identification of ship roll with few sensors, (5.17)-(5.24); L. Ljung, System
Identification (1999), 15.3, for the covariance of the best instruments.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.errors import InputError, NotInformative
from expdesign.roll import TUNING, coefficients, named, sensed_inertia
from expdesign.signals import AUXILIARY, Trajectory
from expdesign.simulation import rudder_angle, simulate
from expdesign.values import Array
from expdesign.vessel import Load, RollPendulum, Vessel

RATE, ANGLE, READING = (AUXILIARY.index(name) for name in ("roll_rate_radps", "roll_rad", "imu_lateral_mps2"))


@dataclass(frozen=True, kw_only=True)
class LoadOption:
    """A load case that a trial may have."""

    name: str  # for reports
    load: Load | None  # on board; None for the one that is sought


def run_information(vessel: Vessel, theta: Array, option: LoadOption, primitives: Sequence[Primitive]) -> Array:
    """(q, 9, 9) information of one run of each manoeuvre at a load.

    Args:
        vessel: with a pendulum, and sensors with noise.
        theta: (9,) parameters, as believed; m and z_m of the unknown load among them.
        option: on board.
        primitives: manoeuvres, whose motion the load does not change.

    Raises:
        InputError: the sensors are without noise.
        NotInformative: there are too few samples in a period of roll, or the ship does not stay upright.
    """
    pendulum = _loaded(vessel, theta, option)
    _check(vessel, pendulum, option)
    ship = replace(vessel, pendulum=pendulum)
    found = coefficients(theta, pendulum.body, option.load)
    moments = np.array([_moments(ship, primitive, found.values) for primitive in primitives])
    return np.asarray(np.einsum("cp,qcd,de->qpe", found.jacobian, moments, found.jacobian))


def _loaded(vessel: Vessel, theta: Array, option: LoadOption) -> RollPendulum:
    assert vessel.pendulum is not None
    values = named(theta)
    load = Load(mass_kg=values["m"], z_m=values["z_m"]) if option.load is None else option.load
    own = {name: values[name] for name in vessel.pendulum.parameters}
    return replace(vessel.pendulum, load=load, parameters=own)


def _check(vessel: Vessel, pendulum: RollPendulum, option: LoadOption) -> None:
    sensors = vessel.sensors
    if not (sensors.roll_rate_radps > 0 and sensors.acceleration_mps2 > 0):
        raise InputError(
            f"vessel {vessel.name!r} has sensors without noise, expected sensors.roll_rate_radps and "
            "sensors.acceleration_mps2 above 0: they set the information of a run"
        )
    if not pendulum.righting_nm > 0:
        raise NotInformative(
            f"with {option.name} the ship does not stay upright: her metacentric height is "
            f"{pendulum.metacentric_height_m:.3g} m; leave this load out"
        )
    if pendulum.period_s / vessel.sample_time_s < TUNING.least_samples_per_period:
        raise NotInformative(
            f"roll has a period of {pendulum.period_s:.3g} s with {option.name} and vessel.sample_time_s is "
            f"{vessel.sample_time_s:g}, expected {TUNING.least_samples_per_period:g} samples or more in a period"
        )


def _moments(ship: Vessel, primitive: Primitive, values: Array) -> Array:
    """(5, 5) moments of one run."""
    commands = primitive.commands
    sailed = simulate(ship, commands, velocity=primitive.entry_velocity, standing=primitive.entry_inputs)
    assert sailed.auxiliary is not None
    rudder = rudder_angle(ship, commands, standing=primitive.entry_inputs)
    roll = sailed.auxiliary[:-1, [RATE, ANGLE, READING]]
    signals = np.column_stack([roll, -sailed.velocity[:-1, 2], -rudder])
    spectrum = np.fft.rfft(signals - signals.mean(axis=0), axis=0)[1:]
    frequency = np.asarray(2.0 * np.pi * np.fft.rfftfreq(len(signals), commands.sample_time_s)[1:], dtype=float)
    both = np.full(len(frequency), 2.0)  # positive and negative frequencies, but for the highest of an even number
    both[-1] = 1.0 if len(signals) % 2 == 0 else 2.0
    noise = _noise(ship, values, frequency) + _waves(ship, sailed, frequency)
    weight = both / noise / len(signals)
    return np.asarray(((spectrum.conj() * weight[:, None]).T @ spectrum).real)


def _noise(ship: Vessel, values: Array, frequency: Array) -> Array:
    """S(w) per sample."""
    alpha1, alpha2, beta, kappa, _ = values.tolist()
    of, w = ship.sensors, 1j * frequency
    rate = np.abs(w + alpha1 + alpha2 / w) ** 2 * of.roll_rate_radps**2
    return np.asarray(rate + (beta * of.acceleration_mps2) ** 2 + (kappa * of.yaw_rate_radps) ** 2)


def _waves(ship: Vessel, sailed: Trajectory, frequency: Array) -> Array:
    """(f,) per sample, of their moment over the inertia in the equation."""
    pendulum = ship.pendulum
    if pendulum is None or pendulum.waves is None:
        return np.zeros(len(frequency))
    speed = float(np.hypot(*sailed.velocity[:, :2].T).mean())
    of, body, load = pendulum.parameters, pendulum.body, pendulum.load
    inertia = sensed_inertia(of["A_x"], body, load, of["z_f"]) - of["K_vd"] * body.sensor(of["z_f"])
    slope = pendulum.waves.met_density(frequency, speed) * np.pi / sailed.sample_time_s
    return np.asarray((pendulum.righting_nm / inertia) ** 2 * slope)
