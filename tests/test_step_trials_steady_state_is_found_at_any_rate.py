"""The ratio test: about 1 in white noise, large in transients, and thresholds that fit the sampling rate in use."""

from __future__ import annotations

import numpy as np
import pytest

from expdesign.step_trials.steady_state import (
    STEADY,
    RatioTest,
    advanced,
    begun,
    calibrated,
    ratios,
    stepped,
)
from step_case import noise

CONSTANT_S, MEMORY_S, BEGIN_S = 5.0, 3.0, 20.0
STEPS = 60


def fixed_test(std: float, *, sample_time_s: float = 0.1) -> RatioTest:
    return RatioTest(
        sample_time_s=sample_time_s, averaged=1, rate=0.1 * sample_time_s, lower=0.0, upper=np.inf, noise=std**2
    )


@pytest.mark.parametrize("std", [0.01, 1.0, 100.0])
def test_the_ratio_is_one_in_white_noise_and_large_in_a_transient_whatever_the_noise(std: float) -> None:
    rng = np.random.default_rng(1)
    steady = ratios(std * rng.standard_normal(60_000), fixed_test(std))[2000:]
    assert float(np.mean(steady)) == pytest.approx(1.0, abs=0.05)
    ramp = std * (rng.standard_normal(1000) + 0.1 * np.arange(1000))
    assert ratios(ramp, fixed_test(std))[-1] > 50.0


@pytest.mark.parametrize(
    ("sample_time_s", "correlation_s", "median"),
    [(0.05, 0.5, 10), (0.05, 2.0, 26), (0.1, 0.5, 5), (0.1, 2.0, 15), (1.0, 2.0, 2.8), (0.02, 0.5, 21)],
)
def test_the_steady_ratio_grows_with_correlation_and_sampling_rate_as_published(
    sample_time_s: float, correlation_s: float, median: float
) -> None:
    """Medians of a Monte Carlo study with l1, l2, l3 of 0.1 h, 0.5 h, h; ours are 0.1 h, 0.3 h, 0.3 h."""
    rng = np.random.default_rng(2)
    values = noise(rng, round(2000 / sample_time_s), sample_time_s=sample_time_s, std=1.0, correlation_s=correlation_s)
    found = float(np.median(ratios(values, fixed_test(1.0, sample_time_s=sample_time_s))[round(100 / sample_time_s) :]))
    assert 0.6 * median < found < 1.6 * median


def outcomes(sample_time_s: float, *, signal_to_noise: float, seed: int) -> np.ndarray:
    """(STEPS,) time until steady of steps of size 1, nan where it never is."""
    rng, std = np.random.default_rng(seed), 1.0 / signal_to_noise
    calm = [
        noise(rng, round(30 / sample_time_s), sample_time_s=sample_time_s, std=std, correlation_s=0.5) for _ in range(8)
    ]
    test = calibrated(calm, sample_time_s=sample_time_s, memory_s=MEMORY_S, rng=rng)
    return np.array([one_step(test, rng, std) for _ in range(STEPS)])


def one_step(test: RatioTest, rng: np.random.Generator, std: float) -> float:
    h = test.sample_time_s
    time_s = np.arange(round(80 / h)) * h
    values = np.where(time_s > BEGIN_S, 1.0 - np.exp(-(time_s - BEGIN_S) / CONSTANT_S), 0.0)
    values = values + noise(rng, len(values), sample_time_s=h, std=std, correlation_s=0.5)
    first = round(BEGIN_S / h)
    state = begun(test, float(values[0]))
    for value in values[:first].tolist():
        state = advanced(state, test, value)
    state = stepped(state, responds=True)
    for sample, value in enumerate(values[first:].tolist()):
        state = advanced(state, test, value)
        if state.mode == STEADY:
            return sample * h
    return float("nan")


@pytest.mark.parametrize("sample_time_s", [1.0, 0.2, 0.05])
def test_false_readiness_is_rare_and_delay_alike_at_1_5_and_20_hertz(sample_time_s: float) -> None:
    found = outcomes(sample_time_s, signal_to_noise=20.0, seed=3)
    assert np.isfinite(found).all()
    early = np.exp(-found / CONSTANT_S) > 0.05 + 1 / 20.0
    assert early.mean() <= 0.02 + 3 * np.sqrt(0.02 * 0.98 / STEPS)
    assert 3 * CONSTANT_S < np.median(found) < 6 * CONSTANT_S


def test_averaging_makes_thresholds_for_correlated_noise_moderate() -> None:
    rng = np.random.default_rng(4)
    tests = {}
    for sample_time_s in (0.2, 0.05):
        calm = [noise(rng, round(600 / sample_time_s), sample_time_s=sample_time_s, std=1.0, correlation_s=0.5)]
        tests[sample_time_s] = calibrated(calm, sample_time_s=sample_time_s, memory_s=MEMORY_S, rng=rng)
    assert tests[0.05].interval_s == pytest.approx(tests[0.2].interval_s, rel=0.5)
    assert tests[0.05].lower < 10.0
    assert tests[0.05].lower == pytest.approx(tests[0.2].lower, rel=0.5)


def test_a_slower_filter_finds_steadiness_later() -> None:
    rng = np.random.default_rng(5)
    calm = [noise(rng, 3000, sample_time_s=0.2, std=0.05, correlation_s=0.5)]
    quick, slow = (
        calibrated(calm, sample_time_s=0.2, memory_s=memory_s, rng=np.random.default_rng(6)) for memory_s in (1.5, 4.0)
    )
    found = [[one_step(test, np.random.default_rng(seed), 0.05) for seed in range(15)] for test in (quick, slow)]
    assert np.median(found[1]) > np.median(found[0]) + 2.0
