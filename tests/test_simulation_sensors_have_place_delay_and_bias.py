"""Where sensors sit, how late and how often they tell, and what they get wrong: closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from design_case import vessel
from expdesign.conventions import wrap_angle
from expdesign.errors import InputError
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM, Environment, measure, simulate_ensemble
from expdesign.values import Array
from expdesign.vessel import SENSORS, Sensors

SHIP = vessel("azimuth-30m-true")
COUNT, STEP_S = 200, 0.5
TIME_S = STEP_S * np.arange(COUNT + 1)
U, V, R = 3.0, -0.4, 0.05
WIND = Environment(wind_to=np.array([4.0, -3.0]))


def seen(sensors: Sensors, run: Trajectory, environment: Environment = CALM, seed: int = 0) -> dict[str, Array]:
    """What these sensors measure of a run."""
    ship = replace(SHIP, sensors=sensors)
    commands = Commands(sample_time_s=STEP_S, names=ship.model.inputs, values=np.zeros((COUNT, 4)))
    return measure(ship, commands, run, environment=environment, rng=np.random.default_rng(seed))


def steady_turn() -> Trajectory:
    """A circle at constant u, v, r, in closed form."""
    heading, speed, drift = R * TIME_S, np.hypot(U, V), np.arctan2(V, U)
    north = speed / R * (np.sin(heading + drift) - np.sin(drift))
    east = -speed / R * (np.cos(heading + drift) - np.cos(drift))
    pose = np.stack([north, east, heading], axis=1)
    return Trajectory(sample_time_s=STEP_S, pose=pose, velocity=np.tile([U, V, R], (COUNT + 1, 1)))


TURN = steady_turn()


def test_a_velocity_sensor_forward_sees_the_yaw_rate_as_sway():
    told = seen(Sensors(velocity_forward_m=8.0, velocity_starboard_m=-3.0), TURN)
    np.testing.assert_allclose(told["v_mps"], V + R * 8.0, rtol=1e-12)
    np.testing.assert_allclose(told["u_mps"], U + R * 3.0, rtol=1e-12)
    np.testing.assert_allclose(told["r_radps"], R)


def test_an_antenna_moves_with_the_velocity_of_its_place():
    """Differences of the antenna's position are its velocity: that of the origin and the yaw rate times the arm."""
    told = seen(Sensors(position_forward_m=8.0, position_starboard_m=-3.0), TURN)
    north, east = np.gradient(told["north_m"], STEP_S), np.gradient(told["east_m"], STEP_S)
    heading = TURN.pose[:-1, 2]
    ahead, side = north * np.cos(heading) + east * np.sin(heading), east * np.cos(heading) - north * np.sin(heading)
    np.testing.assert_allclose(ahead[1:-1], U + R * 3.0, rtol=1e-3)
    np.testing.assert_allclose(side[1:-1], V + R * 8.0, atol=1e-3)
    assert (told["north_m"][0], told["east_m"][0]) == (8.0, -3.0)


def test_an_anemometer_off_the_centre_feels_the_turn():
    central, off = (
        seen(sensors, TURN, WIND) for sensors in (Sensors(), Sensors(wind_forward_m=10.0, wind_starboard_m=2.0))
    )
    np.testing.assert_allclose(off["wind_u_mps"] - central["wind_u_mps"], -R * 2.0, rtol=1e-9)
    np.testing.assert_allclose(off["wind_v_mps"] - central["wind_v_mps"], R * 10.0, rtol=1e-9)


def test_bias_and_scale_are_what_they_say():
    told = seen(Sensors(heading_bias_rad=0.1, velocity_scale=1.2, yaw_rate_scale=0.9), TURN)
    right = seen(Sensors(), TURN)
    np.testing.assert_allclose([told["u_mps"], told["v_mps"]], [1.2 * right["u_mps"], 1.2 * right["v_mps"]])
    np.testing.assert_allclose(wrap_angle(told["heading_rad"] - TURN.pose[:-1, 2]), 0.1)
    np.testing.assert_allclose(told["r_radps"], 0.9 * R)


@pytest.mark.parametrize("delay_s", [0.5, 0.7, 3.0, 1e6])
def test_delays_shift_what_was_so(delay_s: float):
    told = seen(Sensors(**{f"{sensor}_delay_s": delay_s for sensor in SENSORS}), ramp(), WIND)
    then = np.maximum(TIME_S[:-1] - delay_s, 0.0)
    np.testing.assert_allclose(told["u_mps"], 0.1 * then, atol=1e-12)
    np.testing.assert_allclose(told["r_radps"], 0.01 * then, atol=1e-12)
    np.testing.assert_allclose(told["heading_rad"], 0.02 * then, atol=1e-12)
    np.testing.assert_allclose(told["north_m"], 2.0 * then, atol=1e-9)
    prompt = seen(Sensors(), ramp(), WIND)
    np.testing.assert_allclose(
        told["wind_u_mps"][20:], np.interp(then[20:], TIME_S[:-1], prompt["wind_u_mps"]), atol=1e-9
    )


def ramp() -> Trajectory:
    """Everything grows in proportion to time, so straight lines between samples are exact."""
    pose, velocity = TIME_S[:, None] * [2.0, 1.0, 0.02], TIME_S[:, None] * [0.1, -0.05, 0.01]
    return Trajectory(sample_time_s=STEP_S, pose=pose, velocity=velocity)


