"""The parts of residual noise: their expected periodograms and covariances are identities, and misfits are noticed."""

import numpy as np
import pytest
import scipy

from estimation_case import CALM_CURRENT, NOMINAL, TRUE, commands, measured, record
from expdesign.estimation.methods import estimate
from expdesign.estimation.noise.components import (
    Components,
    Fitted,
    Slow,
    expected_periodogram,
    filtered,
    fit_components,
    stretches,
)
from expdesign.estimation.noise.coupled import Coupled, coupled_covariance, fit_coupled
from expdesign.estimation.noise.covariance import SPECTRUM_MISFIT, score_covariance
from expdesign.estimation.regression import build_layout, build_regression
from expdesign.estimation.regression.regression import single_output
from expdesign.estimation.replay.instruments import apart_from_start
from expdesign.estimation.solve import sandwich
from expdesign.estimation.solve.sandwich import WHITE_TEST_LEVEL, changing_variance, widening
from expdesign.estimation.solve.solution import Weighting, solve_iv, solve_ls
from expdesign.simulation import Variation
from expdesign.simulation.environment import vary

SLOW = (Slow(4.0), Slow(30.0), Slow(np.inf), Slow(4.0, turning=True), Slow(np.inf, turning=True))
PARTS = 2 + len(SLOW)


def explicit(index: int, heading: np.ndarray) -> np.ndarray:
    """(count, count) covariance of a part with unit variance, written out."""
    lag = np.abs(np.subtract.outer(np.arange(len(heading)), np.arange(len(heading))))
    if index < 2:
        return (1.0 + index) * (lag == 0) - index * (lag == 1)
    part = SLOW[index - 2]
    return np.exp(-lag / part.memory) * (np.cos(np.subtract.outer(heading, heading)) if part.turning else 1.0)


