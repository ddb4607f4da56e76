"""Responses, surfaces and what spoils them: the numbers of the step method, beside ours."""

from __future__ import annotations

import numpy as np
import pytest

from expdesign.step_trials.holds import Sailed
from expdesign.step_trials.responses import (
    Transient,
    first_order,
    fit_first_order,
    fit_second_order,
    preference,
    second_order,
)
from expdesign.step_trials.samples import modified_scores, plateau
from expdesign.step_trials.surfaces import EVEN, ODD, Sampled, fitted_surface, lasso, ridge, validity_region

FINE_S = 0.02


def transient(values: np.ndarray, time_s: np.ndarray, *, after: float = 1.0) -> Transient:
    return Transient(time_s=time_s, values=values, before=0.0, after=after)


@pytest.mark.parametrize(("constant_s", "ratio"), [(1.0, 1.52), (2.0, 1.26), (4.0, 1.13), (8.0, 1.06)])
def test_a_dead_time_that_is_not_modelled_makes_the_inertia_too_large(constant_s: float, ratio: float) -> None:
    time_s = np.arange(0.0, 8 * constant_s, FINE_S)
    values = first_order(np.array([constant_s, 0.5]), time_s)
    blind = fit_first_order(transient(values, time_s), delay_s=(0.0, 0.0))
    assert blind.time_constant_s / constant_s == pytest.approx(ratio, abs=0.02)
    aware = fit_first_order(transient(values, time_s), delay_s=(0.0, 3.0))
    assert aware.time_constant_s == pytest.approx(constant_s, rel=1e-3)
    assert aware.delay_s == pytest.approx(0.5, abs=1e-2)


@pytest.mark.parametrize(("damping", "ratio"), [(1.0, 1.03), (0.7, 1.09), (0.5, 1.22), (0.3, 1.60)])
def test_two_poles_without_a_zero_make_the_inertia_of_a_first_order_fit_too_large(damping: float, ratio: float) -> None:
    natural = 1.0
    time_s = np.arange(0.0, 25.0, FINE_S)
    values = second_order(np.array([natural, damping, 0.0, 0.0]), time_s)
    blind = fit_first_order(transient(values, time_s), delay_s=(0.0, 0.0))
    assert blind.time_constant_s / (2 * damping * natural) == pytest.approx(ratio, abs=0.04)


def test_overshoot_from_a_zero_makes_it_too_small() -> None:
    time_s = np.arange(0.0, 40.0, FINE_S)
    natural, damping, zero = 2.0, 0.9, 4.0
    values = second_order(np.array([natural, damping, zero, 0.0]), time_s)
    assert values.max() > 1.05
    without = second_order(np.array([natural, damping, 0.0, 0.0]), time_s)
    fits = [fit_first_order(transient(part, time_s), delay_s=(0.0, 0.0)).time_constant_s for part in (values, without)]
    assert fits[0] < 2 * damping * natural < fits[1]


@pytest.mark.parametrize(
    ("wrong", "ratio"), [(1.1, 1.20), (1.2, 1.42), (1.3, 1.62), (1.5, 1.94), (0.9, 0.84), (0.8, 0.73), (0.7, 0.64)]
)
def test_a_wrong_plateau_spoils_the_inertia_as_published(wrong: float, ratio: float) -> None:
    """As without a whole turn in a current; the slope of the damping is wrong by the inverse of the plateau."""
    constant_s = 4.0
    time_s = np.arange(0.0, 5 * constant_s, FINE_S)
    values = first_order(np.array([constant_s, 0.0]), time_s)
    fit = fit_first_order(transient(values, time_s, after=wrong), delay_s=(0.0, 0.0))
    assert fit.time_constant_s / constant_s / wrong == pytest.approx(ratio, rel=0.12)


