"""The parts of residual noise: their expected periodograms and covariances are identities, and misfits are noticed."""

import numpy as np
import pytest

from estimation_case import CALM_CURRENT, NOMINAL, TRUE, commands, measured, record
from expdesign.estimation.methods import estimate
from expdesign.estimation.noise.components import Components, filtered, fit_components, score_covariance
from expdesign.estimation.noise.components import _expected as expected_periodogram
from expdesign.estimation.noise.timeline import stretches
from expdesign.estimation.regression.predictors import build_layout, build_regression
from expdesign.estimation.regression.regression import single_output
from expdesign.estimation.replay.instruments import apart_from_start
from expdesign.estimation.solve.solution import Weighting, solve_iv
from expdesign.estimation.tuning import TUNING

MEMORIES = np.array([4.0, 30.0, np.inf])


def explicit(index: int, count: int) -> np.ndarray:
    """(count, count) covariance of a part with unit variance, written out."""
    lag = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    if index < 2:
        return (1.0 + index) * (lag == 0) - index * (lag == 1)
    return np.exp(-lag / MEMORIES[index - 2])


@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize("index", range(5))
def test_expected_periodograms_and_products_are_those_of_the_covariance_matrix(index: int, gaps: bool) -> None:
    rng = np.random.default_rng(41)
    places = np.sort(rng.choice(60, 45, replace=False)) if gaps else np.arange(60)
    places = places - places[0]
    count = int(places[-1]) + 1
    there = np.isin(np.arange(count), places)
    waves = np.exp(-2j * np.pi * np.outer(np.arange(count // 2 + 1), np.arange(count)) / count) * there
    G, W = explicit(index, count), rng.normal(size=(count, 3))
    spectrum = np.einsum("fi,ij,fj->f", waves, G, waves.conj()).real / len(places)
    np.testing.assert_allclose(expected_periodogram(places, MEMORIES)[index], spectrum, atol=1e-9)
    np.testing.assert_allclose(filtered(index, MEMORIES, W), G @ W, atol=1e-9)


def test_score_covariance_is_that_of_the_matrix_with_batches_and_outputs() -> None:
    rng = np.random.default_rng(42)
    batch = np.repeat([0, 1], [30, 50])
    parts = stretches(batch, np.concatenate([np.arange(30), np.arange(50)]))
    variances = rng.uniform(0.5, 2.0, (2, 5))
    fitted = [Components(row, MEMORIES, 0.0) for row in variances]
    W = [rng.normal(size=(80, 2)), rng.normal(size=(80, 3))]
    level = np.array([1.0, 2.0, 1.0, 1.0, 1.0])
    cross = 0.3 * (np.sqrt(variances[0] * variances[1]) * level).sum()
    # residuals whose products at the same sample are exactly these
    moments = np.array([[1e3, cross], [cross, 1e3]])
    basis = np.linalg.qr(rng.normal(size=(80, 2)))[0] * np.sqrt(80)
    residuals = basis @ np.linalg.cholesky(moments).T
    blocks = score_covariance(W, residuals, fitted, parts)
    for o in range(2):
        for other in range(2):
            shared = 1.0 if o == other else 0.3
            total = np.zeros((80, 80))
            for rows in (slice(0, 30), slice(30, 80)):
                total[rows, rows] = shared * sum(
                    np.sqrt(variances[o, i] * variances[other, i]) * explicit(i, rows.stop - rows.start)
                    for i in range(5)
                )
            np.testing.assert_allclose(blocks[o][other], W[o].T @ total @ W[other], rtol=1e-9)


def test_covariances_are_found_from_many_short_batches() -> None:
    """Lags 0 and 1 and a batch's sum, white + sensor + constant noise: means over repeats, within 4 standard errors."""
    rng = np.random.default_rng(43)
    parts = stretches(np.repeat(np.arange(40), 50), np.tile(np.arange(50), 40))
    found = []
    for _ in range(60):
        e = rng.normal(size=(40, 51))
        eps = 0.5 * rng.normal(size=(40, 50)) + np.diff(e, axis=1) + 0.7 * rng.normal(size=(40, 1))
        (fitted,) = fit_components(eps.reshape(-1, 1), parts)
        columns = [filtered(index, fitted.memories, np.eye(50)) for index in range(len(fitted.variances))]
        total = np.einsum("i,ijk->jk", fitted.variances, columns)
        found.append((total[20, 20], total[20, 21], total.sum()))
    truth = np.array([0.25 + 2 + 0.49, -1 + 0.49, 50 * 0.25 + 2 + 2500 * 0.49])
    chance = np.std(found, axis=0) / np.sqrt(60)
    assert (np.abs(np.mean(found, axis=0) - truth) < 4 * chance + 0.01 * np.abs(truth)).all(), np.mean(found, axis=0)


def test_noise_of_other_shape_is_noticed_and_noise_of_these_parts_is_not() -> None:
    rng = np.random.default_rng(44)
    parts = stretches(np.zeros(2000, dtype=np.int64), np.arange(2000))

    def noticed(noise: np.ndarray) -> float:
        return float(np.mean([fitted.misfit > TUNING.spectrum_misfit for fitted in fit_components(noise.T, parts)]))

    e = rng.normal(size=(100, 2001))
    assert noticed(np.diff(e) + 0.3 * rng.normal(size=(100, 2000))) < 0.01 + 4 * np.sqrt(0.01 * 0.99 / 100)
    waves = e[:, 1:].copy()  # a swell of ten samples
    for k in range(2, 2000):
        waves[:, k] += 1.9 * np.cos(2 * np.pi / 10) * waves[:, k - 1] - 0.9 * waves[:, k - 2]
    assert noticed(waves) == 1.0
    u = rng.normal(size=(2000, 1))
    found = solve_iv(single_output(u, u[:, 0] + waves[0], parameters=("theta",)), u[:, None, :].copy(), Weighting())
    assert any("do not explain the colour" in warning for warning in found.warnings)


def test_variance_that_changes_with_the_instruments_is_allowed_for() -> None:
    """y = theta u + u e: the variance of theta is sum u^4 / (sum u^2)^2, three times that of steady noise."""
    rng = np.random.default_rng(45)
    u = rng.normal(size=(1500, 1))
    exact = float((u**4).sum() / (u**2).sum() ** 2)
    stated = []
    for _ in range(100):
        regression = single_output(u, u[:, 0] * rng.normal(size=1500), parameters=("theta",))
        stated.append(float(solve_iv(regression, u[:, None, :].copy(), Weighting()).covariance[0, 0]))
    assert abs(np.mean(stated) - exact) < 4 * np.std(stated) / 10 + 0.01 * exact


def test_equations_with_instruments_leave_out_the_sample_that_instruments_start_from() -> None:
    """A first velocity measured otherwise moves instruments, but no residual; with the first row it would."""
    batch = measured(TRUE, commands(300, np.random.default_rng(46)), weather=CALM_CURRENT)
    velocity = batch.velocity.copy()
    velocity[0] += 0.05
    layout = build_layout(NOMINAL, record(batch), predictor="basic")
    kind = type(batch)
    other = kind(**{**{name: getattr(batch, name) for name in kind.__dataclass_fields__}, "velocity": velocity})
    one, two = (apart_from_start(build_regression(layout, record(item))) for item in (batch, other))
    np.testing.assert_array_equal(one.regression.y, two.regression.y)
    np.testing.assert_array_equal(one.regression.Phi, two.regression.Phi)
    assert len(one.regression) == len(batch) - 2
    assert (one.regression.step_of > 0).all()
    assert not np.array_equal(estimate(record(batch), NOMINAL).values, estimate(record(other), NOMINAL).values)
