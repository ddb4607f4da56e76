"""The excitation condition: the argument of a modulus keeps its sign, with a margin for noise and disturbance."""

from dataclasses import replace

import numpy as np
import pytest

from design_case import azimuth, force_actuator, structured, vessel
from expdesign.information import excitation_condition
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM, Environment
from expdesign.vessel import Sensors, Term, Vessel

COUNT = 20


def ship(expression: str = "abs(u)*u", **sensors: float) -> Vessel:
    """A vessel whose only term holds a modulus."""
    model = structured("surge", np.zeros(4), (force_actuator(),))
    model = replace(model, terms=(Term("u", "X", expression),), parameters=np.ones(1), parameter_std=np.zeros(1))
    return replace(vessel("model-ship"), model=model, sensors=Sensors(**sensors))


def holds(
    vessel_: Vessel, velocity: tuple[float, float, float] | np.ndarray, sea: Environment = CALM, **options: float
) -> bool:
    """The condition for a run at a given velocity (3,) or velocities (COUNT, 3) on a steady heading north."""
    nu = np.vstack([np.broadcast_to(velocity, (COUNT, 3)), np.zeros(3)])  # the state after the last command is not used
    commands = Commands(
        sample_time_s=1.0, names=vessel_.model.inputs, values=np.ones((COUNT, len(vessel_.model.inputs)))
    )
    run = Trajectory(sample_time_s=1.0, pose=np.zeros((COUNT + 1, 3)), velocity=nu)
    return excitation_condition(vessel_, run, commands, sea, **options)


@pytest.mark.parametrize(("speed", "met"), [(0.31, True), (0.29, False), (-0.31, True), (-0.29, False), (0.0, False)])
def test_speed_must_clear_three_deviations_of_its_sensor(speed: float, met: bool):
    assert holds(ship(velocity_mps=0.1), (speed, 0.0, 0.0)) is met


def test_without_noise_only_the_sign_must_stay():
    assert holds(ship(), (1e-6, 0.0, 0.0))
    assert not holds(ship(), (0.0, 0.0, 0.0))
    changing = np.array([1.0, 0.0, 0.0]) * np.linspace(1.0, -1.0, COUNT)[:, None]
    assert not holds(ship(), changing)


@pytest.mark.parametrize("index", range(COUNT))
def test_one_sample_breaks_it(index: int):
    velocity = np.tile([1.0, 0.0, 0.0], (COUNT, 1))
    assert holds(ship(velocity_mps=0.1), velocity)
    velocity[index, 0] = 0.2
    assert not holds(ship(velocity_mps=0.1), velocity)


def test_noise_and_disturbance_add_as_independent_deviations():
    sea = Environment(current_std_mps=0.4)
    margin = 3 * np.hypot(0.3, 0.4)
    assert holds(ship(velocity_mps=0.3), (margin + 0.01, 0.0, 0.0), sea)
    assert not holds(ship(velocity_mps=0.3), (margin - 0.01, 0.0, 0.0), sea)


def test_the_number_of_deviations_can_be_chosen():
    assert holds(ship(velocity_mps=0.1), (0.15, 0.0, 0.0), sigmas=1.0)
    assert not holds(ship(velocity_mps=0.1), (0.15, 0.0, 0.0), sigmas=2.0)


def test_speed_through_water_counts_not_over_ground():
    sea = Environment(current_to=np.array([2.0, 0.0]))
    assert not holds(ship(velocity_mps=0.1), (2.1, 0.0, 0.0), sea)
    assert holds(ship(velocity_mps=0.1), (0.0, 0.0, 0.0), sea)


def test_moduli_of_wind_clear_the_spread_of_the_wind_and_the_anemometer():
    sea = Environment(wind_to=np.array([-10.0, 0.0]), wind_std_mps=3.0, current_std_mps=99.0)
    assert holds(ship("abs(u_q)*u_q", wind_mps=1.0), (1.0, 0.0, 0.0), sea)  # 11 > 3 sqrt(10)
    assert not holds(ship("abs(u_q)*u_q", wind_mps=2.5), (1.0, 0.0, 0.0), sea)  # 11 < 3 sqrt(9 + 2.5^2)


def test_moduli_of_yaw_rate_clear_the_gyro_not_the_log():
    turning = (0.0, 0.0, 0.1)
    assert holds(ship("abs(r)*r", velocity_mps=9.0, yaw_rate_radps=0.03), turning)
    assert not holds(ship("abs(r)*r", yaw_rate_radps=0.04), turning)


def test_moduli_of_commands_only_keep_their_sign():
    direct = ship(velocity_mps=9.0)
    model = replace(direct.model, terms=(Term("u", "X", "abs(n1)*n1"),), actuators=(azimuth(),))
    assert holds(replace(direct, model=model), (0.0, 0.0, 0.0))


def test_a_sum_inside_a_modulus_clears_the_noise_of_all_its_parts():
    # u + 2 v varies by sqrt(1 + 4) deviations: 3 sqrt(5) 0.1 = 0.671.
    assert holds(ship("abs(u + 2*v)*r", velocity_mps=0.1), (0.68, 0.0, 0.0))
    assert not holds(ship("abs(u + 2*v)*r", velocity_mps=0.1), (0.66, 0.0, 0.0))


def test_models_without_moduli_always_meet_the_condition():
    assert holds(ship("u*v", velocity_mps=9.0), (0.0, 0.0, 0.0))


def test_every_modulus_of_the_full_structure_must_be_clear():
    full = replace(vessel("azimuth-30m"), sensors=Sensors(velocity_mps=0.01))
    wind = Environment(wind_to=np.array([5.0, 5.0]))
    assert holds(full, (1.0, 0.5, 0.0), wind)
    assert not holds(full, (1.0, 0.0, 0.0), wind)  # |v| has no sign
    assert not holds(full, (1.0, 5.0, 0.0), wind)  # |v_q| has none
