"""What a yaw rate adds up to, against the compass: the filtered sums are generalised least squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expdesign.monitoring.compass import turned
from expdesign.monitoring.noise import WHITE

STEPS, SAMPLE_S = 20, 0.5
NOISE = replace(WHITE, std=np.array([1.0, 1.0, 0.8, 2.1]))


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(5, 2, STEPS, 4) columns and (2, STEPS, 4) what is measured: a whole stretch, and one with a gap."""
    columns = np.random.default_rng(seed).standard_normal((5, 2, STEPS, 4))
    seen = np.ones((2, STEPS, 4), dtype=bool)
    seen[:, [0, -1], 3] = False
    seen[1, 9, 2] = False
    return np.where(seen, columns, 0.0), seen


def paths(columns: np.ndarray, window: int, last: int) -> np.ndarray:
    """(5, t) sums of the heading's rate beyond the yaw rate, at every other sample from the second on."""
    excess = columns[:, window, 1:last, 3] - columns[:, window, 1:last, 2]
    return SAMPLE_S * np.cumsum(excess, axis=1)[:, ::2]


@pytest.mark.parametrize(("window", "last"), [(0, STEPS - 1), (1, 9)])
def test_the_sums_have_the_inner_products_of_generalised_least_squares(window: int, last: int) -> None:
    columns, seen = drawn(1)
    found, where = turned(columns, seen, NOISE, sample_s=SAMPLE_S)
    path = paths(columns, window, last)
    count = path.shape[1]
    walk = 2.0 * (0.8 * SAMPLE_S) ** 2 * np.minimum.outer(np.arange(count), np.arange(count))
    R = walk + (2.1 * SAMPLE_S) ** 2 * np.eye(count)
    inverse, one = np.linalg.inv(R), np.ones(count)
    inverse = inverse - np.outer(inverse @ one, one @ inverse) / (one @ inverse @ one)  # where it began is not known
    own = found[:, window] / (2.1 * SAMPLE_S)
    assert own @ own.T == pytest.approx(path @ inverse @ path.T)
    assert where[window].sum() == count - 1


def test_a_turn_of_ship_and_compass_alike_leaves_nothing() -> None:
    columns, seen = drawn(2)
    columns[..., 3] = columns[..., 2]
    found, _ = turned(np.where(seen, columns, 0.0), seen, NOISE, sample_s=SAMPLE_S)
    assert not found.any()
