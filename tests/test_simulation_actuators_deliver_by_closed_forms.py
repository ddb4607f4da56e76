"""What actuators deliver: closed forms, a fine independent integration, one answer everywhere."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from design_case import vessel
from expdesign.errors import InputError
from expdesign.signals import Commands
from expdesign.simulation import (
    CALM,
    ActuatorState,
    Environment,
    deliver,
    delivered,
    delivered_at_samples,
    keeps_to,
    sample_map,
    simulate,
    simulate_ensemble,
    simulate_many,
)
from expdesign.simulation.actuation import mapped
from expdesign.vessel import IDEAL, Response, Sensors, Vessel

SHIP = replace(vessel("azimuth-30m-true"), sensors=Sensors())
SPEED = Response(lag_s=3.0, delay_s=1.4, deadband=0.5)
SLEWING = Response(rate=0.8)
ALL = Response(rate=0.5, lag_s=1.2, delay_s=0.3, deadband=0.2, offset=0.04)
ANGLE = Response(lag_s=1.2, delay_s=0.3, offset=0.04)
SEA = Environment(current_to=np.array([0.2, -0.1]), wind_to=np.array([-3.0, 5.0]))
STANDING = np.array([4.0, 0.2, 6.0, -0.1])


def sluggish(*responses: Response) -> Vessel:
    """The ship with these responses for n1, a1, n2, a2."""
    fore, aft = SHIP.actuators
    actuators = (replace(fore, responses=responses[:2]), replace(aft, responses=responses[2:]))
    return replace(SHIP, model=replace(SHIP.model, actuators=actuators))


def random_commands(count: int, seed: int = 0) -> Commands:
    rng = np.random.default_rng(seed)
    values = rng.uniform([-10, -1, -10, -1], [10, 1, 10, 1], (count, 4))
    return Commands(sample_time_s=1.0, names=SHIP.model.inputs, values=values)


def test_a_step_is_answered_by_the_exponential():
    lag, step_s, count = 2.5, 0.25, 40
    values = np.ones((count, 1))
    response = (Response(lag_s=lag),)
    ends = delivered_at_samples(response, values, sample_time_s=step_s, standing=np.zeros(1))[:, 0]
    time_s = step_s * np.arange(count + 1)
    np.testing.assert_allclose(ends, 1 - np.exp(-time_s / lag), atol=1e-14)
    means = deliver(response, values, sample_time_s=step_s, substeps=5, standing=np.zeros(1))[..., 0].ravel()
    begins = step_s / 5 * np.arange(5 * count)
    integral = begins[1] + lag * np.exp(-begins / lag) * np.expm1(-begins[1] / lag)
    np.testing.assert_allclose(means, integral / begins[1], atol=1e-12)


@pytest.mark.parametrize("order", [0.6, 0.35, -0.61])
def test_an_order_is_approached_at_the_slew_rate_from_where_the_actuator_stands(order: float):
    """Means and ends are integrals of clip(rate t), also after an order that comes before the last one is reached."""
    rate, step_s = 0.05, 1.0
    values = np.r_[np.full(5, order), np.full(30, -order)][:, None]
    time_s = (np.arange(35 * 1000) + 0.5) / 1000
    turned = np.sign(order) * np.minimum(rate * time_s, abs(order))
    at_5 = np.sign(order) * min(rate * 5, abs(order))
    back = at_5 - np.sign(order) * np.minimum(rate * (time_s - 5), abs(order) + abs(at_5))
    expected = np.where(time_s < 5, turned, back).reshape(35, 1000)
    given = deliver((Response(rate=rate),), values, sample_time_s=step_s, standing=np.zeros(1))[:, 0, 0]
    np.testing.assert_allclose(given, expected.mean(axis=1), atol=1e-5)
    ends = delivered_at_samples((Response(rate=rate),), values, sample_time_s=step_s, standing=np.zeros(1))[1:, 0]
    np.testing.assert_allclose(ends, expected[:, -1], atol=1e-4)


def test_commands_that_keep_to_the_rate_pass_to_the_last_bit_and_so_does_what_was_slewed():
    rng = np.random.default_rng(8)
    smooth = np.cumsum(rng.uniform(-0.8, 0.8, (200, 4)), axis=0)
    given = deliver((SLEWING,) * 4, smooth, sample_time_s=1.0)[:, 0]
    assert given.tobytes() == smooth.tobytes()
    jumping = rng.choice([-3.0, 0.0, 3.0], (60, 4)).repeat(5, axis=0)
    once = deliver((SLEWING,) * 4, jumping, sample_time_s=1.0)[:, 0]
    assert np.abs(np.diff(once, axis=0)).max() <= 0.8 + 1e-12
    assert np.abs(once - jumping).max() > 1.0
    np.testing.assert_array_equal(deliver((SLEWING,) * 4, once, sample_time_s=1.0)[:, 0], once)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_orders_are_told_from_recorded_positions(noise: float):
    """At 1 Hz and 10 Hz, with noise or in steps of half a degree; the first order is half of the others."""
    for step_s, rounding in ((1.0, 1e-6), (0.1, 1e-6), (0.1, np.radians(0.5))):
        orders = np.repeat([0.0, 0.17, -0.17, 0.17, -0.17, 0.0], round(20 / step_s))
        reached = deliver((Response(rate=0.05),), orders[:, None], sample_time_s=step_s)[:, 0, 0]
        read = reached + noise * np.random.default_rng(1).standard_normal(len(reached))
        read = np.round(read / rounding) * rounding
        assert not keeps_to(0.05, orders, sample_time_s=step_s)
        assert keeps_to(0.05, read, sample_time_s=step_s)


def test_a_jump_by_itself_is_an_order_and_an_actuator_a_little_faster_than_stated_goes_on():
    """Steps are in units of what the actuator can do in a sample; none is a multiple of another."""
    still = [0.0] * 20
    for steps, position in (
        ([0.613, 1.0, 0.7], True), ([1.3], False), ([0.17, 1.3, 0.21], False), ([0.9, 1.3, 1.37, 1.33, 0.8], True),
        ([0.9, 1.6, 1.67, 1.63, 0.8], False),
    ):  # fmt: skip
        for sign in (1.0, -1.0):
            signal = 0.3 + sign * 0.05 * 0.5 * np.cumsum([*still, *steps, *still])
            assert keeps_to(0.05, signal, sample_time_s=0.5) is position, steps


@pytest.mark.parametrize("lag_s", [0.0, 2.0])
@pytest.mark.parametrize("last", [1, 2])
def test_the_mean_over_a_step_of_no_length_is_its_limit(lag_s: float, last: int):
    def means(length_s: float) -> np.ndarray:
        pieces = [[(1, 0.4)], [(2, 0.3)], [(3 - last, 0.0), (last, length_s)]]
        return mapped(Response(lag_s=lag_s), 0, pieces).means

    np.testing.assert_allclose(means(0.0), means(1e-9), atol=1e-8)


@pytest.mark.parametrize("delay", [0.3, 1.0, 2.75])
def test_dead_time_shifts_what_was_commanded(delay: float):
    values = np.arange(1.0, 9.0)[:, None]
    means = deliver((Response(delay_s=delay),), values, sample_time_s=1.0, standing=np.zeros(1))[:, 0, 0]
    whole, part = int(delay), delay % 1
    held = np.concatenate([np.zeros(whole + 1), values[:, 0]])
    np.testing.assert_allclose(means, part * held[:8] + (1 - part) * held[1:9], atol=1e-14)


def test_commands_inside_the_dead_band_do_nothing_and_others_all_they_say():
    values = np.array([[0.4], [-0.49], [0.5], [-3.0]])
    means = deliver((Response(deadband=0.5),), values, sample_time_s=1.0)[:, 0, 0]
    np.testing.assert_array_equal(means, [0.0, 0.0, 0.5, -3.0])


def test_misalignment_is_added():
    values = random_commands(5).values
    given = deliver((IDEAL, Response(offset=0.1), IDEAL, IDEAL), values, sample_time_s=1.0)[:, 0]
    np.testing.assert_allclose(given - values, np.tile([0.0, 0.1, 0.0, 0.0], (5, 1)), atol=1e-15)


@pytest.mark.parametrize("response", [SPEED, ANGLE, Response(lag_s=0.05, delay_s=2.0), Response(delay_s=0.61)])
def test_means_and_ends_are_those_of_a_fine_independent_integration(response: Response):
    """The differential equation stepped ten thousand times a sample, from its own picture of delay and dead band."""
    values, standing, fine = random_commands(6, seed=3).values[:, :1], 2.0, 10_000
    time_s = (np.arange(6 * fine) + 0.5) / fine
    asked = np.where(
        time_s < response.delay_s,
        standing,
        values[np.maximum(time_s - response.delay_s, 0).astype(int), 0],
    )
    asked[np.abs(asked) < response.deadband] = 0.0
    x, track = standing, []
    for target in asked:
        after = target + (x - target) * np.exp(-1 / fine / response.lag_s) if response.lag_s else target
        track.append((x + after) / 2 if response.lag_s else target)
        x = after
    means = np.array(track).reshape(24, -1).mean(axis=1) + response.offset
    given = deliver((response,), values, sample_time_s=1.0, substeps=4, standing=np.array([standing]))
    np.testing.assert_allclose(given.ravel(), means, atol=1e-6)
    last = delivered_at_samples((response,), values, sample_time_s=1.0, standing=np.array([standing]))[-1, 0]
    assert last == pytest.approx(x + response.offset, abs=1e-9)


def test_shares_of_what_is_delivered_sum_to_one_and_steps_make_up_the_sample():
    for response in (SPEED, ANGLE, Response(lag_s=1e-9), Response(lag_s=1e9, delay_s=0.5), IDEAL):
        many, one = (sample_map(response, sample_time_s=1.0, substeps=count) for count in (7, 1))
        np.testing.assert_allclose(many.means.sum(axis=1), 1.0, rtol=1e-12)
        assert many.end.sum() == pytest.approx(1.0)
        np.testing.assert_allclose(many.means.mean(axis=0), one.means[0], atol=1e-9)
        np.testing.assert_allclose(many.end, one.end, atol=1e-9)


def test_ideal_actuators_change_no_bit():
    commands, ideal = random_commands(50), sluggish(IDEAL, IDEAL, IDEAL, IDEAL)
    assert deliver(ideal.responses, commands.values, sample_time_s=1.0)[:, 0].tobytes() == commands.values.tobytes()
    same = sluggish(IDEAL, IDEAL, IDEAL, Response(lag_s=0.0))
    plain, again = (simulate(ship, commands, environment=SEA, standing=STANDING) for ship in (ideal, same))
    assert plain.pose.tobytes() == again.pose.tobytes()
    mixed = sluggish(SPEED, IDEAL, SPEED, IDEAL)
    given = deliver(mixed.responses, commands.values, sample_time_s=1.0, substeps=2)
    np.testing.assert_array_equal(given[:, 0, [1, 3]], commands.values[:, [1, 3]])


def test_commands_that_have_stood_for_long_are_delivered():
    values = np.tile([5.0, 0.3, 5.0, 0.3], (30, 1))
    given = deliver((SPEED, ANGLE, SPEED, ANGLE), values, sample_time_s=1.0, substeps=3)
    np.testing.assert_allclose(given, np.broadcast_to(values[0] + [0, 0.04, 0, 0.04], (30, 3, 4)), atol=1e-14)


def test_a_run_is_that_of_the_ship_with_its_lags_as_states():
    """An adaptive integrator on ten states, against the two-stage answer; second order."""
    lags = np.array([3.0, 1.2, 3.0, 1.2])
    ship = sluggish(*(Response(lag_s=lag) for lag in lags))
    commands, state = random_commands(20, seed=5), np.concatenate([[0, 0, 0, 1.0, 0.1, 0.0], STANDING])
    for row in commands.values:

        def slope(_: float, x: np.ndarray, row: np.ndarray = row) -> np.ndarray:
            c, s = np.cos(x[2]), np.sin(x[2])
            moving = [x[3] * c - x[4] * s, x[3] * s + x[4] * c, x[5]]
            rates = SHIP.model.accelerations(x[3:6], x[3:5], x[6:])
            return np.concatenate([moving, rates, (row - x[6:]) / lags])

        state = solve_ivp(slope, (0, 1), state, rtol=1e-11, atol=1e-12).y[:, -1]
    errors = []
    for substeps in (4, 8, 16):
        run = simulate(ship, commands, velocity=(1.0, 0.1, 0.0), standing=STANDING, substeps=substeps)
        errors.append(np.abs(np.concatenate([run.pose[-1], run.velocity[-1]]) - state[:6]).max())
    assert errors[0] < 0.05
    assert errors[1] < errors[0] / 3
    assert errors[2] < errors[1] / 3


@pytest.mark.parametrize(("integrator", "substeps"), [("rk4", 2), ("rk4", 1), ("euler", 1), ("euler", 3)])
@pytest.mark.parametrize("responses", [(IDEAL,) * 4, (SPEED, ANGLE, IDEAL, ANGLE), (SLEWING, ALL, IDEAL, SLEWING)])
def test_one_run_and_many_runs_agree(integrator: str, substeps: int, responses: tuple[Response, ...]):
    ship = sluggish(*responses)
    runs = [random_commands(70, seed) for seed in range(3)]
    how = {"standing": STANDING, "substeps": substeps}
    many = simulate_ensemble(
        ship, np.stack([c.values for c in runs], axis=1), runs=3, environment=SEA, rng=np.random.default_rng(0),
        velocity=(1.0, 0.2, 0.0), integrator=integrator, **how,
    )  # fmt: skip
    for index, commands in enumerate(runs):
        alone = simulate(ship, commands, velocity=(1.0, 0.2, 0.0), environment=SEA, integrator=integrator, **how)
        np.testing.assert_allclose(many.pose[:, index], alone.pose[:-1], rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(many.velocity[:, index], alone.velocity[:-1], rtol=1e-10, atol=1e-12)


def test_truths_and_commands_of_their_own_are_delivered_alike():
    ship = sluggish(SPEED, ANGLE, SLEWING, ALL)
    runs, still = [random_commands(40, seed) for seed in range(3)], np.zeros((3, 2))
    rest = {"pose": np.zeros((3, 3)), "velocity": np.tile([1.0, 0.0, 0.0], (3, 1)), "current_to": still,
            "wind_to": still, "parameters": np.tile(SHIP.model.parameters, (3, 1))}  # fmt: skip
    own = simulate_many(ship, np.stack([c.values for c in runs]), standing=np.tile(STANDING, (3, 1)), **rest)
    shared = simulate_many(ship, runs[1], standing=STANDING, **rest)
    for index, commands in enumerate(runs):
        alone = simulate(ship, commands, velocity=(1.0, 0.0, 0.0), standing=STANDING, environment=CALM)
        np.testing.assert_allclose(own[:, index, :3], alone.pose, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(shared[:, 0], own[:, 1], rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(
    "responses", [(SPEED, ANGLE), (IDEAL, ANGLE), (IDEAL, IDEAL), (SLEWING, IDEAL), (SLEWING, ALL)]
)
def test_stepping_sample_by_sample_delivers_what_is_delivered_to_commands_known_beforehand(
    responses: tuple[Response, ...],
):
    commands = np.random.default_rng(3).normal(size=(40, 2, 5))
    standing, step = np.ones((2, 5)), {"sample_time_s": 0.5, "substeps": 2}
    known = deliver(responses, commands, standing=standing, **step)
    actuators = ActuatorState.standing(responses, standing, **step)
    for command, expected in zip(commands, known, strict=True):
        np.testing.assert_allclose(actuators.mean(command), expected, rtol=1e-12, atol=1e-12)
        actuators = actuators.after(command)


def test_what_is_delivered_can_be_asked_for():
    ship, commands = sluggish(SPEED, ANGLE, IDEAL, IDEAL), random_commands(12)
    given = delivered(ship, commands, standing=STANDING)
    assert given.names == commands.names
    fine = deliver(ship.responses, commands.values, sample_time_s=1.0, substeps=6, standing=STANDING)
    np.testing.assert_allclose(given.values, fine.mean(axis=1), atol=1e-12)


@pytest.mark.parametrize(
    "wrong", [{"rate": 0.0}, {"lag_s": -1.0}, {"delay_s": np.inf}, {"deadband": np.nan}, {"offset": np.nan}]
)
def test_responses_that_mean_nothing_are_refused(wrong: dict[str, float]):
    with pytest.raises(InputError, match=r"response\."):
        Response(**wrong)
