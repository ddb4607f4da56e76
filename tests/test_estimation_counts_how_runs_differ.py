"""Standard deviations of estimates count how runs differ, and only where they do."""

from __future__ import annotations

import numpy as np
import pytest

from expdesign.estimation.regression import Regression
from expdesign.estimation.solve import Solution, Weighting, solve_iv, solve_ls

RUNS, SAMPLES = 8, 60
TRUE = np.array([1.0, -2.0, 0.5])


def trial(rng: np.random.Generator, *, differ: float) -> Regression:
    """White noise on three regressors of different size; the parameters of every run differ by as much (std)."""
    Phi = rng.standard_normal((RUNS * SAMPLES, 1, 3)) * [1.0, 20.0, 0.05]
    batch = np.repeat(np.arange(RUNS), SAMPLES)
    own = TRUE + differ * rng.standard_normal((RUNS, 3)) / [1.0, 20.0, 0.05]
    y = np.einsum("knp,kp->kn", Phi, own[batch]) + rng.standard_normal((RUNS * SAMPLES, 1))
    return Regression(parameters=("a", "b", "c"), Phi=Phi, y=y, batch=batch)


def held(found: list[Solution]) -> float:
    """Share of 95 % intervals that hold the truth."""
    return float(np.mean([np.abs(one.values - TRUE) < 1.96 * np.sqrt(np.diag(one.covariance)) for one in found]))


@pytest.mark.parametrize("solver", ["ls", "iv"])
def test_intervals_hold_where_runs_differ(solver: str) -> None:
    """Between-run deviations of 0.4, where one run knows a parameter to 0.13: noise alone holds half of the time."""
    trials = [trial(np.random.default_rng(seed), differ=0.4) for seed in range(100)]
    solve = solve_ls if solver == "ls" else lambda data: solve_iv(data, np.array(data.Phi))
    found = [solve(data) for data in trials]
    error = np.sqrt(0.95 * 0.05 / (3 * len(trials)))
    assert held(found) > 0.95 - 3.0 * error
    assert all("Runs differ" in " ".join(one.warnings) for one in found)
    without = [
        solve_ls(data, Weighting(covariance="hac")) for data in trials
    ]  # knows of no runs, and holds the truth too rarely
    assert held(without) < 0.8


def test_intervals_stay_where_runs_do_not_differ() -> None:
    """At 1 % a run of trials tells of a difference in few of them, and the others have the covariance of noise."""
    trials = [trial(np.random.default_rng(1000 + seed), differ=0.0) for seed in range(130)]
    found = [solve_ls(data) for data in trials]
    told = [bool(np.any(one.between_runs)) for one in found]
    assert np.mean(told) <= 0.01 + 3.0 * np.sqrt(0.01 * 0.99 / len(trials))
    assert abs(held(found) - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / (3 * len(trials)))
    for one, says in zip(found, told, strict=True):
        assert says == ("Runs differ" in " ".join(one.warnings))


def test_what_runs_tell_does_not_depend_on_units() -> None:
    data = trial(np.random.default_rng(5), differ=0.4)
    scale = np.array([1e3, 1e-4, 7.0])
    other = Regression(parameters=data.parameters, Phi=np.array(data.Phi) * scale, y=np.array(data.y), batch=data.batch)
    own, scaled = solve_ls(data), solve_ls(other)
    np.testing.assert_allclose(scaled.covariance * np.outer(scale, scale), own.covariance, rtol=1e-6, atol=1e-12)
