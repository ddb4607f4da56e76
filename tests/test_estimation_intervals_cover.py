"""Coverage: 95 % intervals hold the truth in about 95 % of simulated trials where the estimator is consistent.

Noise enters through the regressors, so residuals are coloured: in one long batch, in many short ones, and with a
current that wanders for 100 s. Thresholds are the binomial chance error of as many trials.
`benchmarks/estimation_coverage.py` prints every parameter's share beside bias, spread and kurtosis.
"""

import numpy as np
import pytest
import scipy

from coverage_cases import METHODS, Case, tried
from estimation_case import (
    CALM_CURRENT,
    NOMINAL,
    STEADY_CURRENT,
    TRUE,
    WANDERING_CURRENT,
    commands,
    errors_and_std,
    many_short_batches,
    measured,
)
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.estimation.noise.components import timeline
from expdesign.estimation.noise.covariance import Colour, fitted_colour, innovations, white_parts
from expdesign.estimation.regression.regression import single_output
from expdesign.estimation.solve.solution import Weighting, solve_iv
from expdesign.signals import Record

CASES = {
    "iv": ("iv", CALM_CURRENT),
    "iv-augmented": ("iv-augmented", STEADY_CURRENT),
    "wandering": ("iv-augmented", WANDERING_CURRENT),
}


def covered(case: str, trials: int, samples: int = 4000) -> np.ndarray:
    """(p,) share of trials whose interval holds the truth."""
    if case == "short":
        found = many_short_batches(trials, seed=31)
        assert found.failed == 0
        return found.coverage
    method, weather = CASES[case]
    _, errors, std, failed = errors_and_std(trials, samples, method, weather, seed=31)
    assert failed <= 0.01 * trials
    return (np.abs(errors) < 1.96 * std).mean(axis=0)


@pytest.mark.thorough
@pytest.mark.parametrize(("case", "trials", "samples"), [("iv", 24, 2000), ("short", 12, 12 * 300)])
def test_intervals_cover_small(case: str, trials: int, samples: int) -> None:
    shares = covered(case, trials, samples)
    chance = np.sqrt(0.95 * 0.05 / trials)
    assert (shares > 0.95 - 4 * chance).all(), shares
    assert abs(shares.mean() - 0.95) < 2 * chance, shares


TABLE = [
    Case(method=method, wandering=wandering, samples=1000, batches=batches)
    for method in METHODS
    if not method.endswith("current")
    for wandering in ((False,) if method == "ls" else (False, True))
    for batches in (1, 5)
]
"""Not of methods that estimate a steady current, whose intervals are not promised: see `benchmarks/README.md`."""


@pytest.mark.thorough
@pytest.mark.parametrize("case", TABLE[::8], ids=str)
def test_intervals_of_every_method_cover_small(case: Case) -> None:
    """All parameters together; those of an equation err together, which the chance of four standard errors allows."""
    trials = 8
    found = tried(case, trials, seed=32)
    assert found.failed == 0
    assert abs(found.held.mean() - 0.95) < 4 * np.sqrt(0.95 * 0.05 / trials) / 2


@pytest.mark.slow
@pytest.mark.parametrize("case", TABLE, ids=str)
def test_intervals_of_every_method_cover(case: Case) -> None:
    """Each parameter in 93 of 100 trials or more, all together in 93 to 97.5; half a per cent of false alarms each.

    The chance of a share is that of so many trials, and of the least of all shares of the table; parameters of an
    equation err together, so that of the mean of a case is half of one share's.
    """
    trials = 300
    found = tried(case, trials, seed=33)
    chance = np.sqrt(0.95 * 0.05 / trials)
    worst = -scipy.stats.norm.ppf(0.005 / (len(TABLE) * len(found.names)))
    sure = -scipy.stats.norm.ppf(0.005 / len(TABLE))
    assert found.failed <= 0.01 * trials
    assert (found.held > 0.93 - worst * chance).all(), found.held
    assert 0.93 - sure * chance / 2 < found.held.mean() < 0.975 + sure * chance / 2, found.held.mean()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "least"), [("iv", 0.93), ("iv-augmented", 0.93), ("short", 0.93), ("wandering", 0.92)]
)
def test_intervals_of_every_parameter_cover_between_93_and_97_in_100(case: str, least: float) -> None:
    """Each parameter by itself, give or take two standard errors of the count; all together without any.

    With a wandering current, of which few memories are seen, the promise is less: X_vr was found at 0.92.
    """
    trials = 1000
    shares = covered(case, trials)
    chance = 2 * np.sqrt(0.95 * 0.05 / trials)
    assert (shares > least - chance).all(), shares
    assert (shares < 0.97 + chance).all(), shares
    assert 0.93 < shares.mean() < 0.97, shares


