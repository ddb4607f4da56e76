"""Limits hold, their certificate holds with them, and contradictory ones are refused in one line."""

from dataclasses import replace

import cvxpy
import numpy as np
import pytest

from design_case import duration_problem, one_line, random_matrices
from expdesign.durations import (
    Aim,
    Budget,
    Constraints,
    DurationDesign,
    DurationProblem,
    limits_kept,
    optimal_shares,
    solve_durations,
)
from expdesign.durations.concave import Collected, polytope_of
from expdesign.durations.rounding import _Search
from expdesign.errors import ExpdesignError, InputError, NoAnswer, UnknownName


def problem(draw: int, constraints: Constraints, **changes: object) -> DurationProblem:
    matrices = random_matrices(np.random.default_rng(draw), count=12, parameters=4, outputs=2, samples=6)
    given = duration_problem(matrices, means=2, run_s=10.0, total_s=300.0)
    return replace(given, constraints=constraints, equations=("u", "v", "u", "v"), **changes)


def mixed(draw: int) -> Constraints:
    rng = np.random.default_rng(draw)
    costs = {f"primitive {q}": float(rng.uniform(1, 9)) for q in range(12)}
    return Constraints(
        least_s={"primitive 0": 25.0},
        most_s={"primitive 1": 18.0, "primitive 2": 33.0},
        required=("primitive 3",),
        excluded=("primitive 4",),
        budgets=(Budget(name="energy", cost_per_s=costs, limit=900.0),),
    )


def check(design: DurationDesign, draw: int) -> None:
    given, limits = design.problem, design.problem.constraints
    costs = np.array([limits.budgets[0].cost_per_s[name] for name in given.names])
    runs = np.array(design.repeats)
    for seconds in (design.durations_s, runs * given.run_s):
        assert costs @ seconds <= 900.0 * (1 + 1e-6)
        assert seconds[0] >= 25.0 - 1e-6
        assert seconds[1] <= 18.0 + 1e-6
        assert seconds[2] <= 33.0 + 1e-6
        assert seconds[3] >= 10.0 - 1e-6
        assert seconds[4] < 1e-6
        assert seconds.sum() <= 300.0 + 1e-6
    assert design.gap_relative < 1e-6
    net, level = design.sensitivities - design.certificate.prices, design.certificate.level
    assert (net <= level + 1e-3 * abs(level)).all()  # after the prices of its limits no run is worth more time
    within = (design.durations_s > 25.0 + 1e-3) & (runs > 0)
    np.testing.assert_allclose(net[within], level, rtol=1e-3)


@pytest.mark.parametrize("draw", range(10))
def test_fractions_and_whole_runs_keep_every_limit_and_no_feasible_design_beats_the_bound(draw: int):
    given = problem(draw, mixed(draw))
    design = solve_durations(given)
    check(design, draw)
    collected = Collected.of(given)
    polytope = polytope_of(replace(given, constraints=replace(given.constraints, budgets=())))
    rng, tried = np.random.default_rng(draw), 0
    costs = np.array([given.constraints.budgets[0].cost_per_s[name] for name in given.names]) * 300.0
    for w in rng.dirichlet(np.full(12, 0.5), 400):
        v = polytope.least + (1 - polytope.least.sum()) * w * (polytope.most > polytope.least)
        if (v <= polytope.most).all() and costs @ v <= 900.0 and v.sum() <= 1:
            tried += 1
            assert collected.value(v) <= design.certificate.bound + 1e-9
    assert tried > 0
    near = 0.999 * (design.fractions - polytope.least) + polytope.least
    assert collected.value(near) <= design.certificate.bound
    assert design.efficiency_repeats <= 1 + 1e-6


@pytest.mark.parametrize("draw", range(3))
def test_an_outside_solver_agrees_under_limits(draw: int):
    given = problem(draw, Constraints(most_s={"primitive 0": 30.0, "primitive 5": 30.0}, least_s={"primitive 7": 60.0}))
    design = optimal_shares(given)
    w = cvxpy.Variable(12, nonneg=True)
    total = cvxpy.reshape(given.matrices.reshape(12, 36).T @ w, (6, 6), order="C")
    theirs = cvxpy.Problem(
        cvxpy.Maximize(cvxpy.log_det((total + total.T) / 2)),
        [cvxpy.sum(w) == 1, w[0] <= 0.1, w[5] <= 0.1, w[7] >= 0.2],
    ).solve(solver=cvxpy.CLARABEL)
    assert design.log_det == pytest.approx(theirs, abs=1e-5)


