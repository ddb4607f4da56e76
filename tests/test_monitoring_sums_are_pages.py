"""Sums of log-likelihood ratios are Page's: largest over all beginnings, begun anew at zero, with a known threshold."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy

from expdesign.monitoring import TOLD_APART, Calibration, Rules, State, calibrate, cusum, threshold, watch
from expdesign.monitoring.calibration import ROUGHER
from expdesign.monitoring.cusum import (
    ALIKE,
    LOAD_SETTLED,
    SURELY,
    TUNED_TO,
    WEATHER_LIMIT,
    WEATHER_STRETCHES,
    _counted,
    _less,
    _noticed,
    _rougher_by,
    _scattered,
    _summed,
    _waited,
    estimates,
    load_of,
    soonest,
    with_load,
)
from expdesign.monitoring.force import Judged
from expdesign.monitoring.state import Step
from monitoring_case import CHANGES, STRETCH_S, drawn_columns, drawn_grams, grams_from


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return calibrate(drawn_grams(600, seed=0))


def stretch(score: np.ndarray, information: np.ndarray, forces: int) -> Judged:
    """One whose scores no force takes part of."""
    none, square = np.zeros(forces), np.zeros((forces, forces))
    return Judged(
        score=score, information=information, by_force=np.zeros((len(score), forces)), force_score=none,
        force_information=square, quadratic=np.array(0.0), grown=np.eye(forces), gain=square, towards=none,
        seen=(np.zeros((forces, len(score))), square),
    )  # fmt: skip


def test_a_sum_is_the_largest_over_all_beginnings_and_knows_its_own(calibration: Calibration) -> None:
    """Of both directions of each change: ratio d score - d^2 information / 2, over the inflation of its variance."""
    rng, count = np.random.default_rng(1), 60
    inflation = np.array([1.0, 1.5, 2.0, 3.0])
    calibration = replace(calibration, inflation=inflation)
    scores = rng.normal(0.3, 1.0, (count, CHANGES))
    sizes = rng.uniform(0.5, 1.5, (count, CHANGES))
    signs = np.concatenate([np.ones(CHANGES), -np.ones(CHANGES)])
    twice = [np.tile(values, (1, 2)) for values in (scores, sizes)]
    ratios = (TUNED_TO * signs * twice[0] - TUNED_TO**2 / 2.0 * twice[1]) / np.tile(inflation, 2)
    state = State.begun(calibration, time_s=0.0)
    for number in range(count):
        before = state = replace(state, until_s=STRETCH_S * (number + 1))
        one = stretch(scores[number], np.diag(sizes[number]), len(state.known.mean))
        state, step = _summed(state, one, before, STRETCH_S * number, calibration)
        from_each = np.cumsum(ratios[number::-1], axis=0)[::-1]  # (beginnings, 2 m), to now
        wanted = np.maximum(from_each.max(axis=0), 0.0)
        assert state.ratios == pytest.approx(wanted, abs=1e-9)
        best = from_each.argmax(axis=0)
        for place in np.flatnonzero(wanted > 0):
            begun = best[place]
            assert state.sums.since_s[place] == STRETCH_S * begun
            assert state.sums.stretches[place] == number + 1 - begun
            assert state.sums.score[place] == pytest.approx(scores[begun : number + 1].sum(axis=0))
            since = np.cumsum(ratios[begun : number + 1, place])
            assert state.peaks[place] == pytest.approx(since.max())
        assert (step.statistic, step.change) == (state.ratios.max(), state.ratios.argmax() % CHANGES)


def test_a_change_that_is_not_watched_has_no_sum(calibration: Calibration) -> None:
    calibration = replace(calibration, rate=calibration.rate * [1.0, 0.0, 1.0, 1.0])
    state = State.begun(calibration, time_s=0.0)
    one = stretch(np.array([5.0, 9.0, -7.0, 0.0]), np.eye(CHANGES), len(state.known.mean))
    state, step = _summed(state, one, state, 0.0, calibration)
    assert (state.ratios > 0).tolist() == [True, False, False, False, False, False, True, False]
    assert step.change == 2


def test_every_stretch_is_judged_or_left_out_and_time_beyond_the_reference_adds_up_while_it_lasts(
    calibration: Calibration,
) -> None:
    state, grams = State.begun(calibration, time_s=0.0), drawn_grams(1, seed=5)
    one, seen = stretch(np.zeros(CHANGES), np.eye(CHANGES), len(state.known.mean)), []
    for beyond in (False, True, True, False, True):
        weather = np.full(len(state.weather), 2.0 * WEATHER_LIMIT if beyond else 1.0)
        state = _counted(state, one, weather, calibration, 60.0, int(grams.kind[0]), grams.budget[0])
        seen.append((state.judged_s, state.left_out_s, state.beyond_s, state.load.judged))
    assert seen == [(60, 0, 0, 1), (60, 60, 60, 2), (60, 120, 120, 3), (120, 120, 0, 4), (120, 180, 60, 5)]
    for _ in range(2):  # beyond it for one change alone
        weather = np.where(np.arange(CHANGES) == 1, 2.0 * WEATHER_LIMIT, 1.0)
        state = _counted(state, one, weather, calibration, 60.0, int(grams.kind[0]), grams.budget[0])
    assert state.beyond_of_s.tolist() == [0.0, 120.0, 0.0, 0.0]
    assert (state.judged_s, state.left_out_s) == (240.0, 180.0)


@pytest.mark.parametrize("alike", [(True, False), (False, True), (True, True)])
def test_of_rougher_weathers_those_count_that_a_change_resembles_and_winds(
    calibration: Calibration, alike: tuple[bool, bool]
) -> None:
    """Whatever the unit of the weights, so that a share of the largest decides."""
    weights = calibration.weights.copy()
    weights[2, -2:] = 5.0 * np.where(alike, 1.0, ALIKE / 2.0)
    calibration, state = replace(calibration, weights=weights), State.begun(calibration, time_s=0.0)
    counts = [*np.repeat(alike, len(ROUGHER)), *[True] * (len(state.rougher) - 2 * len(ROUGHER))]
    for gains in np.random.default_rng(6).normal(size=(20, len(state.rougher))):
        state = replace(state, rougher=state.sums.rougher[2] + gains)
        assert _rougher_by(state, 2, calibration) == pytest.approx(gains[np.array(counts)].max())


def test_the_threshold_is_never_below_that_of_one_sum_a_stretch() -> None:
    assert threshold(1, 0.1) == pytest.approx(math.log(2.0))
    assert threshold(3, 50.0) == pytest.approx(math.log(300.0))


@pytest.mark.parametrize(("rate", "limit"), [(0.7, 9.0), (1.5, 12.5), (40.0, 5.0)])
def test_the_soonest_alarm_is_that_of_a_change_whose_scores_are_as_expected(rate: float, limit: float) -> None:
    """A change of the size that matters moves each score by its information."""
    total, count = 0.0, 0
    while total < limit:
        total, count = total + TUNED_TO * rate - TUNED_TO**2 / 2.0 * rate, count + 1
    assert soonest(np.array([rate, 0.0]), limit).tolist() == [max(count, TOLD_APART[0]), math.inf]


def test_products_of_a_changed_ship_are_those_of_what_it_leaves() -> None:
    """X'X and X'e with e less X times the change."""
    rng = np.random.default_rng(2)
    table, change = rng.standard_normal((30, 6)), rng.standard_normal(3)
    left = table.copy()
    left[:, -1] -= table[:, :3] @ change
    assert _less(table.T @ table, change) == pytest.approx(left.T @ left)


@pytest.mark.parametrize("number", [0, 3])
def test_sizes_since_the_watch_began_are_right_within_what_is_stated(calibration: Calibration, number: int) -> None:
    """Over voyages: errors are one standard deviation, within 4 of their errors, and no alarm is asked for."""
    change, far = np.zeros(CHANGES), []
    change[number] = 0.8
    for seed in range(24):
        state = State.begun(calibration, time_s=0.0)
        grams = grams_from(drawn_columns(15, seed=700 + seed, change=change))
        state, *_ = watch(calibration, state, grams, rules=Rules(limit=np.inf))
        value, std = estimates(state, calibration)
        far.append((value[number] - change[number]) / std[number])
    mean_square = float(np.mean(np.square(far)))
    assert 1.0 - 4.0 * math.sqrt(2.0 / 24) < mean_square < 1.0 + 4.0 * math.sqrt(2.0 / 24)
    assert abs(np.mean(far)) < 4.0 / math.sqrt(24)


def test_a_load_that_is_taken_for_the_ships_is_counted_once(calibration: Calibration) -> None:
    """What the filter holds of it moves to the ship; all of it, and nothing of the force."""
    carried = np.arange(CHANGES) < 2
    calibration = replace(calibration, load=carried)
    state = State.begun(calibration, time_s=0.0)
    forces = len(state.known.mean) - len(calibration.loads)
    mean = np.r_[np.linspace(0.1, 0.3, forces), 1.5, -0.7]
    load = replace(state.load, stay_s=3600.0, judged=LOAD_SETTLED[0])
    state = replace(state, known=replace(state.known, mean=mean), load=load)
    after = with_load(state, calibration)
    assert after.known.mean[:forces] == pytest.approx(mean[:forces])
    assert after.known.mean[forces:].tolist() == [0.0, 0.0]
    assert after.shift[carried] - state.shift[carried] == pytest.approx(mean[forces:])
    assert load_of(after, calibration)[0] == pytest.approx(load_of(state, calibration)[0])


def test_time_without_a_stretch_lets_what_is_known_of_the_force_fade(calibration: Calibration) -> None:
    """Its mean by its autocorrelation over the gap, and its variance towards that of the force."""
    state, *_ = watch(
        calibration, State.begun(calibration, time_s=0.0), drawn_grams(20, seed=3), rules=Rules(limit=99.0)
    )
    gap_s = 500.0
    later = _waited(replace(state, heading=1.0), calibration, state.until_s + 440.0, state.until_s + gap_s, 1.0)
    keep = calibration.nuisance.memory(gap_s, 0.0)
    assert later.until_s == state.until_s + gap_s
    assert later.known.mean == pytest.approx(keep * state.known.mean)
    assert later.sums.taken == pytest.approx(keep[:, None] * state.sums.taken)
    assert later.whole.taken == pytest.approx(keep[:, None] * state.whole.taken)


def test_scores_that_all_say_the_same_do_not_scatter_and_gusts_do(calibration: Calibration) -> None:
    """What they say beyond a steady change is the sum of squares about their weighted mean."""
    inflation, sizes = 1.5, np.array([1.0, 2.0, 0.5, 1.5, 1.0, 3.0])
    calibration = replace(calibration, inflation=np.full(CHANGES, inflation))
    for steady, gust in ((0.8, 0.0), (0.8, 6.0), (0.0, 9.0)):
        state = State.begun(calibration, time_s=0.0)
        seen = steady + gust * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
        for size, value in zip(sizes, seen, strict=True):
            one = stretch(np.full(CHANGES, value * size), size * np.eye(CHANGES), len(state.known.mean))
            state = replace(state, sums=state.sums.added(one)[0])
        mean = np.average(seen, weights=sizes)
        rest = float(sizes @ (seen - mean) ** 2) / inflation / scipy.stats.chi2.ppf(SURELY, len(sizes) - 1)
        assert _scattered(state, 1, calibration) == pytest.approx(max(1.0, rest))
        assert (rest > 1.0) == (gust > 0.0)


def test_time_in_which_a_large_sum_is_too_short_to_judge_adds_up(calibration: Calibration) -> None:
    """A squall of four stretches: each adds its time while the sum is above the threshold."""
    columns = drawn_columns(70, seed=110, quick=0.5)
    columns[50:54, :, -1] += 2.0 * columns[50:54, :, 0]
    grams, rules = grams_from(columns), Rules(limit=threshold(CHANGES, 1e3))
    state, longest = State.begun(calibration, time_s=0.0), 0.0
    for index in range(len(grams)):
        before = state.undecided_s
        state, *_ = watch(calibration, state, grams.part(slice(index, index + 1)), rules=rules)
        assert state.undecided_s in (0.0, before + STRETCH_S)
        longest = max(longest, state.undecided_s)
    assert longest >= 2 * STRETCH_S


def test_the_weather_is_an_average_over_stretches_in_units_of_the_reference(calibration: Calibration) -> None:
    """After one stretch it has moved by one part of thirty; half of that where the reference surprises twice."""
    moves = []
    for factor in (1.0, 2.0, 4.0):
        other = replace(calibration, surprise=factor * calibration.surprise)
        begun = State.begun(other, time_s=0.0)
        state, *_ = watch(other, begun, drawn_grams(1, seed=8), rules=Rules(limit=np.inf))
        moves.append(WEATHER_STRETCHES * (state.weather - begun.weather) + begun.weather)
    assert (moves[0] > 0.0).all()
    assert np.array(moves[1:]) == pytest.approx(np.array([moves[0] / 2.0, moves[0] / 4.0]))


@pytest.mark.parametrize(
    ("rougher", "stretches", "said"),
    [
        pytest.param(1.0, 20, "weather", id="weather that lasts is believed"),
        pytest.param(1.0, 19, "undecided", id="weather that begins looks like a change"),
        pytest.param(-1.0, 30, "undecided", id="weather changes more often than ships"),
        pytest.param(-6.0, 6, "undecided", id="few stretches tell nothing"),
        pytest.param(-6.0, 7, "alarm", id="a change that weather does not explain"),
    ],
)
def test_a_sum_above_the_threshold_is_weather_an_alarm_or_waited_for(
    calibration: Calibration, monkeypatch: pytest.MonkeyPatch, rougher: float, stretches: int, said: str
) -> None:
    state = State.begun(calibration, time_s=0.0)
    state = replace(
        state, until_s=5e3, ratios=20.0 * (np.arange(2 * CHANGES) == 2), peaks=20.0 * (np.arange(2 * CHANGES) == 2),
        sums=replace(state.sums, stretches=np.full(2 * CHANGES, float(stretches))),
    )  # fmt: skip
    alarm = SimpleNamespace(pushes=(), value=10.0, std=1.0, since_s=4e3)
    monkeypatch.setattr(cusum, "_rougher_by", lambda *_: rougher)
    monkeypatch.setattr(cusum, "_scattered", lambda *_: 1.0)
    monkeypatch.setattr(cusum, "raised", lambda state, *_: (state, alarm))
    step, rules = Step(time_s=5e3, statistic=20.0, change=2), Rules(limit=10.0)
    after, found, told = _noticed(state, step, calibration, rules, STRETCH_S, None)
    assert (after.by_weather > 0, after.undecided_s, found is not None) == (
        said == "weather", STRETCH_S * (said == "undecided"), said == "alarm",
    )  # fmt: skip
    assert (after.ratios[2], told.compared) == (20.0 * (said != "weather"), said == "alarm")


def test_weather_that_explains_one_change_ends_the_sums_of_those_that_look_like_it(
    calibration: Calibration, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the angle between their weights, whatever their unit."""
    angles = np.array([0.0, math.acos(0.9 * ALIKE), math.acos(1.1 * ALIKE), math.pi / 2.0])
    weights = np.zeros_like(calibration.weights)
    weights[:, :2] = 5.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    calibration, state = replace(calibration, weights=weights), State.begun(calibration, time_s=0.0)
    ratios = np.array([20.0, 5.0, 6.0, 7.0, 0.0, 3.0, 4.0, 0.0])
    sums = replace(state.sums, stretches=np.full(2 * CHANGES, 30.0))
    monkeypatch.setattr(cusum, "_rougher_by", lambda *_: 1.0)
    monkeypatch.setattr(cusum, "_scattered", lambda *_: 1.0)
    step, rules = Step(time_s=5e3, statistic=20.0, change=0), Rules(limit=10.0)
    state = replace(state, ratios=ratios, peaks=ratios, sums=sums)
    after, *_ = _noticed(state, step, calibration, rules, STRETCH_S, None)
    assert after.ratios.tolist() == [0.0, 5.0, 0.0, 7.0, 0.0, 3.0, 0.0, 0.0]
