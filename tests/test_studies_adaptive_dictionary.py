"""What is claimed for the grown dictionary: the same accuracy in at most 40 % of the time, also in simulated trials."""

import numpy as np
import pytest

from adaptive import Comparison, compare, comparison_table, growth_table, minutes_for_the_same
from adaptive_monte_carlo import sample_counts, simulate_trials
from expdesign.growing.search import GrowSettings


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    """A small version of the study."""
    settings = GrowSettings(
        rounds=3, pool=32, run_s=18.75, free_form=True, families=("zigzag", "turning_circle", "multisine")
    )
    return compare("small", settings, runs=200)


@pytest.mark.thorough
def test_the_grown_design_is_worth_two_and_a_half_times_the_first_by_the_nominal_model(comparison: Comparison):
    assert comparison.nominal > 2.5
    assert comparison.nominal == pytest.approx(comparison.growth.rounds[-1].efficiency, rel=1e-9)


def test_the_grown_design_is_worth_two_and_a_half_times_the_first_in_simulated_trials(comparison: Comparison):
    assert comparison.measured - 3 * comparison.measured_error > 2.5


def test_estimates_of_both_designs_are_centred_on_the_truth(comparison: Comparison):
    for trials in (comparison.base, comparison.grown):
        bias = np.abs(trials.estimates.mean(axis=0) - trials.truth)
        # The instruments' own nonlinear error is of second order in the noise: a fraction of a standard deviation.
        assert (bias < 0.25 * trials.std).all()


def test_the_tables_show_every_round_and_every_parameter(comparison: Comparison):
    names = [f"theta{index}" for index in range(len(comparison.base.truth))]
    table = comparison_table([comparison], names)
    assert all(name in table for name in names)
    assert len(growth_table(comparison.growth).splitlines()) == len(comparison.growth.rounds) + 2


def test_samples_are_shared_out_without_loss():
    rng = np.random.default_rng(0)
    for _ in range(20):
        fractions = rng.dirichlet(np.full(7, 0.3))
        counts = sample_counts(fractions, 1000)
        assert counts.sum() == 1000
        assert (np.abs(counts - 1000 * fractions) < 1).all()


def test_without_noise_the_estimates_are_the_truth(comparison: Comparison, monkeypatch: pytest.MonkeyPatch):
    from dataclasses import replace

    import adaptive
    import adaptive_monte_carlo
    from expdesign.scenario import load_vessel
    from expdesign.vessel import Sensors

    monkeypatch.setattr(adaptive_monte_carlo, "VARIANCE", 0.0)
    ship, information = adaptive.model_ship()
    truth = replace(load_vessel(adaptive.SCENARIOS / "vessels" / "model-ship-true.toml"), sensors=Sensors())
    primitives = [item.primitive for item in information]
    shares = np.full(len(primitives), 1 / len(primitives))
    found = simulate_trials(truth, ship, primitives, shares, runs=2, rng=np.random.default_rng(0))
    np.testing.assert_allclose(found.estimates, np.tile(found.truth, (2, 1)), rtol=1e-6)


@pytest.mark.slow
def test_one_set_of_standard_trials_takes_many_times_longer_than_designed_trials():
    rows, _ = minutes_for_the_same(GrowSettings(rounds=6, pool=32))
    whole, shared_out, dictionary, grown, free = (row.same for row in rows)
    assert shared_out < whole
    assert free < 1.05 * grown < grown * 2 < dictionary * 2 < 0.4 * whole
    assert all(row.no_worse < 0.4 * whole for row in rows[3:])
