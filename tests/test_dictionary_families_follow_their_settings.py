"""The desired motion of each family has its settings; contradictory settings are refused in one line."""

import pickle
from dataclasses import replace

import cloudpickle
import numpy as np
import pytest

from design_case import one_line, spec, vessel
from expdesign.dictionary import FAMILIES, Family, Setting, build_primitive, complete_settings, family
from expdesign.errors import InputError, UnknownName
from expdesign.values import Array

TIME_S = np.linspace(0.0, 60.0, 6001)


def desired(name: str, **settings: float) -> Array:
    """(k, 3) u, v, r over a minute."""
    request = spec(name, duration_s=60.0, **settings)
    return family(name).reference(request.settings, TIME_S)


def integral(rate: Array) -> float:
    """Over the minute, by the trapezium rule."""
    return float(np.trapezoid(rate, TIME_S))


def corners(rate: Array) -> int:
    """How often a signal changes its sign."""
    return int(np.count_nonzero(np.diff(np.sign(rate[np.abs(rate) > 1e-9]))))


@pytest.mark.parametrize(("period_s", "swings"), [(60.0, 1), (20.0, 3), (7.0, 8)])
def test_a_zigzag_swings_to_its_amplitude_in_its_period_and_returns_to_its_heading(period_s: float, swings: int):
    u, v, r = desired("zigzag", speed_mps=1.2, yaw_rate_radps=0.2, sway_mps=0.1, period_s=period_s).T
    assert (u == 1.2).all()
    assert np.abs(r).max() == pytest.approx(0.2, rel=1e-12)
    np.testing.assert_allclose(v, -0.5 * r, atol=1e-15)  # outwards of the turn
    assert integral(r) == pytest.approx(0.0, abs=1e-12)
    assert corners(r) in (2 * swings, 2 * swings + 1)
    assert r[np.flatnonzero(np.abs(r) > 1e-9)[0]] > 0  # first to starboard
    heading = np.concatenate([[0.0], np.cumsum((r[1:] + r[:-1]) / 2 * np.diff(TIME_S))])
    # Evenly to both sides: a quarter period either way, up to the ends that are faded and the effect of centring.
    assert heading.max() == pytest.approx(-heading.min(), rel=0.5)


def test_a_negative_yaw_rate_zigzags_the_other_way():
    settings = {"speed_mps": 1.0, "period_s": 20.0, "sway_mps": 0.1}
    starboard, port = (desired("zigzag", yaw_rate_radps=rate, **settings) for rate in (0.2, -0.2))
    np.testing.assert_array_equal(port[:, 2], -starboard[:, 2])


def test_a_sway_zigzag_comes_back_to_its_line_on_a_steady_heading():
    u, v, r = desired("sway_zigzag", sway_mps=0.4, period_s=20.0, speed_mps=0.3).T
    assert (u == 0.3).all()
    assert not r.any()
    assert np.abs(v).max() == pytest.approx(0.4, rel=1e-12)
    assert integral(v) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("speed", "rate"), [(0.8, 0.1), (0.8, -0.1), (2.5, 0.02)])
def test_a_turning_circle_settles_on_the_radius_of_its_speed_over_its_yaw_rate(speed: float, rate: float):
    reference = desired("turning_circle", speed_mps=1.1, turn_speed_mps=speed, yaw_rate_radps=rate, entry_s=15.0)
    np.testing.assert_allclose(reference[0], (1.1, 0.0, 0.0), atol=1e-15)
    u, v, r = reference[TIME_S >= 15.0].T
    np.testing.assert_allclose(np.hypot(u, v) / np.abs(r), speed / abs(rate), rtol=1e-12)
    assert (np.sign(r) == np.sign(rate)).all()


def test_a_turning_circle_drifts_outwards_as_set():
    reference = desired(
        "turning_circle", speed_mps=1.1, turn_speed_mps=0.8, yaw_rate_radps=0.1, entry_s=15.0, sway_mps=0.2
    )
    np.testing.assert_allclose(reference[-1], (0.8, -0.2, 0.1), atol=1e-12)


def test_an_inward_spiral_tightens_steadily_to_its_end_rate():
    u, v, r = desired("inward_spiral", speed_mps=0.75, yaw_rate_radps=-0.6, sway_mps=0.125, entry_s=5.0).T
    assert (u == 0.75).all()
    np.testing.assert_allclose(r, -0.6 * TIME_S / 60.0, atol=1e-15)
    assert v[0] == 0.0
    np.testing.assert_allclose(v[TIME_S >= 5.0], 0.125, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "settings", "first", "last"),
    [
        ("acceleration", {"speed_mps": 2.0}, 0.0, 2.0),
        ("acceleration", {"speed_mps": 2.0, "from_speed_mps": 0.5}, 0.5, 2.0),
        ("deceleration", {"speed_mps": 2.0}, 2.0, 0.0),
        ("deceleration", {"speed_mps": 2.0, "to_speed_mps": -0.5}, 2.0, -0.5),
    ],
)
def test_accelerations_and_decelerations_end_where_they_should(name: str, settings: dict, first: float, last: float):
    reference = desired(name, ramp_fraction=0.5, **settings)
    assert not reference[:, 1:].any()
    assert reference[0, 0] == first
    np.testing.assert_allclose(reference[TIME_S >= 30.0, 0], last, atol=1e-12)
    steps = np.diff(reference[:, 0]) * np.sign(last - first)
    assert (steps > -1e-15).all()