@pytest.mark.parametrize(("samples", "gaps"), [(60, False), (60, True), (59, False)])
@pytest.mark.parametrize("index", range(PARTS))
def test_expected_periodograms_and_products_are_those_of_the_covariance_matrix(
    index: int, samples: int, gaps: bool
) -> None:
    """Also for a prime number of samples, whose periodograms are padded."""
    rng = np.random.default_rng(41)
    places = np.sort(rng.choice(samples, 45, replace=False)) if gaps else np.arange(samples)
    places = places - places[0]
    count = int(places[-1]) + 1
    heading = np.cumsum(rng.normal(scale=0.2, size=count))
    (part,) = stretches(np.zeros(len(places), dtype=np.int64), places, heading[places])
    there = np.isin(np.arange(count), places)
    waves = np.exp(-2j * np.pi * np.outer(np.arange(part.padded // 2 + 1), np.arange(count)) / part.padded) * there
    G, W = explicit(index, heading), rng.normal(size=(count, 3))
    spectrum = np.einsum("fi,ij,fj->f", waves, G, waves.conj()).real / len(places)
    np.testing.assert_allclose(expected_periodogram(part, SLOW)[index], spectrum, atol=1e-9)
    np.testing.assert_allclose(filtered(index, SLOW, W, np.exp(1j * heading)), G @ W, atol=1e-9)


def test_score_covariance_is_that_of_the_matrix_with_batches_and_outputs() -> None:
    rng = np.random.default_rng(42)
    batch = np.repeat([0, 1], [30, 50])
    heading = rng.uniform(-3.0, 3.0, 80)
    parts = stretches(batch, np.concatenate([np.arange(30), np.arange(50)]), heading)
    variances = rng.uniform(0.5, 2.0, (2, PARTS))
    known = np.zeros((PARTS, PARTS))
    fitted = [Components(row, SLOW, 0.0, known) for row in variances]
    W = [rng.normal(size=(80, 2)), rng.normal(size=(80, 3))]
    level = np.array([1.0, 2.0, *np.ones(len(SLOW))])
    cross = 0.3 * (np.sqrt(variances[0] * variances[1]) * level).sum()
    # residuals whose products at the same sample are exactly these
    moments = np.array([[1e3, cross], [cross, 1e3]])
    basis = np.linalg.qr(rng.normal(size=(80, 2)))[0] * np.sqrt(80)
    residuals = basis @ np.linalg.cholesky(moments).T
    blocks, _ = score_covariance(W, residuals, fitted, parts)
    for o in range(2):
        for other in range(2):
            shared = 1.0 if o == other else 0.3
            total = np.zeros((80, 80))
            for rows in (slice(0, 30), slice(30, 80)):
                total[rows, rows] = shared * sum(
                    np.sqrt(variances[o, i] * variances[other, i]) * explicit(i, heading[rows]) for i in range(PARTS)
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
        columns = [filtered(index, fitted.slow, np.eye(50)) for index in range(len(fitted.variances))]
        total = np.einsum("i,ijk->jk", fitted.variances, columns)
        found.append((total[20, 20], total[20, 21], total.sum()))
    truth = np.array([0.25 + 2 + 0.49, -1 + 0.49, 50 * 0.25 + 2 + 2500 * 0.49])
    chance = np.std(found, axis=0) / np.sqrt(60)
    assert (np.abs(np.mean(found, axis=0) - truth) < 4 * chance + 0.01 * np.abs(truth)).all(), np.mean(found, axis=0)


def test_slow_noise_from_one_side_of_the_chart_is_known_while_the_ship_turns() -> None:
    """The variance of a sum weighted as the ship turns is within a third; without headings it misses two fifths."""
    rng, k = np.random.default_rng(47), 3000
    slow = Variation(std_mps=1.0, correlation_s=64.0)
    heading = 1.2 * np.sin(np.arange(k) / 40) + 0.003 * np.arange(k)
    once = np.zeros(k, dtype=np.int64)
    (aware,), (blind,) = stretches(once, np.arange(k), heading), stretches(once, np.arange(k))
    W = np.sin(np.arange(k) / 40)[:, None]
    exact = float((W * (filtered(2, (Slow(64.0, turning=True),), W, aware.turn) + W)).sum())
    stated = []
    for _ in range(60):
        north, east = vary(slow, rng.normal(size=(k, 2)), sample_time_s=1.0).T
        noise = (np.cos(heading) * north + np.sin(heading) * east + rng.normal(size=k))[:, None]
        fits = [(part, fit_components(noise, [part])) for part in (aware, blind)]
        stated.append([score_covariance([W], noise, fit, [part])[0][0][0][0, 0] / exact for part, fit in fits])
    (with_heading, without), chance = np.mean(stated, axis=0), np.std(stated, axis=0) / np.sqrt(len(stated))
    assert abs(with_heading - 1) < 1 / 3 + 2 * chance[0]
    assert without < 0.6 + 2 * chance[1]


def test_variances_known_from_few_batches_widen_intervals_as_students_t() -> None:
    """One constant disturbance per batch, n batches: var(v) = 2 v^2 / n, so the factor is that of t with n freedoms."""
    rng, n, length = np.random.default_rng(48), 12, 40
    parts = stretches(np.repeat(np.arange(n), length), np.tile(np.arange(length), n))
    level = 10.0 * np.repeat(rng.normal(size=n), length) + 0.01 * rng.normal(size=n * length)
    (fitted,) = fit_components(level[:, None], parts)
    W = np.ones((n * length, 1))
    blocks, doubts = score_covariance([W], level[:, None], [fitted], parts)
    factor = widening(np.diag(blocks[0][0]), doubts[0])
    np.testing.assert_allclose(factor, scipy.stats.t.ppf(0.975, n) / scipy.stats.norm.ppf(0.975), rtol=0.01)


def coupled_steps(count: int, rng: np.random.Generator) -> np.ndarray:
    """(count, 2, 2) of a ship whose yaw rate pushes her aside."""
    A = np.tile([[0.6, -1.5], [0.02, 0.85]], (count, 1, 1))
    return A * rng.uniform(0.97, 1.03, (count, 1, 1))


def carried(A: np.ndarray) -> np.ndarray:
    """(count + 1, 2, count, 2) errors of simulated states by forces in every step."""
    result = np.zeros((len(A) + 1, 2, len(A), 2))
    for k, step in enumerate(A):
        result[k + 1] = np.tensordot(step, result[k], 1)
        result[k + 1, :, k] += np.eye(2)
    return result


def test_forces_led_back_by_the_adjoint_give_the_covariance_of_the_simulations_errors() -> None:
    """Any sum of errors, free of the first state: W^T (R + L D L^T) W, written out."""
    rng, count = np.random.default_rng(51), 40
    heading, A = np.cumsum(rng.normal(scale=0.2, size=count)), coupled_steps(40, rng)
    W = rng.normal(size=(count + 1, 2, 3))
    adjoint = W.copy()
    for k in range(count - 1, -1, -1):
        adjoint[k] += A[k].T @ adjoint[k + 1]
    W[0] -= adjoint[0]
    variances, common = rng.uniform(0.5, 2.0, (2, PARTS)), np.array([[1.0, 0.4], [0.4, 1.0]])
    known = np.zeros((2 * PARTS,) * 2)
    noise = Coupled(variances=variances, slow=SLOW, common=common, misfit=np.zeros(2), uncertainty=known)
    parts = stretches(np.zeros(count, dtype=np.int64), np.arange(count), heading)
    sensed = np.einsum("kna,knb->nab", W, W)
    P, doubt = coupled_covariance(adjoint[1:], sensed, noise, parts)
    shape = np.array([explicit(index, heading) for index in range(PARTS)])
    shape[1] = 0.0
    roots = np.sqrt(variances)
    D = np.einsum("oi,qi,oq,ikl->kolq", roots, roots, common, shape).reshape(2 * count, -1)
    led = np.einsum("koa,komq->mqa", W, carried(A)).reshape(2 * count, -1)
    np.testing.assert_allclose(P, led.T @ D @ led + np.einsum("n,nab->ab", variances[:, 1], sensed), rtol=1e-9)
    np.testing.assert_array_equal(doubt, 0.0)


def test_small_forces_are_found_beside_the_sensor_noise_of_another_output() -> None:
    """The noise of a yaw rate is in the next sway, five times as large as the force there."""
    rng, count = np.random.default_rng(52), 4000
    A, sensor, force = coupled_steps(count, rng), np.array([0.02, 0.1]), np.array([0.03, 0.01])
    e, d = sensor * rng.normal(size=(count + 1, 2)), force * rng.normal(size=(count, 2))
    eps = d + e[1:] - np.einsum("kab,kb->ka", A, e[:-1])
    parts = stretches(np.zeros(count, dtype=np.int64), np.arange(count))
    found = fit_coupled(eps, A, parts, [Fitted(*np.zeros((2, count, 0)))] * 2)
    error = (found.variances[:, :2] - np.stack([force**2, sensor**2], axis=1)).ravel()
    places = [0, 1, found.variances.shape[1], found.variances.shape[1] + 1]
    std = np.sqrt(np.diag(found.uncertainty))[places]
    assert (np.abs(error) < 5 * std).all(), error / std
    assert std[0] < 0.15 * force[0] ** 2  # by itself, sway knows its force to 60 % only
    assert found.variances[:, 2:].sum() < 0.05 * force[0] ** 2
    assert (found.misfit < SPECTRUM_MISFIT).all()


def test_noise_of_other_shape_is_noticed_and_noise_of_these_parts_is_not() -> None:
    rng = np.random.default_rng(44)
    parts = stretches(np.zeros(2000, dtype=np.int64), np.arange(2000))

    def noticed(noise: np.ndarray) -> float:
        return float(np.mean([fitted.misfit > SPECTRUM_MISFIT for fitted in fit_components(noise.T, parts)]))

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


def test_what_takes_nothing_from_the_residuals_has_no_changing_variance() -> None:
    rng = np.random.default_rng(47)
    W, steps = rng.standard_normal((500, 1, 2)) * [1.0, 0.0], np.arange(500)
    factors = changing_variance(W, W[:, 0, :1] * rng.standard_normal((500, 1)), np.zeros(500, dtype=np.int64), steps)
    assert factors[0] > 1.2
    assert factors[1] == 1.0


def test_roots_of_covariances_undo_each_other_whatever_the_units() -> None:
    rng = np.random.default_rng(49)
    units = 10.0 ** rng.uniform(-6, 6, 5)
    half = rng.normal(size=(5, 9)) * units[:, None]
    P = half @ half.T
    root, inverse = sandwich._root(P), sandwich._root(P, inverse=True)
    scale = np.outer(units, units)
    assert root @ root.T / scale == pytest.approx(P / scale)
    assert inverse @ P @ inverse.T == pytest.approx(np.eye(5), abs=1e-9)
    flat = half[:, :3] @ half[:, :3].T  # of which two combinations are known exactly
    root, inverse = sandwich._root(flat), sandwich._root(flat, inverse=True)
    assert root @ root.T / scale == pytest.approx(flat / scale)
    assert np.linalg.eigvalsh(inverse @ flat @ inverse.T) == pytest.approx([0.0, 0.0, 1.0, 1.0, 1.0], abs=1e-6)


def test_a_variance_by_long_run_sums_allows_for_residuals_that_sum_to_zero() -> None:
    """A mean of white noise: its variance is 1 / N, of which the sums lose a tenth by eight lags of 60 samples."""
    rng, samples, draws = np.random.default_rng(50), 60, 400

    def stated(covariance: str) -> np.ndarray:
        noise = rng.normal(size=(draws, samples))
        means = [single_output(np.ones((samples, 1)), e, parameters=("mean",)) for e in noise]
        weighting = Weighting(covariance=covariance, lags=8)
        return np.array([samples * float(solve_ls(one, weighting).covariance[0, 0]) for one in means])

    allowed, plain = stated("hac"), stated("kernel")
    assert abs(allowed.mean() - 1.0) < 4.0 * allowed.std() / np.sqrt(draws)
    assert plain.mean() < 0.95


def test_of_noise_of_another_shape_the_larger_of_both_estimates_is_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parameter by parameter: by the parts of noise, and by long-run sums."""
    rng, samples = np.random.default_rng(48), 2000
    swell = np.zeros(samples)
    for k, e in enumerate(rng.normal(size=samples)):
        swell[k] = e + (1.9 * np.cos(2 * np.pi / 10) * swell[k - 1] - 0.9 * swell[k - 2] if k > 1 else 0.0)
    u = rng.normal(size=(samples, 2))
    regression = single_output(u, u.sum(axis=1) + swell, parameters=("one", "two"))

    def stated(robust: np.ndarray) -> np.ndarray:
        monkeypatch.setattr(sandwich, "_summed", lambda *_, **__: (np.diag(robust), 0))
        return np.diag(solve_iv(regression, u[:, None, :].copy(), Weighting()).covariance)

    by_parts, factor = stated(np.zeros(2)), samples / (samples - 2.0)
    assert (by_parts > 0).all()
    found = stated(by_parts * [0.25, 4.0])
    assert found == pytest.approx(by_parts * [1.0, 4.0 * factor], rel=1e-9)


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


def test_noise_of_one_variance_is_called_changing_as_rarely_as_the_level_of_white_s_test_says() -> None:
    rng, draws, samples = np.random.default_rng(77), 1000, 2000
    batch, step = np.zeros(samples, dtype=np.int64), np.arange(samples)
    factors = np.concatenate(
        [
            changing_variance(rng.standard_normal((samples, 1, 1)), rng.standard_normal((samples, 1)), batch, step)
            for _ in range(draws)
        ]
    )
    seldom = draws * WHITE_TEST_LEVEL  # squares of squares are skewed, so that it is somewhat more
    assert 0.2 * seldom <= (factors > 1.0).sum() <= 3.0 * seldom
