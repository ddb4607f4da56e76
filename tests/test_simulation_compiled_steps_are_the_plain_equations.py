"""Compiled steps are the plain equations of motion in floats; the same functions serve all lengths and parameters."""

from dataclasses import replace

import numpy as np
import pytest

from design_case import SCENARIOS, vessel
from expdesign.signals import Commands
from expdesign.simulation import (
    CALM,
    Environment,
    WeatherSeries,
    deliver,
    euler_step,
    integrate_motion,
    motion_rates,
    rk4_step,
    simulate,
    step_shares,
)
from expdesign.simulation._casadi import compiled_steps
from expdesign.simulation.motion import begun
from expdesign.vessel import SCALAR, Response, Roll, Vessel

SHIPS = sorted(path.stem for path in (SCENARIOS / "vessels").glob("*.toml"))
SEA = Environment(current_to=np.array([0.3, -0.2]), wind_to=np.array([-4.0, 6.0]))
START = np.array([3.0, -2.0, 0.7, 0.4, 0.05, 0.01])
SAMPLES = 45
SLOW = Response(lag_s=3.0, delay_s=1.5, deadband=0.1, offset=0.02)


def slow(ship: Vessel) -> Vessel:
    """The same with a lag, a dead time, a dead band and a misalignment in every actuator."""
    actuators = tuple(replace(one, responses=(SLOW,) * len(one.limits)) for one in ship.actuators)
    return replace(ship, model=replace(ship.model, actuators=actuators))


def rolling(ship: Vessel) -> Vessel:
    """The same with a roll mode, in place of a pendulum."""
    roll = Roll(period_s=9.0, damping_ratio=0.05, Y_phi=0.1, N_phi=0.001)
    return replace(ship, model=replace(ship.model, roll=roll), pendulum=None)


def commands_of(ship: Vessel, samples: int = SAMPLES) -> Commands:
    """Moderate commands within the limits, changing from sample to sample."""
    rng = np.random.default_rng(2)
    lows, highs = (np.array([getattr(limit, end) for limit in ship.limits]) for end in ("low", "high"))
    reach = np.where(np.isfinite(highs), highs, 1.0), np.where(np.isfinite(lows), lows, -1.0)
    values = 0.4 * rng.uniform(reach[1], reach[0], (samples, len(lows)))
    return Commands(sample_time_s=ship.sample_time_s, names=ship.model.inputs, values=values)


def plain(ship: Vessel, commands: Commands, weather: np.ndarray, *, integrator: str, substeps: int) -> np.ndarray:
    """(k + 1, 6) states in plain floats, weather (k, 4)."""
    step_s, shares = commands.sample_time_s, np.full(substeps, 1 / substeps)
    if integrator == "rk4":
        shares = step_shares(ship.responses, sample_time_s=step_s, substeps=substeps)
    given = deliver(ship.responses, commands.values, sample_time_s=step_s, substeps=shares)
    given = np.broadcast_to(given, (len(commands), len(shares), given.shape[-1]))
    step, theta = {"rk4": rk4_step, "euler": euler_step}[integrator], ship.model.parameters.tolist()
    state = begun(ship.model, tuple(START.tolist()))
    states = [state]
    for rows, sea in zip(given.tolist(), weather.tolist(), strict=True):
        for held, share in zip(rows, shares.tolist(), strict=True):

            def rates(x: tuple[float, ...], held: list[float] = held, sea: list[float] = sea) -> tuple[float, ...]:
                return motion_rates(
                    ship.model,
                    x,
                    held,
                    current_to=sea[:2],
                    wind_to=sea[2:],
                    ops=SCALAR,
                    parameters=theta,
                    turning=integrator == "rk4",
                )

            state = step(rates, state, share * step_s)
        states.append(state)
    return np.array(states)[:, :6]


def agree(
    ship: Vessel, environment: Environment | WeatherSeries, *, integrator: str = "rk4", substeps: int = 2
) -> None:
    """The motions are equal to rounding, and move."""
    commands = commands_of(ship)
    if isinstance(environment, WeatherSeries):
        weather = np.hstack([environment.current_to, environment.wind_to])
    else:
        weather = np.tile(np.r_[environment.current_to, environment.wind_to], (SAMPLES, 1))
    expected = plain(ship, commands, weather, integrator=integrator, substeps=substeps)
    track = simulate(
        ship,
        commands,
        pose=START[:3],
        velocity=START[3:],
        environment=environment,
        integrator=integrator,
        substeps=substeps,
    )
    assert np.ptp(expected[:, :3], axis=0).min() > 0.001  # some ships have short samples
    np.testing.assert_allclose(np.hstack([track.pose, track.velocity]), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", SHIPS)
@pytest.mark.parametrize(("integrator", "substeps"), [("rk4", 2), ("rk4", 20), ("euler", 1), ("euler", 3)])
def test_every_ship_sails_by_the_plain_equations(name: str, integrator: str, substeps: int):
    agree(vessel(name), SEA, integrator=integrator, substeps=substeps)


@pytest.mark.parametrize("name", SHIPS)
def test_every_ship_sails_so_with_slow_actuators_and_roll(name: str):
    agree(rolling(slow(vessel(name))), CALM, substeps=3)


@pytest.mark.parametrize("substeps", [1, 2, 7])
def test_weather_acts_sample_by_sample(substeps: int):
    rng = np.random.default_rng(5)
    series = WeatherSeries(current_to=rng.normal(0, 0.2, (SAMPLES, 2)), wind_to=rng.normal(0, 5.0, (SAMPLES, 2)))
    agree(vessel("azimuth-30m-true"), series, substeps=substeps)


def test_a_motion_sample_by_sample_is_the_motion_at_once():
    ship = vessel("tender-20m")
    commands = commands_of(ship)
    sea = np.r_[SEA.current_to, SEA.wind_to][None]
    states = [START]
    for row in commands.values:
        states.append(integrate_motion(ship, row[None, None], states[-1], sea=sea, sample_time_s=1.0)[-1])
    whole = integrate_motion(ship, commands.values[:, None], START, sea=sea, sample_time_s=1.0)
    np.testing.assert_array_equal(np.array(states), whole)


def test_every_length_parameter_and_sample_time_uses_the_same_functions():
    compiled_steps.cache_clear()
    ship = vessel("model-ship")
    for samples in (*range(1, 40), 333):
        theta = ship.model.parameters * (1.0 + samples / 1000.0)
        other = replace(ship, model=ship.model.with_parameters(theta))
        commands = replace(commands_of(ship, samples), sample_time_s=(1.0 + samples / 1000.0) * ship.sample_time_s)
        simulate(other, commands, environment=SEA, substeps=1 + samples % 5)
    assert compiled_steps.cache_info().misses == 1
