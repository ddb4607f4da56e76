"""Several models, prior information, recorded primitives, subsets of batches, fused covariances."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from design_case import duration_problem, example_dictionary, random_matrices, scored_example, vessel
from expdesign.durations import (
    Aim,
    Budget,
    Constraints,
    DurationProblem,
    best_subset,
    build_durations,
    build_fused,
    monte_carlo_covariance,
    optimal_shares,
    solve_durations,
)
from expdesign.durations.solve import log_abs_det
from expdesign.errors import InputError, NotInformative
from expdesign.information import score_models, score_primitives
from expdesign.information.prior import score_prior, stated_information
from expdesign.information.recorded import BatchInformation
from expdesign.values import Array


def several(seed: int = 0, models: int = 5) -> DurationProblem:
    stacks = [
        random_matrices(np.random.default_rng(seed + m), count=10, parameters=4, outputs=1, samples=8)
        for m in range(models)
    ]
    return replace(duration_problem(stacks[0], means=1), sampled=np.array(stacks), robust="average")


def values(problem: DurationProblem, w: Array) -> Array:
    return np.array([np.linalg.slogdet(np.tensordot(w, stack, axes=1))[1] for stack in problem.sampled])


@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize("robust", ["average", "worst"])
def test_no_design_is_better_over_the_models_than_the_bound(robust: str, limited: bool):
    """By random mixtures with the optimum, of which those count that keep to the limits."""
    problem = replace(several(), robust=robust)
    name, other = (problem.names[place] for place in np.argsort(-optimal_shares(problem).fractions)[:2])
    if limited:
        cost = Budget(name="energy", cost_per_s={other: 2.0}, limit=0.2 * problem.total_s)
        problem = replace(problem, constraints=Constraints(most_s={name: 0.1 * problem.total_s}, budgets=(cost,)))
    design = optimal_shares(problem)
    over = np.mean if robust == "average" else np.min
    assert design.gap_relative < 1e-6
    assert design.certificate.value == pytest.approx(over(values(problem, design.fractions)), abs=1e-8)
    assert design.certificate.mixture.sum() == pytest.approx(1.0)
    own, costly = problem.names.index(name), problem.names.index(other)
    tried = 0
    for w in np.random.default_rng(0).dirichlet(np.full(10, 0.7), 300):
        mixed = 0.9 * design.fractions + 0.1 * w
        if not limited or (mixed[own] <= 0.1 and 2.0 * mixed[costly] <= 0.2):
            tried += 1
            assert over(values(problem, mixed)) <= design.certificate.bound + 1e-9
    assert tried > 10


def test_models_with_a_weight_in_the_worst_case_are_the_worst_ones():
    problem = replace(several(3), robust="worst")
    design = optimal_shares(problem)
    found = values(problem, design.fractions)
    np.testing.assert_allclose(found[design.certificate.mixture > 1e-3], found.min(), atol=1e-5)


def test_one_model_many_times_is_the_model():
    plain = several().matrices
    for robust in ("average", "worst"):
        problem = replace(several(), sampled=np.array([plain] * 3), robust=robust)
        alone = optimal_shares(duration_problem(plain, means=1))
        np.testing.assert_allclose(optimal_shares(problem).fractions, alone.fractions, atol=1e-4)


def test_models_scored_together_are_those_scored_alone():
    ship, primitives = vessel("azimuth-30m"), example_dictionary("standard")[::4]
    theta = ship.model.parameters * np.array([[1.0], [1.1], [0.9]])
    together = score_models(ship, primitives, theta)
    for parameters, (items, stable) in zip(theta, together, strict=True):
        assert stable
        other = replace(ship, model=ship.model.with_parameters(parameters))
        for a, b in zip(items, score_primitives(other, primitives), strict=True):
            size = np.sqrt(np.where(np.diag(b.X) > 0, np.diag(b.X), 1.0))
            np.testing.assert_allclose(a.X / np.outer(size, size), b.X / np.outer(size, size), atol=1e-11)


def test_models_of_the_prior_are_the_same_for_the_same_seed():
    ship, primitives = vessel("azimuth-30m"), example_dictionary("standard")[:1]
    first, again = (score_prior(ship, primitives, samples=2, rng=np.random.default_rng(5))[0] for _ in range(2))
    np.testing.assert_array_equal(first[1][0].X, again[1][0].X)


def test_data_from_before_are_completed_not_repeated():
    # Primitive 0 informs about the first parameter only; with as much prior information, all time goes to the other.
    problem = duration_problem([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])])
    half = optimal_shares(problem).fractions
    np.testing.assert_allclose(half, 0.5, atol=1e-7)
    known = optimal_shares(replace(problem, prior=np.diag([0.4, 0.0]))).fractions
    np.testing.assert_allclose(known, [0.3, 0.7], atol=1e-6)  # both end at 0.7: (0.4 + w)(1 - w) is largest there
    much = optimal_shares(replace(problem, prior=np.diag([3.0, 0.0]))).fractions
    np.testing.assert_allclose(much, [0.0, 1.0], atol=1e-6)


def test_a_prior_completes_a_dictionary_without_information_about_a_parameter():
    problem = duration_problem([np.diag([1.0, 0.0]), np.diag([2.0, 0.0])])
    with pytest.raises(NotInformative):
        optimal_shares(problem)
    design = optimal_shares(replace(problem, prior=np.diag([0.0, 1e-3])))
    np.testing.assert_allclose(design.fractions, [0, 1], atol=1e-6)


def test_a_stated_standard_deviation_counts_as_so_many_samples_with_that_noise():
    prior = stated_information(np.diag([0.01, 0.0]), np.array([0.5, 0.5]), dimension=3, samples=50.0)
    # 50 samples of regressor 1 with noise 0.5 have information 50 / 0.25 = 200; the prior has 1 / 0.01 = 100.
    np.testing.assert_allclose(prior, np.diag([100 / 200, 0.0, 0.0]))


def test_information_of_correlated_parameters_is_the_inverse_of_their_covariance():
    covariance, noise = np.array([[0.04, 0.03], [0.03, 0.09]]), np.array([0.5, 2.0])
    prior = stated_information(covariance, noise, dimension=2, samples=50.0)
    # information of 50 samples about estimates in units of each equation's noise
    np.testing.assert_allclose(50.0 * prior / np.outer(noise, noise), np.linalg.inv(covariance))


def recorded(noise: float, draw: int) -> DurationProblem:
    rng = np.random.default_rng(draw)
    matrices = random_matrices(rng, count=8, parameters=4, outputs=1, samples=8)
    matrices[:, :4, :4] += noise * rng.standard_normal((8, 4, 4))
    return duration_problem(matrices, means=1)


@pytest.mark.parametrize("noise", [0.2, 1.0, 3.0])
def test_recorded_primitives_get_at_least_the_guaranteed_value(noise: float):
    guaranteed = 0
    for draw in range(5):
        design = solve_durations(recorded(noise, draw))
        problem, proof = design.problem, design.certificate
        assert design.log_det == pytest.approx(log_abs_det(problem, design.fractions))
        assert not np.isfinite(proof.bound)
        if np.isfinite(proof.guaranteed):
            guaranteed += 1
            assert design.log_det >= proof.guaranteed - 1e-9
            for w in np.random.default_rng(0).dirichlet(np.full(8, 0.5), 100):
                assert log_abs_det(problem, w, symmetric=True) <= proof.guaranteed + 1e-5
        assert design.fractions.sum() == pytest.approx(1.0)
    assert guaranteed > 0


def test_without_a_definite_symmetric_part_the_local_search_remains():
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])  # antisymmetric: its symmetric part is zero, its determinant is not
    design = solve_durations(duration_problem([turn, 2 * turn]))
    assert "no fractions make the symmetric part positive definite" in design.certificate.kind
    np.testing.assert_allclose(design.fractions, [0, 1], atol=1e-6)
    assert design.log_det == pytest.approx(np.log(4.0))


def test_other_criteria_refuse_recorded_primitives():
    with pytest.raises(InputError, match="need criterion D"):
        solve_durations(replace(recorded(0.2, 0), aim=Aim(criterion="A", unit=np.ones(4), noise=np.ones(4))))


def batches(draw: int, count: int, samples: int = 20) -> list[BatchInformation]:
    rng = np.random.default_rng(draw)
    matrices = random_matrices(rng, count=count, parameters=3, outputs=1, samples=5)
    lengths = rng.integers(samples // 2, samples, count)
    return [
        BatchInformation(name=f"batch {q}", seconds=float(n), samples=int(n), X=B[:3, :3], Y=B[:3, 3:], Z=B[:3, 3:])
        for q, (B, n) in enumerate(zip(matrices, lengths, strict=True))
    ]


def collected(items: list[BatchInformation], chosen: tuple[int, ...]) -> float:
    total = sum(items[q].samples * items[q].bordered("complete") for q in chosen)
    return float(np.linalg.slogdet(total[:3, :3] - total[:3, 3:] @ total[3:, :3] / total[3, 3])[1])


@pytest.mark.parametrize("draw", range(3))
def test_the_best_subset_is_the_best_of_all(draw: int):
    items = batches(draw, 8)
    subset = best_subset(items, ("a", "b", "c"), size=3)
    best = max(combinations(range(8), 3), key=lambda chosen: collected(items, chosen))
    assert subset.chosen == tuple(f"batch {q}" for q in best)
    assert subset.exact
    ratio = np.exp((collected(items, best) - collected(items, tuple(range(8)))) / 3)
    assert subset.efficiency == pytest.approx(ratio, rel=1e-6)


def test_a_large_choice_has_a_bound_that_holds(monkeypatch: pytest.MonkeyPatch):
    items = batches(1, 12)
    exact = best_subset(items, ("a", "b", "c"), size=5)
    monkeypatch.setattr("expdesign.durations.mining.ALL_SUBSETS", 10)
    quick = best_subset(items, ("a", "b", "c"), size=5)
    assert not quick.exact
    assert quick.efficiency <= exact.efficiency + 1e-9 <= quick.bound + 2e-9
    assert quick.efficiency > 0.9 * quick.bound


def test_fused_covariances_are_shared_out_as_their_information():
    rng = np.random.default_rng(0)
    roots = rng.standard_normal((6, 3, 3))
    covariances = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(3)
    seconds = rng.uniform(50, 150, 6)
    fused = build_fused(
        tuple("abcdef"), ("x", "y", "z"), covariances, seconds=seconds, run_s=np.full(6, 10.0), total_s=600.0
    )
    design = solve_durations(fused)
    times = np.array(design.repeats) * 10.0
    P = np.linalg.inv(sum(t / s * np.linalg.inv(C) for t, s, C in zip(times, seconds, covariances, strict=True)))
    best = np.tensordot(design.fractions * 600 / seconds, np.linalg.inv(covariances), axes=1)
    ratio = np.exp(-(np.linalg.slogdet(P)[1] + np.linalg.slogdet(best)[1]) / 3)
    assert design.efficiency_repeats == pytest.approx(ratio, rel=1e-6)
    assert design.log_det == pytest.approx(np.linalg.slogdet(best)[1], abs=1e-8)


def test_a_primitive_with_a_singular_covariance_cannot_be_fused():
    with pytest.raises(NotInformative, match="'b' is not informative on its own"):
        build_fused(("a", "b"), ("x", "y"), np.array([np.eye(2), np.diag([1.0, 0.0])]), seconds=np.ones(2),
                    run_s=np.ones(2), total_s=10.0)  # fmt: skip
    with pytest.raises(InputError, match="more than 3 finite estimates"):
        monte_carlo_covariance(np.ones((3, 2)), np.ones(2))


def test_bias_counts_in_a_monte_carlo_covariance_as_noise_does():
    """Second moment of b + e about zero: b b^T + C; for b = 0.5 and C = 0.01 that is 0.26."""
    rng = np.random.default_rng(0)
    noise = 0.1 * rng.standard_normal((4000, 1))
    found = monte_carlo_covariance(3.5 + noise, np.array([3.0]))
    # the standard error of the mean square is sqrt((2 C^2 + 4 b^2 C) / 4000) = 0.0016
    assert found[0, 0] == pytest.approx(0.26, abs=5 * 0.0016)
    sample = rng.standard_normal((50, 3)) + np.array([1.0, -2.0, 0.5])
    mean = sample.mean(axis=0)
    np.testing.assert_allclose(
        monte_carlo_covariance(sample, np.zeros(3)),
        monte_carlo_covariance(sample, mean) + np.outer(mean, mean),
        atol=1e-12,
    )
    with pytest.raises(InputError, match="3 parameters need as many"):
        monte_carlo_covariance(sample, np.zeros(2))


def test_monte_carlo_covariances_of_linear_regression_give_the_same_shares_as_its_information():
    rng = np.random.default_rng(1)
    rows = [rng.standard_normal((40, 2)) * scale for scale in ((3, 1), (1, 3))]
    estimates = []
    for Phi in rows:
        noise = rng.standard_normal((4000, 40))
        estimates.append(noise @ Phi @ np.linalg.inv(Phi.T @ Phi))
    covariances = np.array([monte_carlo_covariance(found, np.zeros(2)) for found in estimates])
    fused = build_fused(("a", "b"), ("x", "y"), covariances, seconds=np.full(2, 40.0), run_s=np.ones(2), total_s=100.0)
    exact = duration_problem([Phi.T @ Phi / 40 for Phi in rows])
    # Relative error of a sample covariance of 4000 runs: sqrt(2 / 4000) = 2.2 %; shares move by less than that.
    np.testing.assert_allclose(
        optimal_shares(fused).fractions, optimal_shares(exact).fractions, atol=4 * np.sqrt(2 / 4000)
    )


def test_the_examples_can_be_made_robust_and_the_nominal_design_is_no_better_in_the_worst_case():
    ship, primitives = vessel("model-ship"), example_dictionary("model-ship")
    std = 0.1 * np.abs(ship.model.parameters)
    ship = replace(ship, model=replace(ship.model, parameter_std=std))
    sampled, _ = score_prior(ship, primitives, samples=4, rng=np.random.default_rng(0))
    items, names = scored_example("model-ship"), ship.model.names
    robust = build_durations(items, names, total_s=450.0, sampled=sampled, robust="worst")
    design = optimal_shares(robust)
    nominal = optimal_shares(build_durations(items, names, total_s=450.0))
    assert values(robust, nominal.fractions).min() <= design.certificate.bound + 1e-9
    assert design.certificate.value >= values(robust, nominal.fractions).min() - 1e-6
