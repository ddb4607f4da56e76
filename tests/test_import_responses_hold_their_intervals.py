"""Slew rate, dead time and lag of an actuator, found from order and feedback, are within their standard errors."""

from __future__ import annotations

import numpy as np
import pytest

from expdesign.importing import Channel, Followed, followed

FINE_S = 0.01
# Slew rate [rad/s], lag and dead time [s]; time between readings of the order and of the feedback [s].
CASES = {
    "10 Hz": (0.05, 0.5, 0.4, 0.1, 0.1), "1 Hz, neither lag nor dead time": (0.05, 0.0, 0.0, 1.0, 1.0),
    "1 Hz": (0.05, 1.0, 0.8, 1.0, 1.0), "2 Hz": (0.08, 0.6, 0.5, 0.5, 0.5), "5 Hz, no lag": (0.05, 0.0, 0.6, 0.2, 0.2),
    "orders at 1 Hz, feedback at 5 Hz": (0.05, 0.5, 0.5, 1.0, 0.2),
}  # fmt: skip
COARSE = {"every 2 s": (0.05, 0.0, 3.0, 2.0, 2.0), "every 5 s": (0.045, 0.0, 0.0, 5.0, 5.0),
          "every 10 s": (0.045, 0.0, 0.0, 10.0, 10.0)}  # fmt: skip
NOISE_RAD = 0.002


def rudder(case: str, seed: int, moves: int = 24, *, one_clock: bool = False) -> Followed:
    """What is found of a rudder that is moved now and then, simulated in hundredths of a second.

    One clock gives the orders and reads them; otherwise they come at any moment.
    """
    rate, lag_s, delay_s, order_s, read_s = (CASES | COARSE)[case]
    rng = np.random.default_rng(seed)
    slower = max(1.0, order_s / 2.0)
    times = np.arange(0.0, 25.0 * slower * moves, FINE_S)
    begins = np.cumsum(slower * rng.uniform(15, 35, moves))
    if one_clock:
        begins = np.round(begins / order_s) * order_s
    levels = np.r_[0.0, np.radians(rng.choice([-35, -20, -10, 0, 10, 20, 35], moves))]
    order = levels[np.searchsorted(begins, times + FINE_S / 4, side="right")]
    slewed, late = np.zeros(len(times)), np.zeros(len(times))
    gone = 1.0 - np.exp(-FINE_S / lag_s) if lag_s else 1.0
    for k in range(1, len(times)):
        slewed[k] = slewed[k - 1] + np.clip(order[k - 1] - slewed[k - 1], -rate * FINE_S, rate * FINE_S)
        late[k] = late[k - 1] + gone * ((slewed[k] + slewed[k - 1]) / 2 - late[k - 1]) if lag_s else slewed[k]
    asked = np.arange(rng.uniform(0, order_s), times[-1], order_s)
    read = np.arange(rng.uniform(0, read_s), times[-1], read_s)
    feedback = np.interp(read - delay_s, times, late) + rng.normal(scale=NOISE_RAD, size=len(read))
    if one_clock:
        asked = np.arange(0.0, times[-1], order_s)
    told = order[np.round(asked / FINE_S).astype(int)] if one_clock else order[(asked / FINE_S).astype(int)]
    channels = [("rudder1_rad", asked, told), ("reached_rudder1_rad", read, feedback)]
    (found,) = followed({n: Channel(name=n, source="a", time_s=t, values=x) for n, t, x in channels})
    return found


def scores(case: str, seeds: range, *, one_clock: bool = False) -> dict[str, list[float]]:
    """(estimate less truth) over its standard error, by what is estimated, where it is told."""
    truths = dict(zip(("rate", "lag_s", "delay_s"), CASES[case], strict=False))
    found = [rudder(case, seed, one_clock=one_clock) for seed in seeds]
    return {
        name: [(own[0] - truth) / own[1] for one in found if (own := getattr(one, name)) is not None]
        for name, truth in truths.items()
    }


@pytest.mark.parametrize("case", ["2 Hz", "1 Hz, neither lag nor dead time"])
def test_what_is_offered_for_the_vessel_file_is_near_the_truth(case: str) -> None:
    found = scores(case, range(2))
    _, lag_s, delay_s, *_ = CASES[case]
    assert [len(found[name]) for name in ("rate", "lag_s", "delay_s")] == [2, 2 * bool(lag_s), 2 * bool(delay_s)]
    # of a standard normal number 4 in a hundred thousand are beyond 4
    assert max(abs(score) for own in found.values() for score in own) < 4.0


@pytest.mark.parametrize("case", ["1 Hz, neither lag nor dead time", "2 Hz"])
def test_orders_of_the_clock_that_reads_them_count_from_their_readings(case: str) -> None:
    """They were told to act half an interval later than they do, within a tenth of it."""
    found = scores(case, range(2), one_clock=True)
    _, lag_s, delay_s, *_ = CASES[case]
    assert [len(found[name]) for name in ("rate", "lag_s", "delay_s")] == [2, 2 * bool(lag_s), 2 * bool(delay_s)]
    assert max(abs(score) for own in found.values() for score in own) < 4.0


@pytest.mark.thorough
@pytest.mark.parametrize("one_clock", [False, True])
@pytest.mark.parametrize("case", COARSE)
def test_readings_far_apart_tell_neither_lag_nor_dead_time(case: str, one_clock: bool) -> None:
    found = rudder(case, 0, one_clock=one_clock)
    assert (found.lag_s, found.delay_s) == (None, None)
    assert found.rate is not None
    # a move lasts five readings at 2 s, one or two at 10 s
    assert found.rate[0] == pytest.approx((CASES | COARSE)[case][0], rel=0.5)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_standard_errors_hold_over_seeds(case: str) -> None:
    found = scores(case, range(100, 120))
    _, lag_s, delay_s, *_ = CASES[case]
    for name, there in (("rate", True), ("lag_s", lag_s > 0), ("delay_s", delay_s > 0)):
        if not there:
            assert len(found[name]) <= 1, name
            continue
        assert len(found[name]) >= 18, name  # of one told at three standard errors or more
        # of 20 standard normal numbers the mean square is 1 +- 0.32, and 19 +- 1 are within 2; a slew rate whose
        # readings are a fifth of a move apart errs by up to 1.6 times as much as is stated
        coarse = name == "rate" and case.startswith("1 Hz")
        assert 0.1 < np.mean(np.square(found[name])) < (2.6 if coarse else 2.0), name
        assert np.mean(np.abs(found[name]) < 2.0) >= (0.7 if coarse else 0.8), name
