"""Every criterion's optimum is certified from the problem alone, known cases come out, and no search finds better."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from design_case import duration_problem, random_matrices
from expdesign.durations import Aim, DurationProblem, efficiencies, optimal_shares, solve_durations
from expdesign.durations.concave import Collected
from expdesign.errors import InputError, UnknownName
from expdesign.values import Array

CRITERIA = ("D", "D_s", "A", "E", "V")
every = pytest.mark.parametrize("criterion", CRITERIA)


def aim(criterion: str, parameters: int, seed: int = 0) -> Aim:
    """Units, noise and gradients that differ from parameter to parameter; two parameters of interest for D_s."""
    rng = np.random.default_rng(seed)
    return Aim(
        criterion=criterion,
        interest=("parameter 0", "parameter 1") if criterion == "D_s" else (),
        unit=rng.uniform(0.1, 10, parameters),
        noise=rng.uniform(0.1, 1, parameters),
        outcomes=("a", "b"),
        gradients=rng.standard_normal((2, parameters)),
    )


def problem(criterion: str, draw: int, *, count: int = 15, parameters: int = 5) -> DurationProblem:
    rng = np.random.default_rng(draw)
    matrices = random_matrices(rng, count=count, parameters=parameters, outputs=2, samples=parameters + 2)
    return replace(duration_problem(matrices, means=2), aim=aim(criterion, parameters, draw))


def by_definition(given: DurationProblem, w: Array) -> float:
    """The criterion as -log of its textbook form, from the covariance after mean subtraction."""
    p, given_aim = len(given.parameters), given.aim
    B = np.tensordot(w, given.matrices, axes=1)
    C = np.linalg.inv(B[:p, :p] - B[:p, p:] @ np.linalg.solve(B[p:, p:], B[p:, :p]))
    physical = C * np.outer(given_aim.noise, given_aim.noise)
    relative = physical / np.outer(given_aim.unit, given_aim.unit)
    match given_aim.criterion:
        case "D":
            return -float(np.linalg.slogdet(C)[1])
        case "D_s":
            return -float(np.linalg.slogdet(C[:2, :2])[1])
        case "A":
            return -float(np.log(np.trace(relative)))
        case "E":
            return float(np.log(np.linalg.eigvalsh(np.linalg.inv(relative))[0]))
    return -float(np.log(np.trace(given_aim.gradients @ physical @ given_aim.gradients.T)))


@every
@pytest.mark.parametrize("draw", range(8))
def test_the_value_is_the_textbook_one_and_no_random_design_beats_the_bound(criterion: str, draw: int):
    given = problem(criterion, draw)
    design = optimal_shares(given)
    proof = design.certificate
    assert design.gap_relative < 1e-6
    assert proof.value == pytest.approx(by_definition(given, design.fractions), abs=1e-9)
    rng = np.random.default_rng(draw)
    for w in rng.dirichlet(np.full(15, 0.5), 100):
        assert by_definition(given, w) <= proof.bound + 1e-9
        near = 0.99 * design.fractions + 0.01 * w
        assert by_definition(given, near) <= proof.bound + 1e-9


@every
def test_local_searches_find_nothing_better(criterion: str):
    for draw in range(2):
        given = problem(criterion, draw, count=8, parameters=4)
        best = optimal_shares(given).certificate.value
        for start in np.random.default_rng(draw).dirichlet(np.ones(8), 4):
            found = minimize(lambda v, g=given: -by_definition(g, np.exp(v) / np.exp(v).sum()), np.log(start + 1e-3))
            assert -found.fun < best + 1e-6


@every
def test_the_sensitivities_are_the_slope_and_level_where_time_is_free(criterion: str):
    given = problem(criterion, 3)
    design = optimal_shares(given)
    used = design.fractions > 1e-6
    level = design.certificate.level
    # E is not differentiable at its optimum: its slope is a mixture, accurate to the square root of the gap.
    np.testing.assert_allclose(design.sensitivities[used], level, rtol=1e-4 if criterion != "E" else 2e-3)
    assert (design.sensitivities <= level * (1 + 1e-6)).all()
    if criterion != "E":
        w, step = np.full(15, 1 / 15), 1e-6
        slope = [(by_definition(given, w + step * e) - by_definition(given, w - step * e)) / (2 * step)
                 for e in np.eye(15)]  # fmt: skip
        from_package = Collected.of(given).pieces[0].tangent(w).slope
        np.testing.assert_allclose(slope, from_package, rtol=1e-4, atol=1e-4)


@every
@pytest.mark.parametrize("seed", range(2))
def test_units_of_the_parameters_do_not_change_the_shares(criterion: str, seed: int):
    given = problem(criterion, 5)
    factor = 10.0 ** np.random.default_rng(seed).uniform(-6, 6, 5)  # new parameter = old / factor
    scale = np.r_[factor, np.ones(2)]
    there = replace(
        given,
        matrices=given.matrices * np.outer(scale, scale),
        aim=replace(given.aim, unit=given.aim.unit / factor, gradients=given.aim.gradients * factor),
    )
    here, other = optimal_shares(given), optimal_shares(there)
    np.testing.assert_allclose(other.fractions, here.fractions, atol=1e-5 if criterion != "E" else 1e-2)
    if criterion not in ("D", "D_s"):
        assert other.certificate.value == pytest.approx(here.certificate.value, abs=2e-6)


def test_with_one_parameter_all_criteria_agree():
    matrices = np.array([[[3.0]], [[5.0]], [[1.0]]])
    for criterion in CRITERIA:
        given_aim = Aim(
            criterion=criterion, interest=("parameter 0",), unit=np.ones(1), noise=np.ones(1), outcomes=("a",),
            gradients=np.ones((1, 1)),
        )  # fmt: skip
        design = optimal_shares(replace(duration_problem(matrices), aim=given_aim))
        np.testing.assert_allclose(design.fractions, [0, 1, 0], atol=1e-6)


def test_the_a_optimal_shares_of_independent_parameters_are_as_their_standard_deviations():
    # Minimise sum c_q / w_q: w_q as sqrt(c_q). Parameter q is seen by primitive q alone, information a_q.
    a = np.array([1.0, 4.0, 25.0])
    matrices = np.array([np.diag(a * (np.arange(3) == q)) for q in range(3)])
    given_aim = Aim(criterion="A", unit=np.ones(3), noise=np.ones(3))
    w = optimal_shares(replace(duration_problem(matrices), aim=given_aim)).fractions
    np.testing.assert_allclose(w, a**-0.5 / (a**-0.5).sum(), atol=1e-7)


def test_the_e_optimal_shares_of_independent_parameters_level_their_eigenvalues():
    a = np.array([1.0, 4.0, 25.0])
    matrices = np.array([np.diag(a * (np.arange(3) == q)) for q in range(3)])
    given_aim = Aim(criterion="E", unit=np.ones(3), noise=np.ones(3))
    design = optimal_shares(replace(duration_problem(matrices), aim=given_aim))
    np.testing.assert_allclose(design.fractions, (1 / a) / (1 / a).sum(), atol=1e-5)
    assert np.exp(design.certificate.bound) == pytest.approx(1 / (1 / a).sum(), rel=1e-5)


def test_d_s_ignores_the_volume_of_nuisance_parameters():
    # Straight line with nuisance intercept: the slope alone wants the ends, half and half; D wants the same here,
    # quadratic with nuisance lower terms wants 1/4, 1/2, 1/4 (Kiefer 1961; Atkinson and Donev, D_s for the top term).
    rows = np.vander(np.linspace(-1, 1, 41), 3)
    given = duration_problem(rows[:, :, None] * rows[:, None, :])
    design = optimal_shares(replace(given, aim=Aim(criterion="D_s", interest=("parameter 0",))))
    np.testing.assert_allclose(design.fractions[[0, 20, 40]], [0.25, 0.5, 0.25], atol=1e-6)


@every
def test_no_design_is_more_efficient_than_the_optimum_and_the_table_agrees_with_the_definition(criterion: str):
    given = problem(criterion, 7)
    given = replace(given, aim=replace(given.aim, interest=("parameter 0", "parameter 1")), run_s=np.full(15, 20.0))
    design = solve_durations(given)
    table = {item.criterion: item for item in efficiencies(design)}
    assert set(table) == set(CRITERIA)
    for item in table.values():
        assert not item.missing
        assert all(0 < value <= 1 + 1e-6 for value in item.of.values())
    assert table[criterion].of["continuous"] == pytest.approx(1.0)
    assert table[criterion].of["repeats"] == pytest.approx(design.efficiency_repeats)


def test_settings_that_a_criterion_lacks_are_named():
    given = duration_problem(random_matrices(np.random.default_rng(0), count=6, parameters=3, outputs=1, samples=6))
    for criterion, words in (("A", "needs a unit"), ("E", "needs a unit"), ("V", "needs outcomes")):
        with pytest.raises(InputError, match=words):
            optimal_shares(replace(given, aim=Aim(criterion=criterion)))
    with pytest.raises(UnknownName, match="did you mean 'D_s'"):
        optimal_shares(replace(given, aim=Aim(criterion="Ds")))
    with pytest.raises(UnknownName, match="parameter of interest 'X'"):
        optimal_shares(replace(given, aim=Aim(criterion="D_s", interest=("X",))))
