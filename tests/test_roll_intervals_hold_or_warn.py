"""Intervals of roll estimates hold under moments of waves, and warn where the rudder is no instrument."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy

from expdesign.roll import (
    NOMINAL,
    PARAMETERS,
    Case,
    Load,
    RollEstimate,
    RollProblem,
    Run,
    build_problem,
    estimate_roll,
)
from expdesign.roll.instruments import folds
from expdesign.roll.regression import Spectrum
from expdesign.values import Array
from roll_truths import (
    LITTLE,
    MODEL_SHIP,
    MODEL_SHIP_TRUTH,
    PENDULUM,
    PENDULUM_TRUTH,
    ROUGH,
    SIZES,
    Sea,
    pendulum_run,
    ship_run,
    switching,
)


def pendulum_problem(free: tuple[str, ...], cases: tuple[Case, ...], theta: Array = PENDULUM_TRUTH) -> RollProblem:
    start = np.where(np.isin(PARAMETERS, free), np.where(ROUGH == 0, theta, ROUGH), theta)
    return RollProblem(body=PENDULUM, cases=cases, free=free, start=start, scale=SIZES)


def pendulum_case(load: Load | None, sea: Sea, rng: np.random.Generator, samples: int = 6000) -> Case:
    orders = switching(samples, 200, rng)
    run = pendulum_run(load or Load(mass_kg=0.2, z_m=-0.274), orders, sea, rng)
    return Case(name="pendulum", load=load, runs=(run,))


def test_three_parameters_of_a_pendulum_come_from_one_data_set() -> None:
    case = pendulum_case(NOMINAL, Sea(roll_rate=0.01, sensed=0.01), np.random.default_rng(2))
    found = estimate_roll(pendulum_problem(("k", "A_x", "d"), (case,)))
    for name, std in found.std.items():
        assert abs(found.values[name] - PENDULUM_TRUTH[PARAMETERS.index(name)]) < 4.0 * std, name


def squared_deviations(runs: int, seed: int, method: str) -> Array:
    """(runs, 2) of inertia and damping from the truth, over their told variances, under a narrow-band roll moment."""
    sea, places = Sea(moment=0.1, frequency_hz=1.0, damping=0.1), [PARAMETERS.index(name) for name in ("A_x", "d")]
    result = []
    for number in range(runs):
        case = pendulum_case(NOMINAL, sea, np.random.default_rng([seed, number]), samples=9000)
        one = estimate_roll(pendulum_problem(("A_x", "d"), (case,)), method=method)
        result.append((one.theta - PENDULUM_TRUTH)[places] ** 2 / np.diag(one.covariance))
    return np.array(result)


@pytest.mark.thorough
def test_intervals_hold_under_a_narrow_band_moment_that_makes_least_squares_sure_of_wrong_values() -> None:
    """Mean of squares that are 1 on average, within 3 of its standard deviations if the two were one and the same."""
    runs = 8
    assert squared_deviations(runs, 14, "iv").mean() < 1.0 + 3.0 * np.sqrt(2.0 / runs)
    assert squared_deviations(runs, 14, "ls").mean() > 10.0 * (1.0 + 3.0 * np.sqrt(2.0 / runs))


@pytest.mark.slow
def test_of_many_intervals_under_a_narrow_band_moment_no_fewer_hold_than_they_say() -> None:
    """Runs are independent, the two intervals of one are not: 3 binomial deviations of as many intervals as runs."""
    runs = 60
    held = (squared_deviations(runs, 15, "iv") < 1.96**2).mean()
    assert held > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / runs)


@pytest.mark.thorough
def test_a_moment_that_hides_the_rudder_is_noticed() -> None:
    def weak(moment: float, number: int) -> bool:
        sea = Sea(moment=moment, frequency_hz=1.0, damping=0.1)
        case = pendulum_case(NOMINAL, sea, np.random.default_rng([16, number]))
        return estimate_roll(pendulum_problem(("A_x", "d"), (case,))).weak

    assert all(weak(3.0, number) for number in range(3))
    assert not any(weak(0.01, number) for number in range(3))


@cache
def steered(gain: float, number: int, *, planned: bool = False) -> tuple[RollEstimate, Array]:
    """Five parameters of the ship in waves under a helm that answers heading, yaw and roll rate; squares of errors."""
    rng, sea = np.random.default_rng([23, number]), replace(LITTLE, moment=0.2, damping=0.1)
    orders = switching(6000, 150, rng, levels=(-0.6, 0.0, 0.6))
    run = ship_run(NOMINAL, orders, sea, rng, step_s=0.01, helm=(1.0, 1.0, gain))
    run = replace(run, planned=orders if planned else None)
    known = {"k": 9.0, "K_vd": 0.95, "z_f": -0.0294}
    case = Case(name="ship", load=NOMINAL, runs=(run,))
    one = estimate_roll(build_problem(MODEL_SHIP, (case,), beam_m=0.3, roll_hz=0.75, known=known, start={}))
    places = [PARAMETERS.index(name) for name in one.problem.free]
    return one, (one.theta - MODEL_SHIP_TRUTH)[places] ** 2 / np.diag(one.covariance)


@pytest.mark.thorough
def test_a_rudder_that_answers_roll_is_told_from_one_that_answers_the_course() -> None:
    """Strong damping by the rudder is found in most runs; what only answers heading and yaw in none."""
    answering = [steered(1.0, number)[0] for number in range(6)]
    assert sum(one.answering for one in answering) >= 3
    assert not any(one.trusted for one in answering if one.answering)
    assert not any(steered(0.0, number)[0].answering for number in range(6))


@pytest.mark.thorough
def test_orders_are_instruments_where_the_rudder_is_none() -> None:
    """Mean of squares that are 1 on average, within 3 of its standard deviations if all of a run were one."""
    runs = 6
    found = [steered(1.0, number, planned=True) for number in range(runs)]
    assert not any(one.answering for one, _ in found)
    assert np.mean([squares for _, squares in found]) < 1.0 + 3.0 * np.sqrt(2.0 / runs)


def test_instruments_of_a_part_of_the_record_do_not_depend_on_its_noise() -> None:
    run = pendulum_case(NOMINAL, Sea(roll_rate=0.01), np.random.default_rng(17)).runs[0]
    other = run.signals.copy()
    here = folds([run])[0][1][0]
    other[here, :3] += 0.1 * np.random.default_rng(18).standard_normal((here.stop - here.start, 3))
    before, after = (folds([one])[0] for one in (run, Run(step_s=run.step_s, signals=other)))
    changed = [np.abs(new - old).max() for (_, old), (_, new) in zip(before, after, strict=True)]
    assert changed[1] < 1e-2 * min(changed[0], changed[2])


def test_the_covariance_of_moments_is_that_of_draws() -> None:
    """A narrow band of noise on given instruments, with its own spectrum; draws within 4 standard errors."""
    rng, count = np.random.default_rng(19), 400
    Z = np.cumsum(rng.standard_normal((count, 2)), axis=0)
    below = [1.0, -1.9, 0.95]
    length = 2048
    density = 1.0 / np.abs(np.fft.rfft(below, length)) ** 2
    wanted = Spectrum(density=density, length=length, freedom=np.inf).covariance([Z])
    noise = scipy.signal.lfilter([1.0], below, rng.standard_normal((4000, count + 400)))[:, 400:]
    sums = noise @ Z
    found = sums.T @ sums / len(sums)
    error = np.sqrt((np.outer(np.diag(wanted), np.diag(wanted)) + wanted**2) / len(sums))
    assert (np.abs(found - wanted) < 4.0 * error).all()


def test_a_parameter_at_a_bound_of_the_search_is_named_and_its_interval_not_trusted() -> None:
    case = pendulum_case(NOMINAL, Sea(roll_rate=0.01, sensed=0.01), np.random.default_rng(2))
    problem = pendulum_problem(("A_x", "d"), (case,))
    within = estimate_roll(problem)
    narrow = replace(problem, scale=np.where(np.array(PARAMETERS) == "A_x", 0.005, problem.scale))
    beyond = estimate_roll(replace(narrow, start=np.where(np.array(PARAMETERS) == "A_x", 0.05, narrow.start)))
    assert (within.reached, within.trusted) == ((), True)
    assert beyond.reached == ("A_x",)
    assert not beyond.trusted
