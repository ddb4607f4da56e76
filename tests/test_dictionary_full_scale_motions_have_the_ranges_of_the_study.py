"""tau12 to tau20 stay in the ranges of F. Ljungberg, doctoral thesis, Linköping University, 9.3."""

import numpy as np
import pytest

from design_case import SCENARIOS
from expdesign.dictionary import Primitive, build_dictionary
from expdesign.scenario import load_dictionary, load_vessel

SMALL = 1e-6


@pytest.fixture(scope="module")
def motions() -> dict[str, Primitive]:
    ship = load_vessel(SCENARIOS / "vessels" / "azimuth-30m-fast-true.toml")
    built = build_dictionary(ship, load_dictionary(SCENARIOS / "dictionaries" / "full-scale.toml"))
    return {item.name.partition("-")[0]: item for item in built}


def test_nine_motions_of_a_hundred_samples_are_built(motions: dict[str, Primitive]):
    assert list(motions) == [f"tau{number}" for number in range(12, 21)]
    assert all(len(item.commands) == 100 for item in motions.values())


@pytest.mark.parametrize(
    ("name", "u", "v", "r"),
    [
        ("tau12", (0.0, 3.5), (0.0, 0.0), (0.0, 0.0)),
        ("tau13", (0.0, 0.0), (-1.0, 1.0), (0.0, 0.0)),
        *((f"tau{n}", (u, u), (-0.5, 0.5), (-0.03, 0.03)) for n, u in ((17, 3.0), (18, 4.0), (19, 3.0), (20, 4.0))),
    ],
)
def test_velocities_stay_in_the_ranges(motions: dict[str, Primitive], name: str, u, v, r):
    found = motions[name].trajectory.velocity
    for column, (low, high) in zip(found.T, (u, v, r), strict=True):
        assert column.min() >= low - 0.01 * max(abs(high), 0.1)
        assert column.max() <= high + 0.01 * max(abs(high), 0.1)


@pytest.mark.parametrize(("name", "low", "high"), [("tau14", 0.5, 0.8), ("tau15", 0.85, 0.95), ("tau16", 1.1, 1.2)])
def test_steady_sway_is_in_its_range_for_a_third_of_the_run(motions: dict[str, Primitive], name: str, low, high):
    sway = np.abs(motions[name].trajectory.velocity[:, 1])
    assert ((sway >= low) & (sway <= high)).sum() >= 33
    assert sway.max() <= high


@pytest.mark.parametrize(("name", "period_s"), [("tau17", 30), ("tau18", 30), ("tau19", 100), ("tau20", 100)])
def test_zigzags_have_the_period_of_the_study(motions: dict[str, Primitive], name: str, period_s: int):
    """The yaw rate changes its sign twice in a period, so 100 s have about 200 / period changes."""
    rate = motions[name].trajectory.velocity[:, 2]
    changes = int((np.diff(np.sign(rate[np.abs(rate) > SMALL])) != 0).sum())
    assert abs(changes - 200 / period_s) <= 1.5
