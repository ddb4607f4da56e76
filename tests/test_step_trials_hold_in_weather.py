"""Step trials of a craft that the project does not simulate: intervals, hysteresis, sternway, short holds."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from expdesign.errors import NotInformative
from expdesign.step_trials import StepTrial, controls_of, identify_steps
from expdesign.step_trials.noise import mean_errors
from live_case import errors_of_watched
from plain_craft import RATE_PER_RAD, ROUND, SPEED_PER_RPS, Craft, record

ASTERN = ((4.0, 0.2), (-4.0, 0.2), (-7.0, 0.2), (4.0, 0.2))
LEVELS = tuple((n, a) for a in (0.15, 0.3) for n in (4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 12.0, 10.0, 8.0, 6.0, 4.0))


@cache
def identified(seed: int, craft: Craft) -> StepTrial:
    return identify_steps(record(seed, craft), controls_of(("n1", "rudder1")))


@pytest.mark.parametrize("correlation", [0.0, 0.9, 0.97])
def test_intervals_of_means_of_correlated_noise_hold(correlation: float) -> None:
    """22 means of 200 samples; at a correlation time of 33 samples a quarter of the noise's size is hidden in each."""
    rng, inside, trials = np.random.default_rng(5), [], 60
    for _ in range(trials):
        white = rng.standard_normal((22, 800)) * np.sqrt(1 - correlation**2)
        noise = np.zeros_like(white)
        for k in range(1, 800):
            noise[:, k] = correlation * noise[:, k - 1] + white[:, k]
        parts = [row[600:] for row in noise]
        inside += [abs(p.mean()) < 1.96 * e[0] for p, e in zip(parts, mean_errors(parts), strict=True)]
    assert 0.91 < np.mean(inside) < 0.985


@pytest.mark.thorough
def test_intervals_of_steady_states_hold_in_gusts_and_in_a_current() -> None:
    """Before, three quarters of those of a calm day held."""
    for craft in (Craft(gusts_mps=0.08), Craft(current_mps=0.3, hold_s=80.0)):
        inside = []
        for seed in (0,):
            for one in identified(seed, craft).samples:
                assert one.plateau is not None
                n, rudder = one.hold.commands
                z = (one.plateau.state - [SPEED_PER_RPS * n, RATE_PER_RAD * rudder]) / one.plateau.std
                inside += (np.abs(z) < 1.96).tolist()
        assert np.mean(inside) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / len(inside))


def test_intervals_of_a_trial_that_is_watched_hold_in_waves() -> None:
    """Readings of a step are correlated by waves and count as fewer: as independent ones, eight of ten held."""
    inside = np.abs(np.concatenate([errors_of_watched(seed, Craft()) for seed in range(3)])) < 1.96
    assert np.mean(inside) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / inside.size)


def test_a_current_is_found_and_taken_off_where_the_heading_is_known() -> None:
    (current,) = identified(0, Craft(current_mps=0.3, hold_s=80.0)).currents
    assert current is not None
    assert np.all(np.abs(current.to_mps - [0.3, 0.0]) < 4 * np.sqrt(np.diag(current.covariance)))
    assert identified(0, Craft(gusts_mps=0.08)).currents == (None,)


@pytest.mark.thorough
def test_holds_astern_are_left_out_by_name_and_the_rest_is_as_without_them() -> None:
    trial, plain = identified(1, Craft(steps=ROUND + ASTERN)), identified(1, Craft(steps=ROUND))
    gone = [one for one in trial.samples if one.hold.astern]
    assert [one.hold.number for one in gone] == [16, 17, 18]
    assert all(one.plateau is None and not one.problems and "astern" in one.remarks[0] for one in gone)
    assert len(trial.counted) >= len(plain.counted) - 1
    assert all(one.least > 0 for one in trial.model.damping if one is not None)


@pytest.mark.thorough
def test_hysteresis_at_one_level_is_found_and_none_where_there_is_none() -> None:
    def p_value(craft: Craft) -> float:
        return next(one.p_value for one in identified(3, craft).found if one.kind == "hysteresis")

    assert p_value(Craft(steps=LEVELS, hump=True, planing_play_rps=0.17)) < 0.01
    assert p_value(Craft(steps=LEVELS, hump=True)) > 0.01


def test_steps_of_the_throttle_alone_give_the_half_of_the_speed() -> None:
    model = identified(2, Craft(steps=ROUND[:7])).model
    ((place, damping, _),) = model.halves
    assert place == 0
    assert model.damping[1] is None
    assert damping.at(3.0, 0.12) * SPEED_PER_RPS == pytest.approx(3.0, abs=0.1)
    commands = np.tile([10.0, 0.2], (300, 1))
    measured = np.column_stack([np.full(300, 2.8), np.linspace(0.1, 0.12, 300)])
    simulated = model.simulated(measured, commands, sample_time_s=0.2)
    assert simulated[-1, 0] == pytest.approx(4.0, abs=0.1)
    assert simulated[:, 1] == pytest.approx(measured[:, 1])


def test_holds_too_short_at_one_hertz_are_told_one_that_does() -> None:
    with pytest.raises(NotInformative, match=r"held for 20 s; (\d+) s or more would do, at 1 Hz") as refused:
        identified(3, Craft(step_s=1.0, hold_s=20.0))
    enough_s = float(str(refused.value).split(" s or more")[0].split()[-1])
    assert len(identified(3, Craft(step_s=1.0, hold_s=enough_s)).model.halves) == 2
