"""The dead time of the rudder where sway makes the yaw rate begin fast: all steps together find it."""

from __future__ import annotations

import numpy as np
import pytest

from expdesign.step_trials.responses import Transient, fit_first_order, second_order, shared_delay

DELAY_S, DAMPING, ZERO = 0.5, 1.3, 0.65
"""Of a hull whose speed over length differs from step to step."""


def hull_steps(seed: int, *, std: float, count: int = 5) -> list[Transient]:
    rng, time_s = np.random.default_rng(seed), np.arange(0.0, 12.0, 0.2)
    return [
        Transient(
            time_s=time_s,
            values=second_order(np.array([natural, DAMPING, ZERO * natural, DELAY_S]), time_s)
            + std * rng.standard_normal(len(time_s)),
            before=0.0,
            after=1.0,
        )
        for natural in rng.uniform(1.2, 2.2, count).tolist()
    ]


def test_with_little_noise_first_order_dead_times_are_wrong_and_the_shared_shape_s_is_right() -> None:
    steps = hull_steps(1, std=0.01)
    alone = [fit_first_order(step, delay_s=(0.0, 3.0)).delay_s for step in steps]
    assert np.median(alone) < DELAY_S - 0.1
    delay, std = shared_delay(steps, most_s=3.0)
    assert delay == pytest.approx(DELAY_S, abs=max(3 * std, 0.03))
    assert std < 0.05


def test_its_standard_error_holds_in_noise() -> None:
    seeds = 12
    found = np.array([shared_delay(hull_steps(seed, std=0.05), most_s=3.0) for seed in range(100, 100 + seeds)])
    scores = (found[:, 0] - DELAY_S) / found[:, 1]
    assert np.sum(np.abs(scores) < 1.96) >= seeds * 0.95 - 3 * np.sqrt(seeds * 0.95 * 0.05)
    assert found[:, 1].max() < 0.2
