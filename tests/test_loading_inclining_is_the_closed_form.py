"""Inclining tests: heel, metacentric height and inertia are the textbook's, errors are their derivatives."""

import math

import numpy as np
import pytest

from expdesign.errors import InputError
from expdesign.loading import heel_of_shift, inclining

SHIP = {"displacement_kg": 3.7e6, "metacentric_height_m": 1.3}
TEST = {**SHIP, "mass_kg": 2e4, "shift_m": 10.0, "period_s": 9.0}


def test_the_height_follows_from_the_heel() -> None:
    heel = heel_of_shift(mass_kg=2e4, shift_m=10.0, **SHIP)
    assert 2e4 * 10.0 / (3.7e6 * math.tan(heel)) == pytest.approx(1.3, rel=1e-12)


def test_errors_of_height_and_inertia_are_derivatives() -> None:
    found = inclining(**TEST, heel_std_rad=1e-6, period_std_s=1e-5)
    height = [2e4 * 10.0 / (3.7e6 * math.tan(found.heel_rad + step)) for step in (-1e-6, 1e-6)]
    assert found.metacentric_height_std_m == pytest.approx((height[0] - height[1]) / 2, rel=1e-6)

    def inertia(gm: float, period: float) -> float:
        return 3.7e6 * 9.81 * gm * (period / (2 * math.pi)) ** 2

    by_height = (inertia(height[0], 9.0) - inertia(height[1], 9.0)) / 2
    by_period = (inertia(1.3, 9.0 + 1e-5) - inertia(1.3, 9.0 - 1e-5)) / 2
    assert found.inertia_kgm2 == pytest.approx(inertia(1.3, 9.0), rel=1e-12)
    assert found.inertia_std_kgm2 == pytest.approx(math.hypot(by_height, by_period), rel=1e-6)


def test_four_shifts_halve_the_error_and_no_decay_leaves_the_inertia_open() -> None:
    one, four = (inclining(**TEST, heel_std_rad=1e-4, shifts=count) for count in (1, 4))
    assert four.metacentric_height_std_m == pytest.approx(one.metacentric_height_std_m / 2, rel=1e-12)
    assert one.inertia_std_kgm2 == np.inf


def test_nothing_that_is_not_positive_is_taken() -> None:
    with pytest.raises(InputError, match="shift_m is 0, expected more than 0"):
        inclining(**{**TEST, "shift_m": 0.0}, heel_std_rad=1e-4)
