"""Primitives follow the desired motion where the vessel can, keep its limits always, and begin in equilibrium."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from design_case import example_dictionary, force_actuator, resampled, spec, vessel, with_limit
from expdesign.dictionary import Primitive, PrimitiveSpec, build_primitive, family
from expdesign.errors import Unreachable
from expdesign.simulation import simulate
from expdesign.values import Array
from expdesign.vessel import Limit, Vessel

REQUESTS = (
    spec("acceleration", duration_s=60, speed_mps=1.2),
    spec("deceleration", duration_s=60, speed_mps=1.2),
    spec("zigzag", duration_s=60, speed_mps=0.8, yaw_rate_radps=0.05, sway_mps=0.1, period_s=30),
    spec("turning_circle", duration_s=60, speed_mps=1, turn_speed_mps=0.7, yaw_rate_radps=0.05, entry_s=20),
    spec("inward_spiral", duration_s=60, speed_mps=0.8, yaw_rate_radps=-0.1, sway_mps=0.1, entry_s=20),
    spec("sway_zigzag", duration_s=60, sway_mps=0.3, period_s=30),
    spec("telegraph", duration_s=60, speed_mps=0.8, speed_swing_mps=0.2, sway_mps=0.1, yaw_rate_radps=0.05, hold_s=20,
         rise_s=10),
)  # fmt: skip
EXAMPLES = [("model-ship", "model-ship"), ("azimuth-30m", "standard")]


def departure(ship: Vessel, request: PrimitiveSpec) -> float:
    """Largest difference between the simulated and the desired velocities, m/s or rad/s."""
    run = build_primitive(ship, request).trajectory
    return float(np.abs(run.velocity - family(request.family).reference(request.settings, run.time_s)).max())


@pytest.mark.parametrize("request_", REQUESTS, ids=lambda request: request.family)
def test_without_limits_the_run_follows_the_desired_motion_to_second_order_in_the_sample_time(request_: PrimitiveSpec):
    # Commands are held from the middle of each sample: an error of second order, so four times less at half the time.
    ship = with_limit(vessel("azimuth-30m-true"), Limit())
    ship = replace(ship, model=ship.model.with_parameters({n: 0.0 for n in ship.model.names if n.startswith("W_")}))
    errors = [departure(resampled(ship, step), request_) for step in (1.0, 0.5, 0.25)]
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.3)


def commanded(ship: Vessel, primitive: Primitive) -> tuple[Array, Array, Array, Array]:
    """Commands from the standing ones on (k + 1, m), and the limits low, high, rate (m,)."""
    low, high = (np.array([getattr(limit, name) for limit in ship.limits]) for name in ("low", "high"))
    rate = ship.rates
    return np.vstack([primitive.entry_inputs, primitive.commands.values]), low, high, rate


@pytest.mark.parametrize(("ship", "dictionary"), EXAMPLES)
def test_commands_of_the_examples_keep_limits_and_rates(ship: str, dictionary: str):
    for primitive in example_dictionary(dictionary):
        commands, low, high, rate = commanded(vessel(ship), primitive)
        slack = 1e-12 * np.abs(commands).max()
        assert (commands >= low - slack).all(), primitive.name
        assert (commands <= high + slack).all(), primitive.name
        assert (np.abs(np.diff(commands, axis=0)) <= rate * vessel(ship).sample_time_s + slack).all(), primitive.name


@pytest.mark.parametrize("draw", range(10))
def test_commands_keep_limits_and_rates_however_little_there_is(draw: int):
    rng = np.random.default_rng(draw)
    high, rate = rng.uniform(24.1, 60.0), rng.uniform(0.5, 20.0)  # 24 hold the fastest entry
    ship = with_limit(vessel("azimuth-30m"), Limit(low=-high, high=high), rate)
    for request in REQUESTS:
        primitive = build_primitive(ship, request)
        commands, *_ = commanded(ship, primitive)
        assert np.abs(commands).max() <= high * (1 + 1e-12)
        assert np.abs(np.diff(commands, axis=0)).max() <= rate * (1 + 1e-12)


@pytest.mark.parametrize(("ship", "dictionary"), EXAMPLES)
def test_entry_states_of_the_examples_are_equilibria(ship: str, dictionary: str):
    for primitive in example_dictionary(dictionary):
        held = replace(primitive.commands, values=primitive.entry_inputs[None])
        after = simulate(vessel(ship), held, velocity=primitive.entry_velocity).velocity[-1]
        scale = max(np.abs(primitive.entry_velocity).max(), 1e-9)
        np.testing.assert_allclose(after, primitive.entry_velocity, atol=1e-6 * scale, err_msg=primitive.name)


def test_an_entry_state_is_held_up_to_the_very_limit_and_refused_beyond():
    # Holding u = 1.2 m/s takes tau_x = 0.2 u / 0.01 by the nominal 30 m ship, whose other surge terms are zero.
    ship, request, needed = vessel("azimuth-30m"), REQUESTS[1], 0.2 * 1.2 / 0.01
    enough, short = (with_limit(ship, Limit(low=-99, high=share * needed)) for share in (1.0, 0.99))
    assert build_primitive(enough, request).entry_inputs[0] == pytest.approx(needed)
    reached = r"u = 1.2 m/s, v = 0 m/s; in that direction they reach u = 1.188 m/s"
    says = rf"^primitive 'deceleration': the actuators cannot hold its entry state {reached}.* 24, .* 23\.76, 0$"
    with pytest.raises(Unreachable, match=says):
        build_primitive(short, request)


@pytest.mark.parametrize(("ship", "dictionary"), EXAMPLES)
def test_the_motion_of_a_primitive_is_the_simulation_of_its_commands(ship: str, dictionary: str):
    for primitive in example_dictionary(dictionary):
        again = simulate(vessel(ship), primitive.commands, velocity=primitive.entry_velocity)
        np.testing.assert_array_equal(again.velocity, primitive.trajectory.velocity)
        np.testing.assert_array_equal(again.pose, primitive.trajectory.pose)


def test_runs_join_where_one_exit_is_the_next_entry():
    ship = vessel("azimuth-30m")
    whole = [build_primitive(ship, spec("acceleration", f"{a}", duration_s=120, speed_mps=b, from_speed_mps=a))
             for a, b in ((0.0, 0.6), (0.6, 1.2))]  # fmt: skip
    for first, second in pairwise(whole):
        # The ramp ends 36 s before the run does; the slowest nominal time constant is 1 s / 0.15.
        np.testing.assert_allclose(first.exit_velocity, second.entry_velocity, atol=np.exp(-36 * 0.15))


def test_displacements_are_the_last_pose_seen_from_the_first():
    for primitive in example_dictionary("standard"):
        np.testing.assert_allclose(primitive.displacement, primitive.trajectory.pose[-1], atol=1e-12)


def test_mirrored_requests_give_mirrored_primitives():
    ship = replace(vessel("azimuth-30m"), model=replace(vessel("azimuth-30m").model, actuators=(force_actuator(),)))
    settings = {"duration_s": 60, "speed_mps": 1, "turn_speed_mps": 0.7, "entry_s": 20}
    starboard, port = (
        build_primitive(ship, spec("turning_circle", **settings, yaw_rate_radps=side * 0.05, sway_mps=side * 0.1))
        for side in (1, -1)
    )
    np.testing.assert_allclose(port.trajectory.velocity, starboard.trajectory.velocity * (1, -1, -1), atol=1e-12)
    np.testing.assert_allclose(port.displacement, starboard.displacement * (1, -1, -1), atol=1e-10)
