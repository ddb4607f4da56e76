"""The dead time of the rudder where sway makes the yaw rate begin fast and turns take speed off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expdesign.step_trials.holds import Hold, Sailed
from expdesign.step_trials.identify import dead_time, turn_entry
from expdesign.step_trials.responses import Transient, fit_first_order, second_order, shared_delay
from expdesign.step_trials.samples import Plateau, StepSample

DELAY_S, DAMPING, ZERO = 0.5, 1.3, 0.65  # of a hull whose speed over length differs from step to step


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


@pytest.mark.thorough
def test_its_standard_error_holds_in_noise() -> None:
    seeds = 8
    found = np.array([shared_delay(hull_steps(seed, std=0.05), most_s=3.0) for seed in range(100, 100 + seeds)])
    scores = (found[:, 0] - DELAY_S) / found[:, 1]
    assert np.sum(np.abs(scores) < 1.96) >= seeds * 0.95 - 3 * np.sqrt(seeds * 0.95 * 0.05)
    assert found[:, 1].max() < 0.2


def turning_step(lost: float) -> tuple[Sailed, StepSample]:
    """A step whose curvature has the shape of a hull while the speed falls by a share."""
    time_s = np.arange(0.0, 30.0, 0.2)
    curvature = second_order(np.array([1.5, DAMPING, ZERO * 1.5, DELAY_S]), time_s) * 0.04
    speed = 5.0 * (1 - lost * (3 * (time_s / 30) ** 2 - 2 * (time_s / 30) ** 3))
    yaw_rate, count = curvature * speed, len(time_s)
    batch = Sailed(
        name="turn", sample_time_s=0.2, state=np.stack([speed, yaw_rate], axis=1), sway=np.zeros(count),
        commands=np.zeros((count, 2)), inputs=np.zeros((count, 2)),
    )  # fmt: skip
    hold = Hold(
        number=2, batch=0, begin=0, settled=0, end=count, commands=(8.0, 0.1), changed="rudder", change=(0.0, 0.1),
        first=False,
    )  # fmt: skip
    level = Plateau(
        state=np.array([5.0, 0.0]), std=np.full(2, 1e-3), sway=0.0, sway_std=1e-3, inputs=np.zeros(2), turns=0,
        duration_s=20.0,
    )  # fmt: skip
    data = Transient(time_s=time_s, values=yaw_rate, before=0.0, after=yaw_rate[-1], before_std=1e-3, after_std=1e-3)
    first = fit_first_order(data, delay_s=(0.0, 3.0))
    after = replace(level, state=np.array([speed[-1], yaw_rate[-1]]))
    return batch, StepSample(
        hold=hold, steady_s=20.0, before=level, plateau=after, transient=data, response=first, first_order=first
    )


@pytest.mark.parametrize("lost", [0.0, 0.3])
def test_a_turn_entry_is_as_if_no_speed_was_lost(lost: float) -> None:
    entry, whole = turn_entry(*turning_step(lost)), turn_entry(*turning_step(0.0))
    count = min(len(entry.values), len(whole.values))
    assert entry.values[:count] == pytest.approx(whole.values[:count], abs=1e-9)
    assert entry.after == pytest.approx(whole.after, rel=1e-3)
    assert entry.after_std == pytest.approx(np.hypot(1e-3, lost * turning_step(lost)[1].transient.after), rel=1e-3)


def test_a_vessel_that_loses_most_of_its_speed_is_not_scaled() -> None:
    batch, step = turning_step(0.7)
    entry = turn_entry(batch, step)
    assert entry.values == pytest.approx(batch.state[: len(entry.values), 1])
    assert entry.after == step.transient.after


def test_a_dead_time_of_few_responses_is_no_surer_than_they_are() -> None:
    """One response scatters by nothing, and two may agree; of many the scatter counts."""
    _, step = turning_step(0.0)
    assert step.first_order is not None

    def of(delays: list[float]) -> tuple[float, float]:
        parts = [replace(step.first_order, delay_s=delay, delay_std_s=0.2) for delay in delays]
        return dead_time([replace(step, first_order=part) for part in parts], 1)

    assert of([0.4]) == pytest.approx((0.4, 0.2 * np.sqrt(np.pi / 2)))
    assert 0.02 < of([0.40, 0.42])[1] < 0.2
    wide = of(np.random.default_rng(1).normal(2.0, 0.5, 200).tolist())[1]
    assert wide == pytest.approx(0.5 / np.sqrt(200) * np.sqrt(np.pi / 2), rel=0.2)
