"""Where numbers go on a crowded chart."""

from __future__ import annotations

import numpy as np

from expdesign.values import Array

Range = tuple[float, float]


def place_labels(anchors: Array, track: Array, *, size: float, bounds: tuple[Range, Range]) -> Array:
    """A place near each anchor that keeps off the track, the frame and the labels placed before.

    Args:
        anchors: (n, 2) x, y to be labelled, in order.
        track: (k, 2) what labels should not cover.
        size: diameter of a label, in the unit of the coordinates.
        bounds: x range and y range.

    Returns:
        (n, 2) label centres.
    """
    angles = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    offsets = np.concatenate([ring * size * reach for reach in (1.1, 1.7, 2.6, 3.6)])
    (low_x, high_x), (low_y, high_y) = bounds
    placed: list[Array] = []
    for anchor in anchors:
        centres = anchor + offsets
        near_track = np.hypot(*(centres[:, None, :] - track).transpose(2, 0, 1)) < 0.75 * size
        cost = np.hypot(*offsets.T) / size + 4.0 * near_track.any(axis=1)
        for other in placed:
            cost += 12.0 * (np.hypot(*(centres - other).T) < 1.15 * size)
        outside = (centres < [low_x + size / 2, low_y + size / 2]) | (centres > [high_x - size / 2, high_y - size / 2])
        placed.append(centres[int(np.argmin(cost + 50.0 * outside.any(axis=1)))])
    return np.array(placed).reshape(-1, 2)
