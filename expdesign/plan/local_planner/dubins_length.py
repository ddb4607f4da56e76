"""Lengths of the shortest curves of bounded curvature, many at once: what a search needs of them.

Source: L. E. Dubins, On curves of minimal length with a constraint on average curvature, American Journal of
Mathematics 79 (1957), 497-516; in the normal form of A. M. Shkel and V. Lumelsky, Classification of the Dubins set,
Robotics and Autonomous Systems 34 (2001), 179-202.
"""

from __future__ import annotations

import numpy as np

from expdesign.values import Array


def dubins_m(start: Array, end: Array, *, radius_m: float) -> Array:
    """(...,) lengths of the shortest Dubins curves between poses (..., 3) and (..., 3), obstacles ignored [m]."""
    step = (end[..., :2] - start[..., :2]) / radius_m
    d, theta = np.hypot(step[..., 0], step[..., 1]), np.arctan2(step[..., 1], step[..., 0])
    a, b = start[..., 2] - theta, end[..., 2] - theta
    sin_a, sin_b, cos_a, cos_b, cos_ab = np.sin(a), np.sin(b), np.cos(a), np.cos(b), np.cos(a - b)
    with np.errstate(invalid="ignore"):  # a word that does not reach is nan
        # left, straight, left and the like; tiny negative squares are straights of no length
        p = np.sqrt(_square(2 + d**2 - 2 * cos_ab + 2 * d * (sin_a - sin_b)))
        to = np.arctan2(cos_b - cos_a, d + sin_a - sin_b)
        lsl = _turn(to - a) + p + _turn(b - to)
        q = np.sqrt(_square(2 + d**2 - 2 * cos_ab + 2 * d * (sin_b - sin_a)))
        to = np.arctan2(cos_a - cos_b, d - sin_a + sin_b)
        rsr = _turn(a - to) + q + _turn(to - b)
        p = np.sqrt(_square(d**2 - 2 + 2 * cos_ab + 2 * d * (sin_a + sin_b)))
        to = np.arctan2(-cos_a - cos_b, d + sin_a + sin_b) - np.arctan2(-2.0, p)
        lsr = _turn(to - a) + p + _turn(to - b)
        p = np.sqrt(_square(d**2 - 2 + 2 * cos_ab - 2 * d * (sin_a + sin_b)))
        to = np.arctan2(cos_a + cos_b, d - sin_a - sin_b) - np.arctan2(2.0, p)
        rsl = _turn(a - to) + p + _turn(b - to)
        p = 2 * np.pi - np.arccos((6 - d**2 + 2 * cos_ab + 2 * d * (sin_a - sin_b)) / 8)
        t = _turn(a - np.arctan2(cos_a - cos_b, d - sin_a + sin_b) + p / 2)
        rlr = t + p + _turn(a - b - t + p)
        p = 2 * np.pi - np.arccos((6 - d**2 + 2 * cos_ab + 2 * d * (sin_b - sin_a)) / 8)
        t = _turn(-a + np.arctan2(cos_b - cos_a, d + sin_a - sin_b) + p / 2)
        lrl = t + p + _turn(b - a - t + p)
    return np.asarray(radius_m * np.nanmin([lsl, rsr, lsr, rsl, rlr, lrl], axis=0))


def _square(value: Array) -> Array:
    return np.where(np.abs(value) < 1e-12, 0.0, np.where(value < 0, np.nan, value))


def _turn(angle: Array) -> Array:
    """Angles as turns to one side, from 0 to less than 2 pi; rounding does not make a whole turn of none."""
    turn = np.mod(angle, 2 * np.pi)
    return np.where(turn > 2 * np.pi - 1e-9, 0.0, turn)
