"""The told share of the work goes from 0 to 1 and never back, in steps so small that it can follow the time.

Where the told share h stays while that share of the time goes by, it is behind by up to h: h^3 / 12 of squared error,
of the 1 / 12 that is the variance of time itself. So the correlation of told and gone shares is above 0.98 only if the
cubes of all steps add up to less than 1 - 0.98^2, however well they are placed.
"""

import numpy as np
import pytest

from expdesign.progress import Estimated, in_phases, never_falling
from short_examples import SHORTER, example_told

LARGEST = 1.0 - 0.98**2


@pytest.mark.parametrize("name", SHORTER)
def test_the_share_begins_at_0_never_falls_and_ends_at_1(made_once, name):
    shares = [share for _, share in example_told(made_once, name)]
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert shares == sorted(shares)


@pytest.mark.parametrize("name", SHORTER)
def test_steps_are_small_enough_to_follow_the_time(made_once, name):
    shares = np.array([share for _, share in example_told(made_once, name)])
    assert (np.diff(shares) ** 3).sum() < LARGEST


def test_a_share_that_is_not_known_stays_so_and_harms_no_other():
    told = []
    first, last = in_phases(never_falling(lambda activity, share: told.append(share)), 1.0, 1.0)
    for phase, share in ((first, 0.5), (first, np.nan), (first, 0.2), (last, 0.5)):
        phase("at work", share)
    np.testing.assert_array_equal(told, [0.25, np.nan, 0.25, 0.75])


def test_a_stair_that_follows_the_time_on_average_has_the_correlation_of_its_steps():
    time = (np.arange(60000) + 0.5) / 60000
    for steps in (2, 5, 10):
        middles = (np.floor(time * steps) + 0.5) / steps
        assert np.corrcoef(middles, time)[0, 1] ** 2 == pytest.approx(1.0 - steps * (1.0 / steps) ** 3, abs=1e-6)


def test_phases_take_their_ratios_of_the_whole_and_repeated_work_tells_nothing_less():
    told = []
    first, none, last = in_phases(never_falling(lambda activity, share: told.append(share)), 1.0, 0.0, 3.0)
    for phase, share in ((first, 0.0), (first, 1.0), (none, 0.5), (last, 0.5), (first, 0.5), (last, 1.0)):
        phase("at work", share)
    assert told == pytest.approx([0.0, 0.25, 0.25, 0.625, 0.625, 1.0])


def test_of_work_that_becomes_known_as_it_goes_the_share_done_of_what_is_expected_is_told_and_never_less():
    told = []
    work = Estimated(lambda activity, share: told.append(share), after=10.0)
    work.tell("at work", 30.0)
    work.done += 10.0
    work.tell("at work", 20.0)
    work.tell("at work", 180.0)  # more than was expected
    part = work.part(20.0, 0.0)
    part("at work", 0.5)
    part("at work", 1.0)
    work.after = 0.0
    work.tell("done", 0.0)
    assert told == pytest.approx([0.0, 0.25, 0.25, 0.5, 0.75, 1.0])