@pytest.mark.parametrize("colour", [Colour(0.0, -0.9), Colour(0.9, -0.5), Colour(0.7, 0.0), Colour(0.0, 0.6)])
def test_filters_start_as_the_noise_does(colour: Colour) -> None:
    """Terms zeta n of equal variance mean cov(eps) = zeta^T zeta; for ARMA(1, 1) that is known in closed form."""
    a, c, count = colour.a, colour.c, 40
    zeta, _ = innovations(np.eye(count), np.zeros(count), colour)
    first = (1 + a * c) * (a + c) / (1 - a**2)
    lag = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    exact = np.where(lag == 0, (1 + 2 * a * c + c**2) / (1 - a**2), first * a ** np.maximum(lag - 1, 0))
    np.testing.assert_allclose(zeta.T @ zeta, exact, atol=1e-9)


@pytest.mark.parametrize("colour", [0.0, -0.9])
def test_whitened_scores_are_the_same_sum(colour: float) -> None:
    """sum Z eps = sum zeta n to rounding, with batches and with samples left out, and n is white."""
    rng = np.random.default_rng(34)
    whole = rng.normal(size=2000)
    whole[1:] += colour * whole[:-1].copy()
    kept = np.flatnonzero(rng.random(2000) > 0.02)
    batch, step = (kept >= 1200).astype(np.int64), kept
    Z, eps = rng.normal(size=(len(kept), 1, 3)).cumsum(axis=0), whole[kept][:, None]
    zeta, white = white_parts(Z, eps, timeline(batch, step))
    np.testing.assert_allclose(np.einsum("knp,kn->p", zeta, white), np.einsum("knp,kn->p", Z, eps), rtol=1e-9)
    found = fitted_colour([whole], [np.ones(2000)])
    filtered = white_parts(Z[:1], whole[:, None], timeline(np.zeros(2000, dtype=np.int64), np.arange(2000)))[1][:, 0]
    assert abs(filtered[1:] @ filtered[:-1] / (filtered @ filtered)) < 4 / np.sqrt(2000)
    if not colour:
        assert found == Colour(0.0, 0.0)


@pytest.mark.thorough
def test_predicted_variance_is_right_when_noise_nearly_cancels() -> None:
    """y = theta u + e(k) - 0.9 e(k-1), slow u: the variance follows from the noise alone, in closed form."""
    rng, k, runs = np.random.default_rng(35), 1500, 200
    u = np.convolve(rng.normal(size=k + 40), np.ones(41) / 41, mode="valid")[:, None]
    influence = np.append(u, 0)[:-1] / float(u[:, 0] @ u[:, 0])
    exact = np.sum((influence - 0.9 * np.append(influence[1:], 0)) ** 2)
    predicted = []
    for _ in range(runs):
        e = rng.normal(size=k + 1)
        y = u[:, 0] + e[1:] - 0.9 * e[:-1]
        solution = solve_iv(single_output(u, y, parameters=("theta",)), u[:, None, :].copy(), Weighting())
        predicted.append(float(solution.covariance[0, 0]))
    spread = np.std(predicted) / np.sqrt(runs)
    assert abs(np.mean(predicted) - exact) < 4 * spread + 0.02 * exact


def test_ignoring_the_colour_of_residuals_gives_intervals_far_too_wide() -> None:
    """Measurement noise enters at k and, with opposite sign, at k - 1: the correlation is what makes estimates good."""
    batch = measured(TRUE, commands(2000, np.random.default_rng(32)), seed=33)
    robust, white = (
        estimate(
            Record(batches=(batch,)), NOMINAL, settings=Settings(weighting=Weighting(mean="complete", covariance=kind))
        ).std
        for kind in ("components", "hc1")
    )
    assert np.median(white / robust) > 1.5