@pytest.mark.parametrize("criterion", ["D_s", "A", "E", "V"])
def test_the_other_criteria_are_certified_under_limits_too(criterion: str):
    given_aim = Aim(
        criterion=criterion, interest=("parameter 0",) if criterion == "D_s" else (), unit=np.ones(4),
        noise=np.ones(4), outcomes=("a",), gradients=np.array([[1.0, -1.0, 0.5, 2.0]]),
    )  # fmt: skip
    check(solve_durations(problem(0, mixed(0), aim=given_aim)), 0)


def test_inactive_limits_change_no_fraction_and_have_no_price():
    loose = Constraints(budgets=(Budget(name="wear", cost_per_s={"primitive 0": 1.0}, limit=1e6),))
    free, limited = optimal_shares(problem(1, Constraints())), optimal_shares(problem(1, loose))
    np.testing.assert_allclose(limited.fractions, free.fractions, atol=1e-5)
    assert limited.certificate.multipliers["wear"] < 1e-6


def test_the_price_of_a_budget_is_what_a_little_more_of_it_brings():
    def value(limit: float) -> tuple[float, float]:
        design = optimal_shares(problem(2, Constraints(budgets=(replace(mixed(2).budgets[0], limit=limit),))))
        return design.certificate.value, design.certificate.multipliers["energy"]

    (less, _), (_, price), (more, _) = value(599.4), value(600.0), value(600.6)
    assert price > 1e-3
    assert (more - less) / 0.002 == pytest.approx(price, rel=1e-2)  # prices are per share of the limit


@pytest.mark.thorough
@pytest.mark.parametrize("balance", [0.5, 0.8])
def test_a_balance_keeps_the_information_of_every_equation(balance: float):
    kept = 0
    for draw in range(3):
        try:
            design = solve_durations(problem(draw, Constraints(balance=balance)))
        except NoAnswer as error:
            assert "balance cannot be met" in str(error)  # noqa: PT017
            continue
        kept += 1
        assert all(item.continuous >= balance - 1e-6 for item in limits_kept(design))
        free = optimal_shares(problem(draw, Constraints()))
        assert design.certificate.value <= free.certificate.value + 1e-6
    assert kept


REFUSED = {
    "least above total": (Constraints(least_s={"primitive 0": 200.0, "primitive 1": 200.0}), NoAnswer, "take 400 s"),
    "most below total": (
        Constraints(most_s={f"primitive {q}": 10.0 for q in range(12)}), NoAnswer, "allow only 120 s"
    ),
    "least above most": (
        Constraints(least_s={"primitive 0": 20.0}, most_s={"primitive 0": 10.0}), InputError, "at least 20 s and may"
    ),
    "unknown name": (Constraints(excluded=("primitive x",)), UnknownName, "design.excluded 'primitive x'"),
    "budget too small": (
        Constraints(least_s={"primitive 0": 30.0},
                    budgets=(Budget(name="energy", cost_per_s={"primitive 0": 5.0}, limit=100.0),)),
        NoAnswer,
        "'energy' has the limit 100, but any feasible durations use at least 150",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_contradictory_limits_are_refused_in_one_line(case: str):
    constraints, kind, words = REFUSED[case]
    with pytest.raises(ExpdesignError, match=words) as caught:
        solve_durations(problem(0, constraints))
    assert isinstance(caught.value, kind)
    assert one_line(caught.value)


def test_two_primitives_of_one_name_or_no_time_are_refused():
    given = problem(0, Constraints())
    with pytest.raises(InputError, match="two primitives are named 'primitive 1'"):
        replace(given, names=("primitive 1", *given.names[1:]))
    with pytest.raises(InputError, match="total_s is 0"):
        replace(given, total_s=0.0)


@pytest.mark.parametrize("draw", range(4))
def test_what_fits_beside_whole_runs_is_what_the_limits_allow_of_it(draw: int):
    """Of every primitive one more run, beside random runs that are allowed."""
    search, rng = _Search.of(problem(draw, mixed(draw)), np.full(12, 1.0 / 12.0)), np.random.default_rng(draw)
    counts = {True: 0, False: 0}
    for _ in range(60):
        runs = search.trimmed(np.maximum(rng.integers(0, 4, 12), search.fewest), -1)
        for left_out in (None, *np.flatnonzero(runs > search.fewest)):
            fewer = runs - (np.arange(12) == left_out)
            fits = [search.allowed(fewer + (np.arange(12) == q)) for q in range(12)]
            assert search.fitting(fewer).tolist() == np.flatnonzero(fits).tolist()
            counts[True], counts[False] = counts[True] + sum(fits), counts[False] + 12 - sum(fits)
    assert min(counts.values()) > 150