@pytest.mark.thorough
def test_dead_time_and_constant_are_found_in_noise_with_their_standard_errors() -> None:
    time_s = np.arange(0.0, 40.0, 0.2)
    scores = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        values = first_order(np.array([3.0, 0.5]), time_s) + 0.05 * rng.standard_normal(len(time_s))
        found = fit_first_order(transient(values, time_s), delay_s=(0.0, 3.0))
        scores.append(
            [
                (found.time_constant_s - 3.0) / found.time_constant_std_s,
                (found.delay_s - 0.5) / found.delay_std_s,
            ]
        )
    inside = (np.abs(scores) < 1.96).mean(axis=0)
    assert np.all(inside > 0.95 - 4 * np.sqrt(0.95 * 0.05 / 100))


def test_the_cost_has_one_minimum_and_the_optimiser_finds_it() -> None:
    time_s = np.arange(0.0, 30.0, 0.2)
    rng = np.random.default_rng(7)
    data = transient(first_order(np.array([4.0, 0.0]), time_s) + 0.1 * rng.standard_normal(len(time_s)), time_s)
    grid = np.geomspace(0.3, 60.0, 4000)
    cost = [float(np.mean((first_order(np.array([value, 0.0]), time_s) - data.values) ** 2)) for value in grid]
    turns = np.diff(np.sign(np.diff(cost)))
    assert np.count_nonzero(turns) == 1
    found = fit_first_order(data, delay_s=(0.0, 0.0)).time_constant_s
    assert found == pytest.approx(float(grid[int(np.argmin(cost))]), rel=2e-3)


def test_the_second_order_is_preferred_where_there_is_one_and_only_there() -> None:
    time_s = np.arange(0.0, 40.0, 0.2)
    preferred = {"one": 0, "two": 0}
    for seed in range(20):
        rng = np.random.default_rng(seed)
        curves = {
            "one": first_order(np.array([3.0, 0.5]), time_s),
            "two": second_order(np.array([2.0, 0.6, 1.5, 0.5]), time_s),
        }
        for name, curve in curves.items():
            data = transient(curve + 0.03 * rng.standard_normal(len(time_s)), time_s)
            first = fit_first_order(data, delay_s=(0.5, 0.5))
            second = fit_second_order(data, first, delay_s=(0.5, 0.5))
            preferred[name] += preference(first, second) > 10.0
    assert preferred["one"] <= 1
    assert preferred["two"] == 20
    assert second.time_constant_s == pytest.approx(2 * 0.6 * 2.0 - 1.5, abs=0.3)


def turning_in_current(current_mps: float, turns: float, *, speed_mps: float = 4.0, rate_radps: float = 0.2) -> float:
    """Mean speed over ground of a steady turn by `plateau`."""
    time_s = np.arange(0.0, turns * 2 * np.pi / rate_radps, 0.1)
    heading = rate_radps * time_s
    speed = np.hypot(speed_mps * np.cos(heading) + current_mps, speed_mps * np.sin(heading))
    count = len(time_s)
    state = np.stack([speed, np.full(count, rate_radps)], axis=1)
    record = Sailed(
        name="turn", sample_time_s=0.1, state=state, sway=np.full(count, np.nan), commands=np.ones((count, 2)),
        inputs=np.ones((count, 2)),
    )  # fmt: skip
    return float(plateau(record, 0, count).state[0])


def test_a_whole_turn_cancels_a_current_to_first_order() -> None:
    for current in (0.25, 0.5):
        bias = turning_in_current(current, 1.3) - 4.0
        assert bias == pytest.approx(current**2 / (4 * 4.0), abs=0.01)
    assert abs(turning_in_current(0.5, 0.4) - 4.0) > 0.1


def test_a_standard_score_cannot_see_one_outlier_of_six_and_the_median_can() -> None:
    values = np.array([40.0, 20.0, 20.5, 19.5, 21.0, 19.0])
    standard = (values - values.mean()) / values.std(ddof=1)
    assert np.abs(standard).max() <= 5 / np.sqrt(6) + 1e-12 < 2.5
    assert modified_scores(values)[0] > 3.5
    assert np.all(np.abs(modified_scores(values)[1:]) < 3.5)


