"""What a test or a fit has decided is not fitted again."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.causes.candidate import Candidate
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit import fit, log_likelihood_gain
from expdesign.diagnosis.motion.simulation import initial_states
from expdesign.diagnosis.select.forward_selection import _could_gain_more
from expdesign.diagnosis.select.score_tests import ScoreTest, score_tests
from expdesign.diagnosis.select.selection_round import open_candidates
from expdesign.diagnosis.select.shortlist import _shortlist, starting_points
from expdesign.diagnosis.select.starting_point import of_one_fit, starting_point
from expdesign.diagnosis.select.tuning import TUNING
from expdesign.diagnosis.vessel_file.reading import extended_model


def fitted_barge(effects, free, seed=3):
    """A fit of effects to a record of a barge, and its windows."""
    record = hidden_record("barge", seed=seed, batches=4, samples=150, effects=effects)
    ship = extended_model(vessel_of("barge"), record)
    windows = cut_windows(ship.model, record)
    return fit(ship, windows, free, starts=initial_states(windows)), windows


@pytest.mark.parametrize("seed", range(3))
def test_no_cause_gains_more_in_place_of_another_than_beside_it(seed):
    """The bound by which exchanges are left out: a model with both explains what either does alone."""
    whole, windows = fitted_barge({"gain": -0.001}, ("theta:X_mu",), seed)
    keys = ("gain", "theta:X_u", "theta:X_vr", "heading_bias", "lever:forward", "term:X_kappa", "inertia:u")
    ship = whole.ship.without_effects({"theta:X_mu"})
    tests = score_tests(whole, [Candidate(cause=key, free={key: 0.0}) for key in keys])
    found = []
    for test in sorted(tests, key=lambda item: item.candidate.cause != "gain"):
        instead = fit(ship, windows, (test.candidate.cause,), starts=whole.starts)
        found.append((log_likelihood_gain(whole, instead), test.statistic))
    gains, bounds = np.transpose(found)
    assert (gains < bounds + 0.1 + 0.05 * bounds).all()
    assert gains[0] > 0.7 * bounds[0] > 7.0  # of the true cause, which comes near


def a_test(statistic, *, size=1, multiplicity=30.0):
    """A test of so many effects."""
    candidate = Candidate(cause="other", free={f"effect{number}": 0.0 for number in range(size)})
    return ScoreTest(
        candidate=candidate, statistic=statistic, p_value=0.5, step=np.zeros(size), multiplicity=multiplicity
    )


def test_exchanges_are_tried_where_a_test_leaves_room():
    """One of as many numbers needs what noise does not give; one of more pays for them; one of fewer may gain less."""
    one, three = (SimpleNamespace(keys=tuple(range(count))) for count in (1, 3))
    assert not _could_gain_more([a_test(6.0)], one)
    assert _could_gain_more([a_test(20.0)], one)
    assert _could_gain_more([a_test(6.0), a_test(20.0)], one)
    assert not _could_gain_more([a_test(20.0, size=3)], one)
    assert _could_gain_more([a_test(20.0 + 2 * TUNING.price, size=3)], one)
    assert _could_gain_more([a_test(0.0)], three)


@pytest.mark.parametrize("lag_s", [0.3, 6.0])
def test_first_guesses_of_the_same_effects_begin_one_fit(lag_s):
    """A lag has several first guesses, and a mode of roll; small effects begin where the test is largest."""
    base, windows = fitted_barge({"lag_s": lag_s, "acts_on": 7}, ())
    tests = score_tests(base, open_candidates(base, windows), np.random.default_rng(0))
    guesses = Counter(of_one_fit(starting_point(base, test)) for test in _shortlist(tests))
    points, far = starting_points(base, windows, tests, {})
    begun = Counter(of_one_fit(point) for point in points)
    assert far == (lag_s > 1.0)
    assert max(guesses.values()) > 1
    assert max(begun.values()) == 1
    lag = max((test for test in tests if set(test.candidate.free) == {"lag:all"}), key=lambda test: test.statistic)
    if not far:
        (point,) = (one for one in points if set(one.test.candidate.free) == {"lag:all"})
        assert point.test is lag
        assert set(begun) == set(guesses)
