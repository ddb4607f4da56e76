"""Velocity in the b-frame from pose.

Source: F. Ljungberg, doctoral thesis, Linköping University, (3.66)-(3.74), for the difference and its correction.
"""

from __future__ import annotations

import numpy as np

from expdesign.records.pose.smoother import smooth
from expdesign.values import Array

VELOCITY_METHODS = ("auto", "measured", "difference", "smoothed")


def central_difference(pose: Array, sample_time_s: float, *, heading_std_rad: float = 0.0) -> Array:
    """Velocity at all samples but the first and the last.

    Noise on the heading shrinks surge and sway on average by mu = E cos(e) = exp(-var / 2) for Gaussian e; they are
    divided by it. Measurement noise of standard deviation s on positions becomes s / (sqrt(2) Ts), correlated over two
    samples.

    Args:
        pose: (k, 3) n-frame north m, east m, heading rad, continuous.
        sample_time_s: time between samples [s].
        heading_std_rad: standard deviation of the heading's noise [rad].

    Returns:
        (k - 2, 3) u, v, r of samples 1 to k - 2.
    """
    rates = (pose[2:] - pose[:-2]) / (2.0 * sample_time_s)
    shrunk = float(np.exp(-(heading_std_rad**2) / 2.0))
    return np.asarray(turned_to_b(rates, pose[1:-1, 2]) / np.array([shrunk, shrunk, 1.0]))


def smoothed_velocity(pose: Array, sample_time_s: float, *, heading_std_rad: float | None = None) -> Array:
    """Velocity at all samples from a Rauch-Tung-Striebel smoother with a constant-velocity model in the n-frame.

    Positions share one signal-to-noise ratio, so that the answer does not depend on where north is; heading has its
    own. The smoothed heading turns the rates into the b-frame.

    Args:
        pose: (k, 3) n-frame north m, east m, heading rad, continuous; k of 4 or more.
        sample_time_s: time between samples [s].
        heading_std_rad: standard deviation of the heading's noise [rad], or None to learn it from the data.

    Returns:
        (k, 3) u, v, r.
    """
    _, moving = smooth(pose[:, :2], sample_time_s)
    heading, turning = smooth(pose[:, 2:], sample_time_s, noise_std=heading_std_rad)
    return turned_to_b(np.hstack([moving, turning]), heading[:, 0])


def turned_to_b(rates: Array, heading_rad: Array) -> Array:
    """R(psi)^T applied to n-frame rates (k, 3) [m/s, m/s, rad/s] at headings (k,)."""
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    north, east, turn = rates.T
    return np.stack([c * north + s * east, c * east - s * north, turn], axis=-1)
