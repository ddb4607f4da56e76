"""Nothing but relative motion matters: currents carry, and the world can be turned, shifted and mirrored."""

from dataclasses import replace

import numpy as np
import pytest

from design_case import SCENARIOS, vessel
from expdesign.conventions import rotation, to_n_frame
from expdesign.signals import Commands
from expdesign.simulation import Environment, relative_velocity, simulate
from expdesign.values import Array
from expdesign.vessel import NUMPY, Roll

SHIP = vessel("azimuth-30m-true")


def commands(values: Array) -> Commands:
    """Of the 30 m ship."""
    return Commands(sample_time_s=1.0, names=SHIP.model.inputs, values=values)


def swinging(count: int) -> Commands:
    """Both thrusters ahead, swinging about."""
    rng = np.random.default_rng(0)
    return commands(np.stack([rng.uniform(5, 12, count), rng.uniform(-1, 1, count)] * 2, axis=1))


@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5])
def test_a_ship_adrift_in_a_steady_current_goes_where_the_water_goes(heading: float):
    current = np.array([0.4, -0.3])
    with_water = Environment(current_to=current, wind_to=current)  # air that moves along: no relative wind
    drift = np.append(rotation(heading).T @ current, 0.0)
    run = simulate(SHIP, commands(np.zeros((120, 4))), pose=(5.0, 6.0, heading), velocity=drift, environment=with_water)
    np.testing.assert_allclose(run.velocity, np.tile(drift, (121, 1)), atol=1e-14)
    np.testing.assert_allclose(run.pose[:, :2], (5.0, 6.0) + run.time_s[:, None] * current, atol=1e-10)


@pytest.mark.parametrize("rolls", [False, True])
@pytest.mark.parametrize("name", sorted(path.stem for path in (SCENARIOS / "vessels").glob("*.toml")))
def test_a_motion_in_a_steady_current_is_that_of_still_water_displaced_by_the_current(name: str, *, rolls: bool):
    """Turning, too: Galileo's principle, by which trials are corrected for a drift (IMO MSC/Circ.1053)."""
    ship = vessel(name)
    if rolls:
        roll = Roll(period_s=9.0, damping_ratio=0.05, Y_phi=0.1, N_phi=0.001)
        ship = replace(ship, model=replace(ship.model, roll=roll), pendulum=None)
    rng, current, heading = np.random.default_rng(1), np.array([0.02, -0.015]) * np.sqrt(ship.length_m), 0.8
    most = np.array([limit.high if np.isfinite(limit.high) else 1.0 for limit in ship.limits])
    orders = np.repeat(rng.uniform(0.0, 0.6, (8, len(most))) * most, 20, axis=0)
    runs = [
        simulate(
            ship,
            Commands(sample_time_s=ship.sample_time_s, names=ship.model.inputs, values=orders),
            pose=(0.0, 0.0, heading),
            velocity=np.append(rotation(heading).T @ water, 0.3 / np.sqrt(ship.length_m)),
            environment=Environment(current_to=water, wind_to=water),
            substeps=8,
        )
        for water in (np.zeros(2), current)
    ]
    calm, carried = runs
    assert np.ptp(calm.pose[:, 2]) > 0.1
    np.testing.assert_allclose(carried.pose[:, 2], calm.pose[:, 2], atol=1e-6)
    drift = carried.pose[:, :2] - calm.pose[:, :2]
    np.testing.assert_allclose(drift, calm.time_s[:, None] * current, atol=1e-6 * ship.length_m)


@pytest.mark.parametrize("angle", [0.5, np.pi / 2, -3.0])
def test_turning_the_world_turns_the_track(angle: float):
    R = rotation(angle)
    current, wind = np.array([0.3, -0.2]), np.array([-4.0, 6.0])
    pose, turned_pose = np.array([3.0, -2.0, 0.7]), np.array([*(R @ (3.0, -2.0)), 0.7 + angle])
    here = simulate(
        SHIP, swinging(150), pose=pose, velocity=(1, 0.1, 0), environment=Environment(current_to=current, wind_to=wind)
    )
    there = simulate(
        SHIP,
        swinging(150),
        pose=turned_pose,
        velocity=(1, 0.1, 0),
        environment=Environment(current_to=R @ current, wind_to=R @ wind),
    )
    np.testing.assert_allclose(there.velocity, here.velocity, atol=1e-11)
    np.testing.assert_allclose(there.pose[:, :2], here.pose[:, :2] @ R.T, atol=1e-9)
    np.testing.assert_allclose(there.pose[:, 2], here.pose[:, 2] + angle, atol=1e-11)


def test_in_calm_water_a_run_is_the_run_from_the_origin_set_down_at_its_pose():
    start = np.array([100.0, -50.0, 2.0])
    origin, moved = simulate(SHIP, swinging(80)), simulate(SHIP, swinging(80), pose=start)
    np.testing.assert_allclose(
        moved.pose, [(*to_n_frame(pose[:2], start), start[2] + pose[2]) for pose in origin.pose], atol=1e-10
    )


def test_the_mirrored_commands_give_the_mirrored_track():
    there = swinging(100)
    mirrored = simulate(SHIP, commands(there.values * (1, -1, 1, -1)))
    original = simulate(SHIP, there)
    np.testing.assert_allclose(mirrored.pose, original.pose * (1, -1, -1), atol=1e-12)
    np.testing.assert_allclose(mirrored.velocity, original.velocity * (1, -1, -1), atol=1e-12)


def test_relative_velocities_are_those_of_the_frames():
    state = (7.0, 8.0, np.pi / 2, 1.0, 0.5, 0.1)  # heading east
    water, air = relative_velocity(state, (0.2, 0.3), (5.0, 0.0), NUMPY)
    assert water == pytest.approx((1.0 - 0.3, 0.5 + 0.2, 0.1))
    assert air == pytest.approx((1.0, 0.5 + 5.0))  # a wind to the north blows to port


def test_a_wind_from_behind_pushes_ahead_and_one_from_ahead_astern():
    push = replace(SHIP, model=SHIP.model.with_parameters({n: 0.0 for n in SHIP.model.names if n != "W_abs_u_u"}))
    rest = commands(np.zeros((10, 4)))
    for heading in (0.0, 2.0):
        ahead = rotation(heading) @ (10.0, 0.0)
        for sign in (1, -1):
            run = simulate(push, rest, pose=(0, 0, heading), environment=Environment(wind_to=sign * ahead))
            assert sign * run.velocity[-1, 0] > 0
