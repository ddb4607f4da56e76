"""Few data: unstable estimates are drawn towards the first model, and their intervals still hold."""

import numpy as np
import pytest

from estimation_case import (
    CALM_CURRENT,
    NOMINAL,
    STEADY_CURRENT,
    TRUE,
    commands,
    estimated_trials,
    measured,
    record,
    truth,
)
from expdesign.errors import Diverged
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.estimation.replay import simulate_batch
from expdesign.estimation.solve import Prior
from expdesign.estimation.solve.solution import MOST_REFINEMENTS
from expdesign.signals import Batch


def simulates(found) -> bool:
    """Whether the estimated model stays bounded under inputs that were not used."""
    inputs = commands(1000, np.random.default_rng(5))
    velocity = np.tile([1.7, 0.7, 0.0], (1000, 1))
    batch = Batch(name="x", sample_time_s=1.0, input_names=NOMINAL.inputs, inputs=inputs, velocity=velocity)
    try:
        simulate_batch(found.model(NOMINAL), batch)
    except Diverged:
        return False
    return True


def check(trials: int) -> None:
    """Augmented, 1000 samples, where refinement without a first model to draw to stopped in one trial of five."""
    rng = np.random.default_rng(41)
    found = list(estimated_trials(trials, 1000, "iv-augmented", STEADY_CURRENT, rng))
    assert all(item is not None and simulates(item) for item in found)
    errors = np.array([item.values - truth(item.names) for item in found])
    std = np.array([item.std for item in found])
    held = (np.abs(errors) < 1.96 * std).mean(axis=0)
    chance = np.sqrt(0.95 * 0.05 / trials)
    assert abs(held.mean() - 0.95) < 3 * chance  # of one parameter; those of an equation err together
    bias = np.abs(errors.mean(axis=0)) / (errors.std(axis=0, ddof=1) / np.sqrt(trials))
    assert np.median(bias) < 3


@pytest.mark.thorough
def test_few_data_give_stable_models():
    check(12)


@pytest.mark.slow
def test_few_data_give_stable_models_in_many_trials():
    check(300)


def test_what_is_well_known_stays_and_what_is_not_comes_to_the_prior():
    prior = Prior(np.zeros(3), np.array([1.0, 1.0, np.inf]))
    values, covariance = np.array([2.0, 2.0, 2.0]), np.diag([1e-6, 1e6, 1.0])
    np.testing.assert_allclose(prior.drawn(values, covariance, 1.0), [2.0, 0.0, 2.0], atol=1e-5)
    np.testing.assert_allclose(prior.drawn(values, covariance, 1e-12), values, rtol=1e-5)


def test_a_combination_of_normal_values_is_bayes_rule():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(3, 3))
    P, spread, mean, values = root @ root.T, rng.uniform(0.5, 2, 3), rng.normal(size=3), rng.normal(size=3)
    precision = np.linalg.inv(P) + 0.7 * np.diag(spread**-2)
    exact = np.linalg.solve(precision, np.linalg.solve(P, values) + 0.7 * mean / spread**2)
    np.testing.assert_allclose(Prior(mean, spread).drawn(values, P, 0.7), exact, rtol=1e-10)


def test_equations_that_do_not_settle_keep_their_first_instruments() -> None:
    """After one refinement nothing has settled: the estimate is that of the first instruments, and a warning tells."""
    data = record(measured(TRUE, commands(2000, np.random.default_rng(7)), weather=CALM_CURRENT, seed=8))
    first, restless, settled = (
        estimate(data, NOMINAL, settings=Settings(most_refinements=most)) for most in (0, 1, MOST_REFINEMENTS)
    )
    np.testing.assert_array_equal(restless.values, first.values)
    assert any("keep their first instruments" in warning for warning in restless.warnings)
    assert not any("keep their first instruments" in warning for warning in settled.warnings)
    assert not np.allclose(settled.values, first.values)