@pytest.mark.parametrize(("interval_s", "delay_s"), [(2.0, 0.0), (2.0, 0.5), (1.2, 0.0), (3.0, 7.0)])
def test_slow_sensors_repeat_their_last_reading(interval_s: float, delay_s: float):
    told = seen(Sensors(position_interval_s=interval_s, position_delay_s=delay_s), ramp())
    reading = np.maximum(np.floor((TIME_S[:-1] - delay_s) / interval_s + 1e-9), 0.0) * interval_s
    np.testing.assert_allclose(told["north_m"], 2.0 * reading, atol=1e-9)


def test_a_repeated_reading_repeats_its_noise_and_new_ones_are_independent():
    still = Trajectory(sample_time_s=STEP_S, pose=np.zeros((COUNT + 1, 3)), velocity=np.zeros((COUNT + 1, 3)))
    told = seen(Sensors(position_m=1.0, position_interval_s=2.0), still)["north_m"].reshape(-1, 4)
    np.testing.assert_array_equal(told, np.repeat(told[:, :1], 4, axis=1))
    readings = told[:, 0]
    assert abs(readings.std() - 1.0) < 5 / np.sqrt(2 * len(readings))
    assert abs(np.corrcoef(readings[1:], readings[:-1])[0, 1]) < 5 / np.sqrt(len(readings) - 1)


def test_a_vane_without_noise_agrees_with_a_cartesian_sensor_without_noise():
    flat, vane = (seen(Sensors(wind_sensor=kind), TURN, WIND) for kind in ("cartesian", "vane"))
    for name in ("wind_u_mps", "wind_v_mps"):
        np.testing.assert_allclose(vane[name], flat[name], atol=1e-12)


def test_a_vane_shrinks_the_wind_by_the_mean_cosine_of_its_error():
    """E cos e = exp(-var / 2) for Gaussian e, (5.48)-(5.50)."""
    std = 0.3
    still = Trajectory(sample_time_s=STEP_S, pose=np.zeros((COUNT + 1, 3)), velocity=np.zeros((COUNT + 1, 3)))
    runs = [seen(Sensors(wind_sensor="vane", wind_angle_rad=std), still, WIND, seed) for seed in range(50)]
    u_q, v_q = (np.concatenate([run[name] for run in runs]) for name in ("wind_u_mps", "wind_v_mps"))
    speed = np.hypot(4.0, 3.0)
    np.testing.assert_allclose(np.hypot(u_q, v_q), speed, rtol=1e-12)
    shrunk, standard_error = np.exp(-(std**2) / 2), speed * std / np.sqrt(len(u_q))
    assert abs(u_q.mean() + 4.0 * shrunk) < 5 * standard_error
    assert abs(v_q.mean() - 3.0 * shrunk) < 5 * standard_error


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("kind", ["cartesian", "vane"])
def test_many_runs_are_measured_as_single_ones(late: bool, kind: str):
    timing = {
        f"{sensor}_{key}": time_s for sensor in SENSORS for key, time_s in (("delay_s", 1.3), ("interval_s", 2.5))
    }
    sensors = Sensors(
        heading_bias_rad=0.05, yaw_rate_scale=1.1, wind_sensor=kind, position_forward_m=3.0, velocity_forward_m=4.0,
        velocity_starboard_m=1.0, wind_forward_m=-6.0, **(timing if late else {}),
    )  # fmt: skip
    ship = replace(SHIP, sensors=sensors)
    values = np.random.default_rng(0).uniform(0, 6, (70, 2, 4))
    many = simulate_ensemble(ship, values, runs=2, environment=WIND, rng=np.random.default_rng(0))
    for run in range(2):
        commands = Commands(sample_time_s=1.0, names=ship.model.inputs, values=values[:, run])
        motion = Trajectory(
            sample_time_s=1.0,
            pose=np.concatenate([many.pose[:, run], np.zeros((1, 3))]),
            velocity=np.concatenate([many.velocity[:, run], np.zeros((1, 3))]),
        )
        alone = measure(ship, commands, motion, environment=WIND, rng=np.random.default_rng(0))
        batch = many.batch(run)
        np.testing.assert_allclose(
            batch.velocity.T, [alone[name] for name in ("u_mps", "v_mps", "r_radps")], atol=1e-12
        )
        np.testing.assert_allclose(batch.wind.T, [alone[name] for name in ("wind_u_mps", "wind_v_mps")], atol=1e-11)
        np.testing.assert_allclose(batch.pose[:, :2].T, [alone[name] for name in ("north_m", "east_m")], atol=1e-10)
        np.testing.assert_allclose(wrap_angle(batch.pose[:, 2] - alone["heading_rad"]), 0.0, atol=1e-12)


def test_sensors_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="unknown wind sensor 'vanes', did you mean 'vane'"):
        Sensors(wind_sensor="vanes")
    with pytest.raises(InputError, match=r"sensors\.wind_delay_s is -1, expected 0 or more"):
        Sensors(wind_delay_s=-1.0)
    with pytest.raises(InputError, match="yaw_rate_scale is 0"):
        Sensors(yaw_rate_scale=0.0)
