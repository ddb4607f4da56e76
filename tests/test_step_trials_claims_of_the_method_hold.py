"""Claims of the step method: late steadiness does no harm, penalties are chosen well, up and down show hysteresis."""

from __future__ import annotations

import numpy as np
import pytest

from expdesign.export.step_trial_content import SIGNIFICANT
from expdesign.step_trials.holds import Hold
from expdesign.step_trials.responses import Transient, first_order, fit_first_order
from expdesign.step_trials.samples import Plateau, StepSample
from expdesign.step_trials.surfaces import Comparison, Sampled, comparisons, ridge

CONSTANT_S = 4.0


def extracted(steady_s: float) -> tuple[float, float]:
    """Plateau and time constant of a step of size 1 that is declared steady at a time, over those that are true."""
    time_s = np.arange(0.0, 200.0, 0.05)
    values = first_order(np.array([CONSTANT_S, 0.0]), time_s)
    steady = round(steady_s / 0.05)
    plateau = float(values[steady : steady + 400].mean())
    data = Transient(time_s=time_s[: steady + 1], values=values[: steady + 1], before=0.0, after=plateau)
    return plateau, fit_first_order(data, delay_s=(0.0, 0.0)).time_constant_s / CONSTANT_S


def test_a_late_steady_state_leaves_damping_and_inertia_alone_and_an_early_one_does_not() -> None:
    for late in (6.0, 8.0, 12.0):
        assert extracted(late * CONSTANT_S) == pytest.approx((1.0, 1.0), abs=0.01)
    early = extracted(0.5 * CONSTANT_S)
    assert early[0] < 0.95
    assert early[1] < 0.95


@pytest.mark.parametrize("count", [50, 100])
def test_leaving_one_out_chooses_a_penalty_close_to_the_best_of_all(count: int) -> None:
    """Mean excess over 40 seeds of the error on fresh data, beside the worst penalty that could have been chosen."""
    excess, worst = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        columns = np.column_stack([np.ones(count + 500), rng.standard_normal((count + 500, 14))])
        truth = columns @ np.array([1.0, 1.0, 0.5, *[0.05] * 12])
        samples = Sampled(
            columns=columns[:count], values=truth[:count] + 0.7 * rng.standard_normal(count), weights=np.ones(count),
            penalised=np.array([0.0, *[1.0] * 14]),
        )  # fmt: skip
        fresh, goal = columns[count:], truth[count:]
        penalties = (1e-6, 1e-4, 1e-2, 1e-1, 1.0, 10.0)
        *errors, chosen = (
            float(np.sqrt(np.mean((fresh @ ridge(samples, tried).coefficients - goal) ** 2)))
            for tried in (*((one,) for one in penalties), penalties)
        )
        excess.append(chosen / min(errors) - 1)
        worst.append(max(errors) / min(errors) - 1)
    assert np.mean(excess) < 0.1
    assert np.mean(worst) > 0.5


UP_AND_DOWN = (0.1, 0.2, 0.3, 0.4, 0.3, 0.2, 0.1)
SIDES = tuple(side * level for side in (1.0, -1.0) for level in UP_AND_DOWN)


def rudder_steps(
    levels: tuple[float, ...], seed: int, *, play: float = 0.0, bias: float = 0.0, std: float = 0.001
) -> list[StepSample]:
    """Plateaus at three throttles of a rudder with play, half its width, that stands off its command by a bias."""
    rng, samples = np.random.default_rng(seed), []
    for throttle in (8.0, 12.0, 16.0):
        before, acts = 0.0, 0.0
        for rudder in levels:
            acts = float(np.clip(acts, rudder - play, rudder + play))
            speed = 0.5 * throttle - 2.0 * acts**2
            rate = 0.05 * throttle * (acts + bias)
            state = np.array([speed, rate]) + np.array([0.01, std]) * rng.standard_normal(2)
            hold = Hold(
                number=len(samples) + 1, batch=0, begin=0, settled=0, end=100, commands=(throttle, rudder),
                changed="rudder", change=(0.0, rudder - before), first=False,
            )  # fmt: skip
            part = Plateau(
                state=state, std=np.array([0.01, std]), sway=np.nan, sway_std=np.nan, turns=1,
                inputs=np.array([throttle, rudder]), duration_s=30.0,
            )  # fmt: skip
            samples.append(StepSample(hold=hold, steady_s=10.0, plateau=part))
            before = rudder
    return samples


def rudder_finding(kind: str, samples: list[StepSample]) -> Comparison | None:
    found = [one for one in comparisons(samples) if (one.kind, one.command) == (kind, "rudder")]
    return found[0] if found else None


@pytest.mark.parametrize(("kind", "wrong"), [("hysteresis", {"play": 0.02}), ("asymmetry", {"bias": 0.02})])
def test_play_and_a_biased_rudder_are_found_with_their_size(kind: str, wrong: dict[str, float]) -> None:
    sizes = []
    for seed in range(20):
        found = rudder_finding(kind, rudder_steps(SIDES, seed, **wrong))
        assert found is not None
        assert found.p_value < SIGNIFICANT
        sizes.append(abs(found.difference))
    assert np.mean(sizes) == pytest.approx(0.02, rel=0.25)


@pytest.mark.thorough
def test_without_them_findings_are_as_rare_as_stated() -> None:
    seeds = 200
    for kind in ("hysteresis", "asymmetry"):
        found = [rudder_finding(kind, rudder_steps(SIDES, seed)) for seed in range(seeds)]
        rate = np.mean([one is not None and one.p_value < SIGNIFICANT for one in found])
        level = SIGNIFICANT
        assert rate <= level + 3 * np.sqrt(level * (1 - level) / seeds)


def test_steps_up_alone_miss_the_play_that_steps_up_and_down_show() -> None:
    up = tuple(side * level for side in (1.0, -1.0) for level in UP_AND_DOWN[:4])
    for seed in range(10):
        found = rudder_finding("hysteresis", rudder_steps(up, seed, play=0.02))
        assert found is None or found.p_value > SIGNIFICANT
