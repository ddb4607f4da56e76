"""Standard errors from the scatter of runs: the mean of runs that differ has that of their means."""

import numpy as np
import pytest
from scipy.stats import chi2

from expdesign.diagnosis.data.noise import Noise
from expdesign.diagnosis.fit.cluster_robust import cluster_covariance, cluster_robust
from expdesign.diagnosis.fit.fit import Fit
from expdesign.diagnosis.fit.gram_matrices import gram_matrices, marginalised
from expdesign.diagnosis.fit.linear_model import Sensitivities
from expdesign.diagnosis.fit.tuning import TUNING

RUNS, SAMPLES, APART, NOISE = 14, 60, 0.3, 1.0


def mean_of_runs(rng: np.random.Generator, *, runs: int = RUNS, apart: float = APART) -> Fit:
    """The least-squares mean of one channel in runs that each have an offset of their own."""
    seen = apart * rng.standard_normal((runs, 1)) + NOISE * rng.standard_normal((runs, SAMPLES))
    error = np.full((runs, SAMPLES, 4), np.nan)
    error[..., 0] = seen - seen.mean()
    values = np.zeros((1, runs, SAMPLES, 4))
    values[0, ..., 0] = 1.0
    sensitivities = Sensitivities(
        values=values, starts=np.zeros((3, runs, SAMPLES, 4)), error=error, numbers=1, spacing_s=10.0
    )
    noise = Noise(filters=np.ones((4, 1)), std=np.array([NOISE, np.inf, np.inf, np.inf]))
    grams = gram_matrices(sensitivities, noise)
    m = marginalised(grams, sensitivities, noise)
    return Fit(
        ship=None, keys=("mean",), free_count=1, covariance=np.linalg.inv(m.A), starts=np.zeros((runs, 3)), noise=noise,
        cost=0.0, deviance=0.0, linear=None, sensitivities=sensitivities, grams=grams, precision=np.zeros((1, 1)),
        step=np.zeros(1), converged=True,
    )  # type: ignore[arg-type]  # fmt: skip


def test_the_scatter_of_run_means_is_found_exactly():
    found = mean_of_runs(np.random.default_rng(0))
    means = found.sensitivities.error[..., 0].mean(axis=1)
    variance = means.var(ddof=1) / RUNS
    assert cluster_covariance(found, np.arange(RUNS))[0, 0] == pytest.approx(variance, rel=1e-9)
    assert found.covariance[0, 0] == pytest.approx(NOISE**2 / (RUNS * SAMPLES), rel=1e-9)


def test_runs_that_differ_widen_the_standard_error_and_few_runs_do_not():
    rng = np.random.default_rng(1)
    wide = cluster_robust(mean_of_runs(rng), np.arange(RUNS))
    truth = np.sqrt((APART**2 + NOISE**2 / SAMPLES) / RUNS)
    low, high = np.sqrt(chi2.ppf([0.001, 0.999], RUNS - 1) / (RUNS - 1))
    assert low * truth < wide.std("mean") < high * truth
    few = mean_of_runs(rng, runs=TUNING.fewest_runs - 1)
    assert cluster_robust(few, np.arange(TUNING.fewest_runs - 1)) is few


def test_on_average_equal_runs_have_the_plain_standard_error():
    """Mean of the clustered variance over trials against the exact one, by its own standard error."""
    rng = np.random.default_rng(2)
    found = np.array([cluster_covariance(mean_of_runs(rng, apart=0.0), np.arange(RUNS))[0, 0] for _ in range(200)])
    exact = NOISE**2 / (RUNS * SAMPLES)
    assert abs(found.mean() - exact) < 4 * found.std() / np.sqrt(len(found))


def test_no_standard_error_gets_smaller():
    rng = np.random.default_rng(3)
    for _ in range(20):
        found = mean_of_runs(rng, apart=0.0)
        assert cluster_robust(found, np.arange(RUNS)).std("mean") >= found.std("mean")
