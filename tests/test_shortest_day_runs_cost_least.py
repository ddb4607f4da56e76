"""The runs chosen for the shortest day are the cheapest that reach the accuracy, and the bound is one."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize

from expdesign.durations import Aim, Collected, DurationProblem, optimal_shares
from expdesign.errors import NoAnswer
from expdesign.shortest_day import Accuracy, cheapest_runs
from expdesign.shortest_day.alternate import promised_at_zero
from expdesign.shortest_day.cheapest import cheapest_shares
from expdesign.shortest_day.prices import Offer

pytestmark = pytest.mark.usefixtures("undrawn")

PARAMETERS = ("X_u", "Y_v", "N_r")
SAMPLES = 100.0


EVERY = np.array(list(itertools.product(range(10), repeat=4)), dtype=float)  # (10000, 4) numbers of runs


def least_cost_s(accuracy, known, matrices, cost_s):
    """The least of all costs (10000,) of `EVERY` with which the accuracy is reached."""
    cheapest_first = np.argsort(cost_s)
    return next(
        float(cost_s[row])
        for row in cheapest_first.tolist()
        if accuracy.margin(known + np.tensordot(EVERY[row], matrices, axes=1)) >= 0
    )


def random_information(rng, count, dimension=3, rows=5):
    """(q, d, d) of runs with a few random regressor rows each."""
    rows_of = rng.normal(size=(count, rows, dimension)) * rng.uniform(0.3, 2.0, (count, 1, dimension))
    return np.einsum("qki,qkj->qij", rows_of, rows_of)


def criterion_accuracy(matrices, prior=None):
    """As accurate as the D-optimal shares of the matrices in the time of `SAMPLES`."""
    problem = DurationProblem(
        names=tuple(f"run{k}" for k in range(len(matrices))),
        parameters=PARAMETERS,
        mean_subtraction="none",
        matrices=matrices,
        run_s=np.ones(len(matrices)),
        total_s=SAMPLES,
    )
    design, collected = optimal_shares(problem), Collected.of(problem)
    return design, Accuracy(
        collected=collected,
        level=collected.value(design.fractions),
        samples=SAMPLES,
        prior=np.zeros((3, 3)) if prior is None else prior,
        variance=np.full(3, np.inf),
        parameters=PARAMETERS,
    )


def std_accuracy(variance):
    return Accuracy(
        collected=None, level=-np.inf, samples=1.0, prior=np.zeros((3, 3)), variance=variance, parameters=PARAMETERS
    )


def offered(matrices, cost_s, *, known, most, saved_s=None, way_s=0.0):
    return Offer(
        matrices=matrices,
        cost_s=cost_s,
        saved_s=np.zeros(len(matrices)) if saved_s is None else saved_s,
        way_s=way_s,
        known=known,
        fewest=np.zeros(len(matrices)),
        most=most,
    )


def accuracies(matrices):
    return (
        criterion_accuracy(matrices)[1],
        std_accuracy(np.array([0.02, np.inf, 0.05])),
        std_accuracy(np.array([0.02, 0.03, 0.05])),
        replace(
            std_accuracy(np.array([0.02, np.inf, np.inf])),
            outcomes=("advance_m", "tactical_m"),
            gradients=np.array([[1.0, -2.0, 5.0], [3.0, 0.0, 4.0]]),
        ),
    )


def test_the_optimal_shares_just_reach_their_own_accuracy():
    matrices = random_information(np.random.default_rng(0), 5)
    design, accuracy = criterion_accuracy(matrices)
    collected = SAMPLES * np.tensordot(design.fractions, matrices, axes=1)
    assert accuracy.margin(collected) == pytest.approx(0.0, abs=1e-9)
    assert accuracy.margin(collected / 2) == pytest.approx(-np.log(2.0))


@pytest.mark.parametrize("kind", range(4))
def test_more_time_saves_its_share_and_every_supergradient_bounds_every_margin(kind):
    rng = np.random.default_rng(kind)
    matrices = random_information(rng, 5)
    accuracy = accuracies(matrices)[kind]
    for _ in range(50):
        here, there = np.tensordot(rng.uniform(0.1, 30.0, (2, 5)), matrices, axes=1)
        factor = rng.uniform(0.2, 5.0)
        assert accuracy.margin(factor * here) == pytest.approx(accuracy.margin(here) + np.log(factor))
        bound = accuracy.margin(here) + np.sum(accuracy.supergradient(here) * (there - here))
        assert accuracy.margin(there) <= bound + 1e-9


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", range(4))
def test_runs_cost_what_the_best_of_all_costs_and_no_less_than_the_bound(kind, seed):
    rng = np.random.default_rng(10 * seed + kind)
    matrices = 12.0 * random_information(rng, 4)
    accuracy, cost_s = accuracies(matrices / 12.0)[kind], rng.uniform(10.0, 60.0, 4)
    known, most = 0.5 * random_information(rng, 1)[0], np.full(4, 9.0)
    found = cheapest_runs(accuracy, offered(matrices, cost_s, known=known, most=most))
    least_s = least_cost_s(accuracy, known, matrices, EVERY @ cost_s)
    assert accuracy.margin(known + np.tensordot(np.array(found.repeats), matrices, axes=1)) >= -1e-9
    assert least_s <= found.cost_s <= 1.002 * least_s
    assert found.bound_s <= least_s + 1e-9


@pytest.mark.parametrize("kind", range(4))
def test_the_bound_is_the_cost_of_the_best_shares_of_runs(kind):
    rng = np.random.default_rng(100 + kind)
    matrices = random_information(rng, 4)
    accuracy, cost_s = accuracies(matrices)[kind], rng.uniform(10.0, 60.0, 4)
    known, most = 0.5 * random_information(rng, 1)[0], np.full(4, 200.0)
    found = cheapest_runs(accuracy, offered(matrices, cost_s, known=known, most=most))
    best = min(
        scipy.optimize.minimize(
            lambda runs: runs @ cost_s,
            start,
            jac=lambda runs: cost_s,
            bounds=[(0.0, 200.0)] * 4,
            constraints={
                "type": "ineq",
                "fun": lambda runs: accuracy.margin(known + np.tensordot(runs, matrices, axes=1)),
            },
        ).fun
        for start in (np.full(4, 50.0), np.full(4, 20.0))
    )
    assert 0.995 * best < found.bound_s <= best * (1 + 1e-6)


def test_what_the_limits_do_not_allow_is_refused_with_the_parameter():
    blind = np.array([np.diag([1.0, 1.0, 1e-9])])
    with pytest.raises(NoAnswer, match="standard deviation of N_r"):
        cheapest_runs(
            std_accuracy(np.array([np.inf, np.inf, 0.05])),
            offered(blind, np.ones(1), known=np.zeros((3, 3)), most=np.full(1, 9.0)),
        )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("way_s", [0.0, 60.0, 1e6])
def test_way_made_good_saves_time_as_far_as_there_is_a_way(seed, way_s):
    rng = np.random.default_rng(seed)
    matrices = 12.0 * random_information(rng, 4)
    accuracy, cost_s = criterion_accuracy(matrices / 12.0)[1], rng.uniform(30.0, 60.0, 4)
    saved_s, known = cost_s * rng.uniform(0.0, 0.95, 4), 0.5 * random_information(rng, 1)[0]
    offer = offered(matrices, cost_s, known=known, most=np.full(4, 9.0), saved_s=saved_s, way_s=way_s)
    found = cheapest_runs(accuracy, offer)
    least_s = least_cost_s(accuracy, known, matrices, EVERY @ cost_s - np.minimum(EVERY @ saved_s, way_s))
    assert least_s - 1e-9 <= found.cost_s <= 1.002 * least_s
    assert found.bound_s <= least_s + 1e-9


@pytest.mark.parametrize("way_s", [0.0, 60.0, 1e6])
@pytest.mark.parametrize("kind", range(4))
def test_no_run_offered_is_worth_more_than_it_costs_and_those_chosen_are_worth_it(kind, way_s):
    rng = np.random.default_rng(kind)
    matrices, cost_s = random_information(rng, 4), rng.uniform(30.0, 60.0, 4)
    accuracy = accuracies(matrices)[kind]
    saved_s, known = cost_s * rng.uniform(0.0, 0.95, 4), 0.5 * random_information(rng, 1)[0]
    offer = offered(matrices, cost_s, known=known, most=np.full(4, 200.0), saved_s=saved_s, way_s=way_s)
    found = cheapest_shares(accuracy, offer)
    net_s = cost_s - found.worth_of_saved * saved_s - np.einsum("ij,qji->q", found.worth, matrices)
    assert (net_s >= -1e-6 * cost_s).all()
    assert np.abs(net_s[found.runs > 1e-9]) == pytest.approx(0.0, abs=1e-6 * cost_s.max())
    assert 0.0 <= found.worth_of_saved <= 1.0


@pytest.mark.parametrize("kind", range(4))
def test_runs_and_prices_hang_on_no_rounding_of_the_information(kind):
    rng = np.random.default_rng(kind)
    matrices, cost_s = random_information(rng, 40), rng.uniform(30.0, 60.0, 40)
    accuracy, known = accuracies(matrices[:5])[kind], 0.5 * random_information(rng, 1)[0]
    offer = offered(matrices, cost_s, known=known, most=np.full(40, 200.0), saved_s=cost_s / 3, way_s=1e6)
    found = cheapest_shares(accuracy, offer)
    for _ in range(10):
        rounded = matrices * (1 + 1e-12 * rng.standard_normal((40, 1, 1)))
        other = cheapest_shares(accuracy, replace(offer, matrices=rounded))
        assert other.runs == pytest.approx(found.runs, abs=1e-7)
        assert other.worth == pytest.approx(found.worth, abs=1e-8 * np.abs(found.worth).max())


@pytest.mark.parametrize("current", [0, 2])
@pytest.mark.parametrize("kind", range(4))
def test_margins_bend_as_their_supergradients_change(kind, current):
    rng = np.random.default_rng(kind)
    accuracy = accuracies(random_information(rng, 5))[kind]
    matrices, runs = random_information(rng, 5, dimension=3 + current, rows=8), rng.uniform(1.0, 9.0, 5)

    def at(runs):
        M = np.tensordot(runs, matrices, axes=1)
        values, gradients, curvatures = accuracy.curved(M, matrices)
        return values, np.einsum("kij,qji->kq", gradients, matrices), curvatures, accuracy.margin(M)

    values, slopes, curvatures, margin = at(runs)
    assert values.min() == pytest.approx(margin)
    for place, step in enumerate(1e-5 * np.eye(5)):
        (higher, above, *_), (lower, below, *_) = at(runs + step), at(runs - step)
        assert slopes[:, place] == pytest.approx((higher - lower) / 2e-5, rel=1e-6)
        assert curvatures[:, place] == pytest.approx((below - above) / 2e-5, rel=1e-5, abs=1e-8)


def test_where_the_margin_has_kinks_tangents_lead_to_the_cheapest_runs():
    rng = np.random.default_rng(2)
    matrices, cost_s = random_information(rng, 6), rng.uniform(10.0, 60.0, 6)
    problem = DurationProblem(
        names=tuple(f"run{k}" for k in range(6)),
        parameters=PARAMETERS,
        mean_subtraction="none",
        matrices=matrices,
        run_s=np.ones(6),
        total_s=SAMPLES,
        aim=Aim(criterion="E", unit=np.ones(3), noise=np.ones(3)),
    )
    design, collected = optimal_shares(problem), Collected.of(problem)
    accuracy = replace(
        std_accuracy(np.full(3, np.inf)), collected=collected, level=collected.value(design.fractions), samples=SAMPLES
    )
    offer = offered(matrices, np.ones(6), known=np.zeros((3, 3)), most=np.full(6, 200.0))
    assert cheapest_shares(accuracy, offer).bound_s == pytest.approx(SAMPLES, rel=1e-3)
    found = cheapest_shares(accuracy, replace(offer, cost_s=cost_s))
    assert found.bound_s <= cost_s @ found.runs + 1e-6 <= 1.001 * found.bound_s
    assert accuracy.margin(offer.information(found.runs)) >= -1e-3


def test_an_outcome_is_as_accurate_as_the_parameters_along_its_gradient():
    rng = np.random.default_rng(5)
    gradient, M = np.array([1.0, -2.0, 5.0]), random_information(rng, 1)[0]
    asked = replace(std_accuracy(np.full(3, np.inf)), outcomes=("advance_m",), gradients=gradient[None])
    draws = rng.multivariate_normal(np.zeros(3), np.linalg.inv(M), size=200_000) @ gradient
    assert asked.margin(M) == pytest.approx(-np.log(draws.var()), abs=5 * np.sqrt(2 / len(draws)))
    assert asked.scarcest(M) == "advance_m"


def test_the_promise_of_a_day_that_just_reaches_lies_between_the_nearest_on_both_sides():
    assert promised_at_zero([0.3, 0.8, 0.5], [-0.5, 0.8, -0.1]) == pytest.approx(0.5 + 0.3 * 0.1 / 0.9)
    assert promised_at_zero([0.3, 0.5], [-0.5, -0.1]) == pytest.approx(0.6)
    assert promised_at_zero([0.3], [0.2]) == pytest.approx(0.1)


def test_of_many_manoeuvres_whole_runs_cost_little_more_than_the_bound():
    rng = np.random.default_rng(5)
    matrices, cost_s = random_information(rng, 400), rng.uniform(60.0, 300.0, 400)
    accuracy = std_accuracy(np.array([0.002, 0.002, 0.002]))
    offer = offered(matrices, cost_s, known=np.zeros((3, 3)), most=np.full(400, 200.0))
    choice = cheapest_runs(accuracy, offer)
    assert accuracy.margin(offer.information(np.array(choice.repeats, dtype=float))) >= -1e-9
    assert choice.bound_s <= choice.cost_s <= choice.bound_s + 60.0