TELEGRAPH = {
    "speed_mps": 0.8, "speed_swing_mps": 0.3, "sway_mps": 0.2, "yaw_rate_radps": 0.05, "hold_s": 4.0, "rise_s": 0.5
}  # fmt: skip


def test_a_telegraph_switches_between_its_two_levels():
    reference = desired("telegraph", **TELEGRAPH) - (0.8, 0.0, 0.0)
    swings = reference / (0.3, 0.2, 0.05)
    assert np.abs(swings).max() <= 1.0 + 1e-12
    assert not swings[[0, -1]].any()  # it begins and ends at its mean
    # A switch takes about the rise time, once in the mean hold time, so it is on a level for the larger part.
    assert (np.abs(swings) > 0.95).mean() > 0.5
    assert all(corners(swings[:, i]) > 0 for i in range(3))


def test_a_telegraph_is_the_same_for_the_same_draw_and_another_for_another():
    first, again, other = (desired("telegraph", **TELEGRAPH, draw=draw) for draw in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.1


def test_a_telegraph_switches_as_often_as_its_hold_time_says():
    counts = [
        sum(corners(desired("telegraph", **TELEGRAPH | {"rise_s": 0.05}, draw=draw)[:, i]) for i in (1, 2))
        for draw in range(30)
    ]
    expected = 2 * 60.0 / 4.0  # two signals, Poisson: the standard error of the mean over draws is sqrt(expected / 30)
    assert np.mean(counts) == pytest.approx(expected, abs=5 * np.sqrt(expected / 30))


@pytest.mark.parametrize("kind", FAMILIES, ids=lambda kind: kind.name)
def test_every_family_explains_itself_and_has_a_duration(kind: Family):
    assert kind.summary
    assert kind.settings[0].name == "duration_s"
    assert all(setting.meaning and setting.low < setting.high for setting in kind.settings)
    assert family(kind.name) is kind


def test_no_two_families_share_a_name():
    assert len({kind.name for kind in FAMILIES}) == len(FAMILIES)


TWO = Family(
    name="two",
    summary="for this test",
    settings=(
        Setting(name="duration_s", meaning="length", low=1.0, high=100.0),
        Setting(name="speed_mps", meaning="speed", default=2.0, low=0.0, high=5.0),
    ),
    reference=lambda settings, time_s: np.zeros((len(time_s), 3)),
)


def test_settings_are_completed_with_their_defaults():
    assert complete_settings(TWO, {"duration_s": 7}) == {"duration_s": 7.0, "speed_mps": 2.0}


@pytest.mark.parametrize(
    ("given", "error", "says"),
    [
        ({}, InputError, "duration_s is missing: length"),
        ({"duration_s": 0.5}, InputError, "duration_s is 0.5, expected 1 to 100"),
        ({"duration_s": 7, "speed_mps": 5.1}, InputError, "speed_mps is 5.1, expected 0 to 5"),
        ({"duration_s": float("nan")}, InputError, "duration_s is nan, expected 1 to 100"),
        ({"duration_s": 7, "sped_mps": 1}, UnknownName, "'sped_mps', did you mean 'speed_mps'"),
    ],
)
def test_settings_that_are_missing_out_of_range_or_unknown_are_named(given: dict, error: type, says: str):
    with pytest.raises(error, match=says) as caught:
        complete_settings(TWO, given)
    assert one_line(caught.value)


@pytest.mark.parametrize(
    ("name", "settings", "says"),
    [
        ("zigzag", {"duration_s": 10, "period_s": 500, "speed_mps": 1, "yaw_rate_radps": 0.1}, "period_s is 500"),
        ("zigzag", {"duration_s": 10, "period_s": 0.125, "speed_mps": 1, "yaw_rate_radps": 0.1}, "period_s is 0.125"),
        ("sway_zigzag", {"duration_s": 10, "period_s": 500, "sway_mps": 0.1}, "period_s is 500"),
        ("acceleration", {"duration_s": 0.15, "speed_mps": 1}, "duration_s is 0.15, expected at least two samples"),
    ],
)
def test_runs_that_cannot_be_are_refused_in_one_line(name: str, settings: dict, says: str):
    with pytest.raises(InputError, match=f"^primitive 'odd one': .*{says}") as caught:
        build_primitive(vessel("model-ship"), spec(name, name="odd one", **settings))
    assert one_line(caught.value)


def test_an_unknown_family_is_answered_with_the_nearest():
    with pytest.raises(UnknownName, match="'zig_zag', did you mean 'zigzag'"):
        family("zig_zag")


@pytest.mark.parametrize("one", FAMILIES, ids=lambda one: one.name)
def test_every_family_is_the_same_in_another_process_and_in_remembered_results(one):
    """By the standard library, which results are kept with, and as tasks are sent."""
    assert pickle.loads(pickle.dumps(one)) is one
    assert pickle.loads(cloudpickle.dumps(one)) is one
    other = replace(one, summary="another")
    assert pickle.loads(cloudpickle.dumps(other)).summary == "another"
