"""Coverage: 95 % intervals hold the truth in about 95 % of simulated trials where the estimator is consistent.

Noise enters through the regressors, so residuals are coloured; the thresholds are the binomial chance error of as many
trials, which are independent, times the parameters, which are not quite.

Many regressors per equation take a little of the residuals' slow part with them, for which the covariance corrects only
to first order; parameters that rest on slow motion (quadratic sway damping) are therefore covered a few parts in a
hundred less than the rest.
"""

import numpy as np
import pytest
from estimation_case import NOMINAL, TRUE, commands

from expdesign.estimation.methods import Settings, estimate
from expdesign.estimation.solution import Weighting
from expdesign.signals import Record
from expdesign.simulation import Environment, Variation, simulate_ensemble

TRUTH = dict(zip(TRUE.model.names, TRUE.model.parameters.tolist(), strict=True))
MERGED = {"X_abs_u_u": "W_abs_u_u", "Y_abs_v_v": "W_abs_v_v", "N_uv": "W_uv"}


def coverage(trials: int, samples: int, method: str, weather: Environment, settings: Settings) -> np.ndarray:
    """(p,) share of trials whose interval holds the truth; every trial with its own input and noise."""
    rng = np.random.default_rng(31)
    inputs = np.stack([commands(samples, rng) for _ in range(trials)], axis=1)
    many = simulate_ensemble(TRUE, inputs, runs=trials, environment=weather, rng=rng, velocity=(1.7, 0.7, 0.0))
    hits = []
    for run in range(trials):
        found = estimate(Record(batches=(many.batch(run),)), NOMINAL, method=method, settings=settings)
        truth = [
            TRUTH[n] + (TRUTH[MERGED[n]] if n in MERGED and MERGED[n] not in found.names else 0.0) for n in found.names
        ]
        hits.append(np.abs(found.values - truth) < 1.96 * found.std)
    return np.mean(hits, axis=0)


def test_intervals_cover_in_calm_weather_small() -> None:
    trials = 60
    covered = coverage(trials, 2000, "iv", Environment(), Settings())
    chance = np.sqrt(0.95 * 0.05 / trials)
    assert (covered > 0.95 - 4 * chance).all(), covered
    assert abs(covered.mean() - 0.95) < 2 * chance, covered


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "weather"),
    [
        ("iv", Environment(current_variation=Variation(std_mps=0.03))),
        ("iv-augmented", Environment(current_to=np.array([0.2, -0.2]), current_variation=Variation(std_mps=0.03))),
    ],
)
def test_intervals_cover_full(method: str, weather: Environment) -> None:
    covered = coverage(1000, 4000, method, weather, Settings())
    assert (covered > 0.90).all(), covered  # see above
    assert 0.93 < covered.mean() < 0.97, covered


def test_ignoring_the_colour_of_residuals_gives_intervals_far_too_wide() -> None:
    """Measurement noise enters at k and, with opposite sign, at k - 1: the correlation is what makes estimates good."""
    inputs = commands(2000, np.random.default_rng(32))
    many = simulate_ensemble(
        TRUE, inputs, runs=1, environment=Environment(), rng=np.random.default_rng(33), velocity=(1.7, 0.7, 0)
    )
    record = Record(batches=(many.batch(0),))
    robust, white = (
        estimate(record, NOMINAL, settings=Settings(weighting=Weighting(mean="complete", covariance=kind))).std
        for kind in ("hac", "hc1")
    )
    assert np.median(white / robust) > 1.5
