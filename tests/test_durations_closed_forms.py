"""Designs that are known in closed form come out."""

import numpy as np
import pytest

from design_case import duration_problem
from expdesign.durations import solve_durations
from expdesign.values import Array


def fractions(matrices: Array | list[Array], **options: int) -> Array:
    """Optimal time fractions of bare matrices."""
    return solve_durations(duration_problem(matrices, **options)).fractions


def regression(points: Array, degree: int) -> Array:
    """B_q of polynomial regression observed at each point, with intercept."""
    rows = np.vander(points, degree + 1)
    return rows[:, :, None] * rows[:, None, :]


def test_two_primitives_that_inform_about_one_parameter_each_share_half_and_half():
    np.testing.assert_allclose(fractions([np.diag([3.0, 0.0]), np.diag([0.0, 7e-4])]), 0.5, atol=1e-7)


@pytest.mark.parametrize("p", [1, 3, 10])
def test_as_many_primitives_as_parameters_share_equally_whatever_their_information(p: int):
    rows = np.random.default_rng(p).standard_normal((p, p))  # one direction each, not even orthogonal
    np.testing.assert_allclose(fractions(rows[:, :, None] * rows[:, None, :]), 1 / p, atol=1e-7)


@pytest.mark.parametrize(
    ("degree", "support"),
    [
        (1, [-1.0, 1.0]),
        (2, [-1.0, 0.0, 1.0]),
        (3, [-1.0, -1 / np.sqrt(5), 1 / np.sqrt(5), 1.0]),
        (4, [-1.0, -np.sqrt(3 / 7), 0.0, np.sqrt(3 / 7), 1.0]),
    ],
)
def test_polynomial_regression_is_observed_at_the_classic_points(degree: int, support: list[float]):
    # P. G. Hoel (1958) and J. Kiefer (1959): equal weight on the zeros of (1 - x^2) P_m'(x), P_m Legendre's.
    others = np.setdiff1d(np.linspace(-1, 1, 81), support)
    points = np.r_[support, others]
    problem = duration_problem(regression(points, degree))
    design = solve_durations(problem)
    np.testing.assert_allclose(design.fractions[: degree + 1], 1 / (degree + 1), atol=1e-6)
    assert design.fractions[degree + 1 :].max() < 1e-6
    assert design.sensitivities.max() == pytest.approx(degree + 1, rel=1e-9)


def test_taking_the_mean_off_is_estimating_an_intercept():
    # The bordered matrix of x and x^2 with one mean is that of the quadratic with intercept.
    points = np.linspace(-1, 1, 41)
    with_intercept = regression(points, 2)  # columns x^2, x, 1
    np.testing.assert_allclose(fractions(with_intercept, means=1), fractions(with_intercept), atol=1e-7)
    np.testing.assert_allclose(fractions(with_intercept, means=1)[[0, 20, 40]], 1 / 3, atol=1e-6)


def test_a_straight_line_through_the_origin_is_observed_where_it_is_steepest():
    points = np.array([0.1, 0.5, 1.0, -0.9])
    np.testing.assert_allclose(fractions((points**2)[:, None, None]), [0, 0, 1, 0], atol=1e-7)


def test_duplicates_share_what_one_of_them_would_get():
    matrices = regression(np.linspace(-1, 1, 5), 2)
    once = fractions(matrices)
    doubled = fractions(np.concatenate([matrices, matrices[[0, 0]]]))
    np.testing.assert_allclose(doubled[[0, 5, 6]], once[0] / 3, atol=1e-6)
    np.testing.assert_allclose(doubled[1:5], once[1:5], atol=1e-6)


def test_a_primitive_that_only_repeats_less_of_another_gets_no_time():
    matrices = regression(np.linspace(-1, 1, 5), 2)
    with_weak = np.concatenate([matrices, 0.5 * matrices[:1]])
    design = solve_durations(duration_problem(with_weak))
    assert design.fractions[5] < 1e-7
    assert design.sensitivities[5] == pytest.approx(design.sensitivities[0] / 2)


def test_the_efficiency_of_equal_shares_is_the_ratio_of_determinants():
    # Two parameters, three primitives: 1/2, 1/2, 0 against 1/3 each: (4/9)^(1/2) = 2/3.
    empty = solve_durations(duration_problem([np.diag([1.0, 0.0]), np.diag([0.0, 1.0]), 1e-9 * np.eye(2)]))
    assert empty.efficiency_uniform == pytest.approx(2 / 3, rel=1e-6)


def test_a_single_primitive_gets_everything():
    design = solve_durations(duration_problem([np.array([[2.0, 0.5], [0.5, 1.0]])], run_s=10.0, total_s=95.0))
    assert design.fractions.tolist() == [1.0]
    assert design.repeats == (9,)
    assert design.gap == pytest.approx(0.0, abs=1e-12)
    assert design.efficiency_repeats == pytest.approx(90 / 95)
    assert design.durations_s.tolist() == [95.0]
