"""Criteria about some parameters: nuisance parameters must be identifiable, unless the estimator merges regressors."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from design_case import duration_problem, one_line, random_matrices
from expdesign.durations import Aim, DurationProblem, optimal_shares, solve_durations, with_repeats
from expdesign.durations.concave import Collected, merged_nuisance, unidentifiable
from expdesign.durations.criteria import LogDet, LogSmallest, LogTrace, stacked_values
from expdesign.errors import NotInformative

OF_INTEREST = Aim(criterion="D_s", interest=("parameter 0",))


def steady_signs() -> DurationProblem:
    """Parameter 0 beside the regressors f and s f, where the sign s is 1 throughout the first four runs."""
    rng = np.random.default_rng(3)
    matrices = []
    for sign in (1, 1, 1, 1, -1, -1):
        f = rng.standard_normal(50)
        own = rng.standard_normal(50) * (3.0 if sign > 0 else 0.5) + 0.3 * f
        rows = np.stack([own, f, sign * f])
        matrices.append(rows @ rows.T / 50)
    problem = duration_problem(matrices, run_s=60.0, total_s=600.0)
    return replace(problem, aim=OF_INTEREST, nuisance=("parameter 1", "parameter 2"))


def test_regressors_that_coincide_are_counted_once_only_where_they_stand_for_disturbances():
    problem = steady_signs()
    first = np.array([1.0, 1, 1, 1, 0, 0]) / 4
    assert merged_nuisance(problem, first) == (("parameter 2", "parameter 1"),)
    assert unidentifiable(problem, first) == ()
    assert merged_nuisance(problem, np.full(6, 1 / 6)) == ()
    own = replace(problem, nuisance=())
    assert unidentifiable(own, first) == ("parameter 1", "parameter 2")


def test_runs_with_steady_signs_have_the_value_of_the_merged_regression():
    design = solve_durations(steady_signs())
    runs = np.array(design.repeats)
    assert runs[:4].sum() == 10  # the strong ones, although they do not separate parameters 1 and 2
    assert "parameter 2 with parameter 1" in design.note
    assert one_line(design.note)
    problem = design.problem
    merged = replace(
        problem,
        parameters=problem.parameters[:2],
        matrices=problem.matrices[:4, :2, :2],
        names=problem.names[:4],
        run_s=problem.run_s[:4],
        nuisance=("parameter 1",),
        prior=np.zeros((2, 2)),
        sampled=np.zeros((0, 4, 2, 2)),
    )
    alone = Collected.of(merged).value(runs[:4] / 10)
    assert Collected.of(problem).value(runs / 10) == pytest.approx(alone, abs=1e-9)
    best = solve_durations(merged)
    assert design.efficiency_repeats == pytest.approx(best.efficiency_repeats, rel=1e-5)


def test_without_an_estimator_that_merges_every_parameter_has_to_be_seen():
    design = solve_durations(replace(steady_signs(), nuisance=()))
    assert sum(design.repeats[4:]) >= 1
    assert design.note == ""
    with pytest.raises(NotInformative, match="do not inform about every parameter"):
        with_repeats(design, (10, 0, 0, 0, 0, 0))


@pytest.mark.parametrize("draw", range(4))
def test_whole_runs_that_must_see_everything_are_nearly_the_best_such_set(draw: int):
    # Two strong primitives inform about parameter 0 only, four weak ones about all.
    rng = np.random.default_rng(draw)
    weak = random_matrices(rng, count=4, parameters=3, outputs=1, samples=2)[:, :3, :3]
    strong = [np.diag([c, 0.0, 0.0]) for c in (50.0, 60.0)]
    problem = replace(duration_problem([*strong, *weak], run_s=100.0, total_s=600.0), aim=OF_INTEREST)
    design = solve_durations(problem)
    assert unidentifiable(problem, np.array(design.repeats) / 6) == ()
    criterion = Collected.of(problem)
    best = max(
        criterion.value(np.array(runs) / 6)
        for runs in product(range(7), repeat=6)
        if sum(runs) == 6 and not unidentifiable(problem, np.array(runs) / 6)
    )
    assert criterion.value(np.array(design.repeats) / 6) >= best + np.log(0.97)


@pytest.mark.parametrize("measure", [LogDet, LogTrace, LogSmallest])
def test_a_singular_matrix_has_the_limit_value_where_the_parameters_of_interest_are_estimable(measure: type):
    rng = np.random.default_rng(1)
    half = rng.standard_normal((5, 3))
    M, L = half @ half.T, half @ rng.standard_normal((3, 2))  # columns of L lie in the range of M
    value = stacked_values(measure(L), M[None])[0]
    near = stacked_values(measure(L), (M + 1e-9 * np.eye(5))[None])[0]
    assert value == pytest.approx(near, abs=1e-6)
    outside = measure(np.c_[L, rng.standard_normal(5)])
    assert stacked_values(outside, M[None])[0] == -np.inf


def test_limits_without_information_about_parameters_name_them():
    problem = duration_problem([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])])
    for limits in ({"excluded": ("primitive 1",)}, {"most_s": {"primitive 1": 1e-14}}):
        narrowed = replace(problem, constraints=replace(problem.constraints, **limits))
        with pytest.raises(NotInformative) as caught:
            optimal_shares(narrowed)
        assert caught.value.parameters == ("parameter 1",)
        assert one_line(caught.value)
