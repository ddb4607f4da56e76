"""Equation-wise samples: identities, the samples chosen, and the bias that they remove."""

from dataclasses import replace

import numpy as np
import pytest

from estimation_case import NOMINAL, QUIET, TRUE, commands, measured, record, truth
from expdesign.errors import InputError, NotInformative
from expdesign.estimation.excitation import EQUATION_WISE, WorstCase, worst_case
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.estimation.regression import Regression
from expdesign.estimation.solve import Weighting, solve_iv
from expdesign.vessel import Sensors
from measured_trials import prompt

MARGIN = WorstCase(velocity_mps=0.3)
APART = Settings(samples=EQUATION_WISE, worst=MARGIN)


def half_clear(samples: int, rng: np.random.Generator) -> np.ndarray:
    """Sway clear of zero in the first half, around zero in the second; surge clear in both."""
    return np.concatenate([commands(samples // 2, rng), commands(samples - samples // 2, rng, angle=0.0, spread=0.5)])


def drawn(rng: np.random.Generator, rows: int = 400) -> tuple[Regression, np.ndarray]:
    """Two outputs with two and three parameters, and instruments."""
    Phi, Z = np.zeros((rows, 2, 5)), np.zeros((rows, 2, 5))
    for output, columns in ((0, [0, 1]), (1, [2, 3, 4])):
        Z[:, output, columns] = 1.0 + rng.normal(size=(rows, len(columns)))
        Phi[:, output, columns] = Z[:, output, columns] + 0.2 * rng.normal(size=(rows, len(columns)))
    y = Phi @ np.array([1.0, -2.0, 0.5, 3.0, -1.0]) + rng.normal(size=(rows, 2))
    chosen = rng.random((rows, 2)) < [0.8, 0.4]
    batch = np.repeat([0, 1], rows // 2)
    strata = chosen.astype(np.int64)
    return Regression(parameters=tuple("abcde"), Phi=Phi, y=y, batch=batch, strata=strata), Z


@pytest.mark.parametrize("mean", ["none", "batch", "complete"])
@pytest.mark.parametrize("covariance", ["components", "hac", "hc0"])
def test_each_equation_is_solved_by_its_own_rows(mean: str, covariance: str) -> None:
    regression, Z = drawn(np.random.default_rng(1))
    weighting = Weighting(mean=mean, covariance=covariance)
    found = solve_iv(regression, Z, weighting)
    assert regression.chosen is not None
    for output, columns in ((0, [0, 1]), (1, [2, 3, 4])):
        rows = np.flatnonzero(regression.chosen[:, output])
        alone = Regression(
            parameters=tuple("abcde"[index] for index in columns),
            Phi=regression.Phi[np.ix_(rows, [output], columns)],
            y=regression.y[np.ix_(rows, [output])],
            batch=regression.batch_of[rows],
            step=regression.step_of[rows],
        )
        own = solve_iv(alone, Z[np.ix_(rows, [output], columns)], weighting)
        np.testing.assert_allclose(found.values[columns], own.values, rtol=1e-10)
        np.testing.assert_allclose(found.covariance[np.ix_(columns, columns)], own.covariance, rtol=1e-8)
    assert np.linalg.eigvalsh(found.covariance)[0] > 0
    assert not found.residuals[~regression.chosen].any()


def test_a_mean_over_chosen_rows_is_a_constant_there() -> None:
    """Lemma 7.1 for the rows of an equation."""
    regression, Z = drawn(np.random.default_rng(2))
    assert regression.chosen is not None
    one = np.ones((len(regression), 1))
    constants = np.stack([np.hstack([one, 0 * one]), np.hstack([0 * one, one])], axis=2)
    wider = replace(regression, parameters=tuple("abcdefg"), Phi=np.concatenate([regression.Phi, constants], axis=2))
    found = solve_iv(regression, Z, Weighting(mean="complete"))
    other = solve_iv(wider, np.concatenate([Z, constants], axis=2), Weighting(mean="none"))
    np.testing.assert_allclose(found.values, other.values[:5], rtol=1e-9)


def test_either_side_of_zero_has_a_mean_of_its_own() -> None:
    """Two strata are one constant each: the mean of the noise of |y| y changes its sign with y."""
    rng = np.random.default_rng(8)
    x = np.concatenate([rng.uniform(1.0, 2.0, 300), -rng.uniform(1.0, 2.0, 500)])
    y = x + 0.5 * rng.normal(size=len(x)).clip(-1.9, 1.9)
    Phi, Z = (np.stack([np.abs(value) * value, value], axis=1)[:, None] for value in (y, x))
    strata = np.where(x > 0, 2, 1)[:, None]
    regression = Regression(parameters=("a", "b"), Phi=Phi, y=(np.abs(x) * x - x)[:, None], strata=strata)
    found = solve_iv(regression, Z, Weighting(mean="complete"))
    sides = np.stack([(x > 0), (x < 0)], axis=1).astype(float)[:, None]
    wider = replace(regression, parameters=tuple("abcd"), strata=None, Phi=np.concatenate([Phi, sides], axis=2))
    other = solve_iv(wider, np.concatenate([Z, sides], axis=2), Weighting(mean="none"))
    np.testing.assert_allclose(found.values, other.values[:2], rtol=1e-9)


def test_rows_that_all_equations_use_change_nothing() -> None:
    batch = measured(TRUE, commands(600, np.random.default_rng(3)))
    plain = estimate(record(batch), NOMINAL, method="iv")
    apart = estimate(record(batch), NOMINAL, method="iv", settings=Settings(samples=EQUATION_WISE))
    assert apart.residuals.rows_of.tolist() == [598] * 3
    np.testing.assert_array_equal(plain.values, apart.values)
    np.testing.assert_array_equal(plain.joint_covariance, apart.joint_covariance)


@pytest.mark.parametrize("quadrature", ["euler", "trapezoid"])
def test_samples_are_those_where_the_moduli_of_an_equation_are_clear(quadrature: str) -> None:
    """Instruments of the true ship are the motion itself: sway and yaw need sway, surge needs surge."""
    batch = measured(QUIET, half_clear(800, np.random.default_rng(4)))
    settings = replace(APART, quadrature=quadrature, most_refinements=0)
    found = estimate(record(batch), TRUE.model, method="iv", settings=settings)
    side = np.where(np.abs(batch.velocity[:, :2]) > MARGIN.velocity_mps, np.sign(batch.velocity[:, :2]), 0)
    if quadrature == "trapezoid":
        side = np.where(side == np.concatenate([side[1:], side[-1:]]), side, 0)
    surge, sway = (side != 0)[1:-1].sum(axis=0).tolist()  # the first row shares its noise with the instruments' start
    counts = found.residuals.rows_of.tolist()
    if quadrature == "euler":
        np.testing.assert_allclose(counts, [surge, sway, sway], atol=1)  # one lies on the margin but for rounding
    np.testing.assert_allclose(counts, [surge, sway, sway], rtol=0.02)  # the rule is not the map that data are made by
    assert sway < 0.9 * surge
    assert (side[:, 1] < 0).sum() > 5
    assert any("Equation-wise samples" in note for note in found.warnings)


def test_least_squares_goes_by_measured_samples_and_output_error_by_all() -> None:
    batch = measured(TRUE, half_clear(300, np.random.default_rng(5)))
    found = estimate(record(batch), NOMINAL, method="ls", settings=APART)
    sway = int((np.abs(batch.velocity[:-1, 1]) > MARGIN.velocity_mps).sum())
    assert found.residuals.rows_of[1:].tolist() == [sway, sway]
    assert len(set(estimate(record(batch), NOMINAL, method="oe", settings=APART).residuals.rows_of.tolist())) == 1


def test_what_cannot_be_chosen_is_refused() -> None:
    batch = measured(TRUE, commands(200, np.random.default_rng(6)))
    fast = replace(APART, worst=WorstCase(current_mps=9.0))
    with pytest.raises(NotInformative, match="no sample keeps u clear of zero"):
        estimate(record(batch), NOMINAL, method="iv", settings=fast)
    with pytest.raises(InputError, match="without a steady current"):
        estimate(record(batch), NOMINAL, method="iv-current", settings=APART)


@pytest.mark.slow
def test_the_bias_of_moduli_that_change_their_sign_vanishes() -> None:
    """In 40 trials: sway drag is off by more than four standard errors with all samples, by less than three without.

    Orders jump by more than the thrusters turn in a second; these follow at once, so that orders are what drives.
    """
    loud = replace(prompt(TRUE), sensors=Sensors(velocity_mps=0.1, yaw_rate_radps=0.01, heading_rad=0.005))
    bias, held = {}, []
    for samples in ("all", EQUATION_WISE):
        settings, errors = Settings(samples=samples, worst=worst_case(loud.sensors)), []
        for trial in range(40):
            batch = measured(loud, half_clear(3000, np.random.default_rng(500 + trial)), seed=trial)
            found = estimate(record(batch), NOMINAL, method="iv", settings=settings)
            errors.append(found.values - truth(found.names))
            if samples == EQUATION_WISE:
                held.append(np.abs(errors[-1]) < 1.96 * found.std)
        bias[samples] = np.abs(np.mean(errors, axis=0)) / np.std(errors, axis=0) * np.sqrt(40)
        place = found.names.index("Y_v")
    assert bias["all"][place] > 4
    assert bias[EQUATION_WISE].max() < 3
    assert abs(np.mean(held) - 0.95) < 0.03
