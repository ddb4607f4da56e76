"""Waves of [roll.waves] roll a ship as their slope does, are met as encounter says, and cost information."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from expdesign.loading import build_question, run_information
from expdesign.signals import AUXILIARY
from expdesign.simulation import in_waves, simulate
from expdesign.values import Array
from expdesign.vessel import NOMINAL, Vessel
from expdesign.waves import G_MPS2, Jonswap, Waves, encounter
from rolling_ship import GUESS, UNDER_WAY, orders, roll_model, steps

SWELL = Waves(height_m=2.0, period_s=8.0, from_rad=0.3)
STEP_S = 0.5


def on_course(course_rad: float, speed_mps: float, samples: int = 20_000) -> Array:
    along = speed_mps * STEP_S * np.arange(samples)
    return np.column_stack([along * np.cos(course_rad), along * np.sin(course_rad), np.full(samples, course_rad)])


def slope_variance() -> float:
    w = np.linspace(0.5, 3.0, 4000) * 2.0 * np.pi / SWELL.period_s
    density = Jonswap(height_m=SWELL.height_m, peak_radps=2.0 * np.pi / SWELL.period_s).density(w)
    return float(np.trapezoid(density * (w**2 / G_MPS2) ** 2, w))


def test_waves_abeam_have_the_slope_of_their_spectrum_and_waves_ahead_have_none() -> None:
    """Variances of 8 draws of 10,000 s each."""
    abeam = [
        SWELL.slope(on_course(SWELL.from_rad + np.pi / 2, 0.0), STEP_S, np.random.default_rng(seed)).var()
        for seed in range(8)
    ]
    assert np.mean(abeam) == pytest.approx(slope_variance(), abs=4 * np.std(abeam) / np.sqrt(8))
    ahead = SWELL.slope(on_course(SWELL.from_rad, 4.0), STEP_S, np.random.default_rng(1))
    assert np.abs(ahead).max() < 1e-12


@pytest.mark.parametrize("angle", [1.2, 2.0, 2.8])
def test_waves_are_met_at_the_frequency_of_encounter(angle: float) -> None:
    """The peak of the slope's spectrum moves as the frequency of its peak is met; the spectrum is narrow there."""
    speed, step = 4.0, 2.0 * np.pi / SWELL.period_s
    slope = SWELL.slope(on_course(SWELL.from_rad + np.pi - angle, speed), STEP_S, np.random.default_rng(2))
    frequency, power = scipy.signal.welch(slope, 1.0 / STEP_S, nperseg=1024)
    met = encounter(np.array([step]), speed_mps=speed, heading_rad=angle)[0]
    assert 2.0 * np.pi * frequency[np.argmax(power)] == pytest.approx(met, rel=0.06)


def test_all_courses_together_meet_half_of_the_slope() -> None:
    frequency = np.linspace(0.005, 8.0, 1600)
    for speed in (0.0, 4.0):
        met = SWELL.met_density(frequency, speed)
        assert met.sum() * (frequency[1] - frequency[0]) == pytest.approx(slope_variance() / 2.0, rel=0.01)


def in_swell(waves: Waves) -> Vessel:
    ship = roll_model()
    assert ship.pendulum is not None
    return replace(ship, pendulum=replace(ship.pendulum, waves=waves))


def test_a_ship_follows_the_slope_of_a_long_swell() -> None:
    """A swell of 30 roll periods: she stays normal to the water, and her accelerometer reads gravity along it."""
    swell = Waves(height_m=1.0, period_s=36.0, from_rad=np.pi / 2)
    ship = in_swell(swell)
    still = simulate(ship, orders(ship, 5000, np.random.default_rng(3)), velocity=UNDER_WAY)
    rolled = in_waves(ship, still, np.random.default_rng(4))
    slope = swell.slope(still.pose, still.sample_time_s, np.random.default_rng(4))
    assert rolled.auxiliary is not None
    assert still.auxiliary is not None
    added = (rolled.auxiliary - still.auxiliary)[500:]
    roll, reading = (added[:, AUXILIARY.index(name)] for name in ("roll_rad", "imu_lateral_mps2"))
    np.testing.assert_allclose(roll, -slope[500:], atol=0.05 * np.abs(slope).max())
    np.testing.assert_allclose(reading, -G_MPS2 * roll, atol=0.02 * np.abs(reading).max())
    np.testing.assert_array_equal(rolled.pose, still.pose)


def test_waves_cost_information_and_low_ones_nothing() -> None:
    question = build_question(roll_model(), (NOMINAL, None), known={}, guess=GUESS)
    run = steps(roll_model())

    def told(height_m: float | None) -> Array:
        sea = None if height_m is None else Waves(height_m=height_m, period_s=1.3, from_rad=0.0)
        ship = roll_model() if sea is None else in_swell(sea)
        found = run_information(ship, question.theta, question.options[0], [run])[0]
        return np.asarray(found[np.ix_(question.places, question.places)] * np.outer(question.size, question.size))

    calm, low, high, higher = told(None), told(1e-7), told(0.01), told(0.02)
    np.testing.assert_allclose(low, calm, rtol=1e-3, atol=1e-6 * np.abs(calm).max())
    for more, less in ((calm, high), (high, higher)):
        assert np.linalg.eigvalsh(more - less).min() > -1e-9 * np.abs(calm).max()
        assert np.trace(less) < 0.9 * np.trace(more)