def surface_samples(rng: np.random.Generator, count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    states = np.stack([rng.uniform(1, 10, count), rng.uniform(-0.4, 0.4, count)], axis=1)
    u, r = states.T
    return states, 0.02 * u + 0.004 * u**2 + 0.3 * r**2 + 0.01 * rng.standard_normal(count)


def test_ridge_without_penalty_is_least_squares_and_lasso_gives_exact_zeros() -> None:
    rng = np.random.default_rng(8)
    columns = np.column_stack([np.ones(40), rng.standard_normal((40, 5))])
    values = columns @ np.array([1.0, 2.0, 0.0, 0.0, 0.0, 0.0]) + 0.1 * rng.standard_normal(40)
    samples = Sampled(
        columns=columns, values=values, weights=np.ones(40), penalised=np.array([0.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    )
    plain = np.linalg.lstsq(columns, values, rcond=None)[0]
    assert ridge(samples, (1e-12,)).coefficients == pytest.approx(plain, abs=1e-6)
    sparse = lasso(samples, (0.1,))
    assert np.count_nonzero(sparse.coefficients) == 2
    optimal = columns.T @ (values - columns @ sparse.coefficients) / 40
    assert np.all(np.abs(optimal[1:]) <= sparse.penalty / 2 * np.sqrt(np.mean(columns[:, 1:] ** 2, axis=0)) + 1e-7)


def test_left_out_errors_of_ridge_are_those_of_leaving_out() -> None:
    rng = np.random.default_rng(9)
    columns = np.column_stack([np.ones(12), rng.standard_normal((12, 2))])
    values = rng.standard_normal(12)
    samples = Sampled(columns=columns, values=values, weights=np.ones(12), penalised=np.zeros(3))
    errors = []
    for out in range(12):
        rest = np.delete(np.arange(12), out)
        errors.append(values[out] - columns[out] @ np.linalg.lstsq(columns[rest], values[rest], rcond=None)[0])
    assert ridge(samples, (0.0,)).held_out == pytest.approx(float(np.sqrt(np.mean(np.square(errors)))), rel=1e-6)


@pytest.mark.thorough
def test_symmetric_bases_predict_no_worse_than_a_full_one_and_are_symmetric() -> None:
    better = 0
    full = (*EVEN, *ODD)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        states, values = surface_samples(rng)
        fresh, _ = surface_samples(rng, 400)
        truth = 0.02 * fresh[:, 0] + 0.004 * fresh[:, 0] ** 2 + 0.3 * fresh[:, 1] ** 2
        errors = [
            np.sqrt(np.mean((fitted_surface(states, values, basis)(fresh) - truth) ** 2)) for basis in (EVEN, full)
        ]
        better += errors[0] <= errors[1]
        surface = fitted_surface(states, values, EVEN)
        assert surface(fresh) == pytest.approx(surface(fresh * [1.0, -1.0]), abs=1e-12)
    assert better >= 15


def test_weights_of_the_inertia_move_errors_from_where_it_is_small_to_where_it_is_large() -> None:
    small, large = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        speeds = rng.uniform(1, 10, 40)
        truth = 20 / speeds
        values = truth + 0.5 * rng.standard_normal(40)
        states = np.stack([speeds, np.zeros(40)], axis=1)
        plain, weighted = (
            np.abs(fitted_surface(states, values, EVEN[:2] + EVEN[2:3], weights=weights)(states) - truth)
            for weights in (None, truth**-2.0)
        )
        small.append(float((weighted - plain)[speeds > 6].mean()))
        large.append(float((weighted - plain)[speeds < 3].mean()))
    assert np.mean(small) < 0 < np.mean(large)


def test_polynomials_are_worth_nothing_outside_and_the_region_says_so() -> None:
    rng = np.random.default_rng(11)
    speeds = rng.uniform(2, 8, 30)
    states = np.stack([speeds, rng.uniform(-0.2, 0.2, 30)], axis=1)
    surface = fitted_surface(states, 20 / speeds + 0.3 * rng.standard_normal(30), EVEN)
    region = validity_region(states)
    outside = np.stack([np.linspace(0, 20, 200), np.full(200, 0.6)], axis=1)
    beyond = [float(surface(state)) for state in outside if not region.contains(state)]
    assert min(beyond) < 0
    drawn = [region.nearest(state) for state in outside]
    assert all(region.contains(state) for state in drawn)
    assert all(region.contains(state) for state in states)
