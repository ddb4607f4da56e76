"""tau1 to tau11 stay in the ranges of F. Ljungberg, doctoral thesis, Linköping University, 9.1.1."""

import pytest

from design_case import example_dictionary, vessel

PRIMITIVES = {primitive.name[:5]: primitive for primitive in example_dictionary("model-ship")}
SHARE = 0.01  # overshoot and shortfall allowed to the simulated motion, of the published range


def reach(name: str) -> tuple[tuple[float, float], ...]:
    """(lowest, highest) u, v and r of the simulated run."""
    velocity = PRIMITIVES[name].trajectory.velocity
    return tuple((float(column.min()), float(column.max())) for column in velocity.T)


def test_all_eleven_last_300_samples_at_8_hz():
    assert list(PRIMITIVES) == [f"tau{number:02d}" for number in range(1, 12)]
    for primitive in PRIMITIVES.values():
        assert len(primitive.commands) == 300
        assert primitive.commands.sample_time_s == vessel("model-ship").sample_time_s == 1 / 8


@pytest.mark.parametrize(("name", "first", "last"), [("tau01", 1.0, 0.0), ("tau02", 0.0, 1.0)])
def test_decelerations_and_accelerations_change_surge_alone(name: str, first: float, last: float):
    run = PRIMITIVES[name].trajectory.velocity
    assert run[0, 0] == pytest.approx(first, abs=SHARE)
    assert run[-1, 0] == pytest.approx(last, abs=SHARE)
    (low, high), sway, yaw = reach(name)
    assert low >= -SHARE
    assert high <= 1 + SHARE
    assert sway == yaw == (0.0, 0.0)


@pytest.mark.parametrize(
    ("name", "u", "v", "r"),
    [
        ("tau03", 0.35, 0.1, 0.2),
        ("tau04", 0.8, 0.1, 0.2),
        ("tau05", 1.15, 0.1, 0.2),
        ("tau06", 0.35, 0.15, 0.35),
        ("tau07", 0.7, 0.15, 0.35),
        ("tau08", 1.0, 0.15, 0.35),
    ],
)
def test_zigzags_fill_their_range_on_both_sides(name: str, u: float, v: float, r: float):
    surge, sway, yaw = reach(name)
    assert surge == pytest.approx((u, u), rel=SHARE)
    for (low, high), limit in ((sway, v), (yaw, r)):
        assert max(-low, high) == pytest.approx(limit, rel=SHARE)
        # The side that begins and ends faded is a twelfth of a swing shorter, so the other is that much lower.
        assert min(-low, high) > (1 - 1 / 12) * limit


@pytest.mark.parametrize(("name", "u", "v"), [("tau09", 0.4, 0.05), ("tau10", 0.75, 0.125), ("tau11", 1.0, 0.2)])
def test_inward_spirals_tighten_to_port(name: str, u: float, v: float):
    surge, sway, yaw = reach(name)
    assert surge == pytest.approx((u, u), rel=SHARE)
    assert sway[1] == pytest.approx(v, rel=SHARE)
    assert sway[0] >= -SHARE * v
    assert yaw[0] == pytest.approx(-0.6, rel=SHARE)
    assert yaw[1] <= SHARE * 0.6
