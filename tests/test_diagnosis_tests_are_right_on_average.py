"""Identities of the diagnosis: priors, noise, adjusted p-values, comparisons of fits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest

import hidden_effects as sea
from clean_trials import SHIP_50M, at_rate, clean_trial, p_values
from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.causes.candidate import Candidate
from expdesign.diagnosis.data.noise import WHITE_SHARE, Noise, fit_ar_noise, linear_basis, whitened
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit.fit import (
    FitOptions,
    best_step,
    continuing,
    likeliest,
    log_likelihood_gain,
    prior_precision,
    within_stated_std,
)
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.motion.simulation import initial_states, stable_windows
from expdesign.diagnosis.select.fitted_candidate import fit_candidate
from expdesign.diagnosis.select.forward_selection import fit_nuisance
from expdesign.diagnosis.select.score_tests import ScoreTest, _effective_tests, score_tests
from expdesign.diagnosis.select.selection import Step, redundant_step
from expdesign.diagnosis.select.selection_round import open_candidates
from expdesign.diagnosis.select.starting_point import starting_point
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.scenario import load_vessel
from expdesign.workflows.steps.measured import measured
from sample_files import outside


@pytest.fixture(scope="module")
def clean_scores():
    """p-value and share of half a second, for dead time and lag, in clean trials."""
    found = {"delay:all": [], "lag:all": []}
    candidates = [Candidate(cause="actuator_lag", free={key: 0.5}, finite=True) for key in found]
    for seed in range(14):
        record = hidden_record("barge", seed=seed, batches=3, samples=150)
        ship = extended_model(vessel_of("barge"), record)
        windows = cut_windows(ship.model, record)
        base = fit_nuisance(ship, windows, initial_states(windows))
        for test in score_tests(base, candidates):
            (key,) = test.candidate.free
            found[key].append((test.p_value, float(test.step[0])))
    return found


def test_what_is_known_where_a_fit_begins_changes_no_result():
    """With other effects, and over some of the windows; beside a sensor that is found to be wrong."""
    record = hidden_record("barge", seed=5, batches=3, samples=120, effects={"gain": -0.2})
    ship = extended_model(vessel_of("barge"), record)
    windows = cut_windows(ship.model, record)
    base = fit_nuisance(ship.with_effects({"gyro": 0.02}), windows, initial_states(windows))
    keep = np.array([True, False, True])
    for begun, part, keys in (
        (base, windows, ("gain",)),
        (base, windows, ("lag:all", "gain")),
        (base.selected(keep), windows.selected(keep), ("gain", "current:north")),
    ):
        options = FitOptions(noise=base.noise, ar_order=base.noise.order)
        known, anew = (
            fit(base.ship.with_effects(dict.fromkeys(keys, 0.0)), part, keys, starts=begun.starts, options=one)
            for one in (replace(options, warm_start=begun), options)
        )
        for key in keys:
            assert known.value(key) == pytest.approx(anew.value(key), rel=1e-5, abs=1e-7), keys
        assert known.deviance == pytest.approx(anew.deviance, rel=1e-7)


def test_causes_have_equal_shares_of_false_alarms():
    """One candidate against twenty, all independent: closed forms; quantiles of 2000 draws have 10 % standard error."""
    roots = [(np.array([index]), np.ones((1, 1))) for index in range(21)]
    candidates = [Candidate(cause=name, free={"gain": 0.0}) for name in ("one", *["many"] * 20)]
    factors = _effective_tests(np.eye(21), roots, candidates, np.random.default_rng(0))
    every = 0.05 / (1 - 0.95**0.5)
    assert np.allclose(factors[0], every, rtol=0.4)
    assert np.allclose(factors[1:], every * 0.05 / (1 - 0.95**0.05), rtol=0.4)


@pytest.mark.thorough
def test_times_that_cannot_be_negative_have_uniform_one_sided_p_values(clean_scores):
    """In clean data half of the estimates are negative, which is no sign of a dead time or a lag."""
    for rows in clean_scores.values():
        one_sided = [p / 2 if step > 0 else 1.0 - p / 2 for p, step in rows]
        assert kstest(one_sided, "uniform").pvalue > 0.01
    record = hidden_record("barge", seed=1, batches=3, samples=150)
    ship = extended_model(vessel_of("barge"), record)
    windows = cut_windows(ship.model, record)
    base = fit_nuisance(ship, windows, initial_states(windows))
    for seconds in (0.5, 2.0):
        two, one = (
            score_tests(
                base, [Candidate(cause="actuator_lag", free={"lag:all": seconds}, finite=True, positive=positive)]
            )[0]
            for positive in (False, True)
        )
        np.testing.assert_allclose(one.step, two.step)
        positive = two.step[0] > 0
        assert one.statistic == pytest.approx(two.statistic if positive else 0.0)
        assert one.p_value == pytest.approx(two.p_value / 2 if positive else 1.0 - two.p_value / 2)


def test_a_step_ends_at_its_bound_and_the_rest_follows():
    """Two correlated effects, the first of which may not fall: the other takes its own optimum there."""
    A, score = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-3.0, 1.0])
    free, gain = best_step(A, score, np.array([[-np.inf, -np.inf], [np.inf, np.inf]]))
    np.testing.assert_allclose(free, np.linalg.solve(A, score))
    assert gain == pytest.approx(score @ free)
    held, less = best_step(A, score, np.array([[-0.5, -np.inf], [np.inf, np.inf]]))
    np.testing.assert_allclose(held, [-0.5, 0.75])
    assert less == pytest.approx(2 * score @ held - held @ A @ held)
    assert less < gain


def test_fits_are_compared_under_one_noise_whichever_is_asked_first():
    """The likelier of two noises: the one with the better model, and a gain is a loss the other way round."""
    record = hidden_record("barge", seed=5, batches=2, samples=120, effects={"gain": -0.2})
    ship = extended_model(vessel_of("barge"), record)
    windows = cut_windows(ship.model, record)
    base = fit_nuisance(ship, windows, initial_states(windows))
    found = fit(ship, windows, ("gain",), starts=base.starts, options=continuing(base))
    assert likeliest((base, found)) is likeliest((found, base)) is found
    gain = log_likelihood_gain(base, found)
    assert gain > 100.0
    assert gain == pytest.approx(-log_likelihood_gain(found, base))


def test_parameters_far_beyond_their_standard_deviations_are_told_from_those_within():
    """Stated to 2 %, N_r is within it where the file is right, and beyond it where the ship's is half as large more."""
    for factor in (1.0, 1.5):
        record = hidden_record("barge", seed=5, batches=2, samples=150, factors={"N_r": factor})
        ship = extended_model(vessel_of("barge", relative_std=0.02), record)
        windows = cut_windows(ship.model, record)
        found = fit_nuisance(ship, windows, initial_states(windows))
        assert within_stated_std(found) == (factor == 1.0)


def test_the_prior_of_parameters_is_their_covariance():
    """Of effects without a prior it has nothing, and of the others what is left when these are unknown."""
    rng = np.random.default_rng(3)
    vessel = vessel_of("barge", relative_std=0.1)
    root = rng.standard_normal((len(vessel.model.names), 20))
    covariance = root @ root.T * np.outer(vessel.model.parameter_std, vessel.model.parameter_std)
    vessel = replace(vessel, model=vessel.model.with_covariance(vessel.model.names, covariance))
    record = hidden_record("barge", seed=5, batches=1, samples=60)
    keys = tuple(f"theta:{name}" for name in vessel.model.names)
    ship = extended_model(vessel, record)
    whole = prior_precision(ship, (*keys, "current:north"))
    assert np.allclose(whole[:-1, :-1] @ covariance, np.eye(len(keys)), atol=1e-6)
    assert not whole[-1].any()
    rest = prior_precision(ship, keys, free=2)
    assert np.allclose(rest[2:, 2:] @ covariance[2:, 2:], np.eye(len(keys) - 2), atol=1e-6)
    assert not rest[:2].any()
    drawn = vessel.model.drawn_parameters(20000, rng) - vessel.model.parameters
    scale = np.sqrt(np.diag(covariance))
    assert (
        np.abs(drawn.T @ drawn / len(drawn) / np.outer(scale, scale) - covariance / np.outer(scale, scale)).max() < 0.05
    )


def test_a_factor_that_standard_deviations_allow_may_contradict_the_covariance():
    """Thrust is 20 % weaker in every direction. Parameters are known to 10 %, their common factor to a tenth."""
    record = hidden_record("barge", seed=5, batches=2, samples=150, effects={"gain": -0.2})
    alone = vessel_of("barge", relative_std=0.1)
    reads_force = [bool({"tau_x", "tau_y", "tau_psi"} & set(item.signals)) for item in alone.model.expressions]
    thrust = np.sign(alone.model.parameters) * reads_force
    common = np.outer(thrust, thrust) / (thrust @ thrust)
    root = np.diag(alone.model.parameter_std) @ (np.eye(len(thrust)) - 0.9 * common)
    known = replace(alone, model=alone.model.with_covariance(alone.model.names, root @ root.T))
    for vessel, within in ((alone, True), (known, False)):
        ship = extended_model(vessel, record)
        windows = cut_windows(ship.model, record)
        assert within_stated_std(fit_nuisance(ship, windows, initial_states(windows))) == within


def test_an_autoregression_with_its_white_share_is_whitened():
    """The filter fitted to a series makes it and its white share white and of unit variance, within sampling error."""
    rng = np.random.default_rng(0)
    white = rng.standard_normal((4, 4000, 4))
    series = np.zeros_like(white)
    for k in range(1, 4000):
        series[:, k] = 0.8 * series[:, k - 1] + white[:, k]
    noise = fit_ar_noise(series)
    white_part = np.sqrt(WHITE_SHARE * (series**2).mean()) * rng.standard_normal(series.shape)
    rest = whitened(series + white_part, noise)
    assert np.allclose(rest.std(axis=(0, 1)), 1.0, atol=4 / np.sqrt(2 * 16000))
    for lag in (1, 2, 3, 5, 10):
        assert np.allclose((rest[:, lag:] * rest[:, :-lag]).mean(axis=(0, 1)), 0.0, atol=4 / np.sqrt(16000))


def test_linear_basis_functions_sum_to_one():
    assert np.allclose(linear_basis(100, 1.0, 10.0).sum(axis=0), 1.0)


def test_whitening_of_white_noise_only_scales():
    values = np.arange(24.0).reshape(1, 6, 4)
    noise = Noise(filters=np.ones((4, 1)), std=np.array([1.0, 2.0, 4.0, 8.0]))
    assert np.array_equal(whitened(values, noise), values / noise.std)


def test_a_missing_sample_costs_only_the_samples_whose_filter_reads_it():
    values = np.ones((1, 30, 4))
    values[0, 0, 3] = values[0, 10, 0] = np.nan
    noise = Noise(filters=np.tile([1.0, -0.5, 0.1], (4, 1)), std=np.ones(4))
    seen = np.isfinite(whitened(values, noise))[0]
    assert seen.sum(axis=0).tolist() == [25, 28, 28, 27]
    assert not seen[8:11, 0].any()
    assert not seen[0, 3]


TRIALS = 14
CLEAN = (("theta:X_uu",), ("theta:N_ur",), ("theta:Y_ur",), ("gain",), ("inertia:r",), ("heading_bias",), ("late:psi",))


@pytest.mark.thorough
@pytest.mark.parametrize("sample_time_s", [1.0, 0.2])
def test_p_values_of_clean_trials_are_uniform(sample_time_s):
    """A ship that accelerates from rest, orders that change at once, headings whose differences have their own noise.

    Each of seven tests by Kolmogorov and Smirnov at 0.1 %: seven times two wrong alarms in 1000 drawings of seeds.
    """
    ship, by = at_rate(SHIP_50M, sample_time_s), {key: [] for key in CLEAN}
    for seed in range(TRIALS):
        found, _ = p_values(ship, clean_trial(ship, np.random.default_rng([5, seed]), runs=3, run_s=150.0))
        for (_, *free), value in found.items():
            key = tuple(name for name, _ in free)
            if key in by:
                by[key].append(value)
    for key, values in by.items():
        assert len(values) == TRIALS, key
        assert kstest(values, "uniform").pvalue > 1e-3, key


@pytest.mark.parametrize("key", ["delay:all", "lag:all"])
def test_p_values_of_times_that_are_zero_are_uniform(clean_scores, key):
    """The Kolmogorov-Smirnov test of clean trials, and a mean estimate of zero within its own standard error."""
    p_values, shares = np.array(clean_scores[key]).T
    assert kstest(p_values, "uniform").pvalue > 1e-3
    assert abs(shares.mean()) < 4 * shares.std() / np.sqrt(len(shares))


def test_an_effect_that_is_not_there_is_estimated_as_zero_within_its_standard_error():
    """Over four trials the squared ratios are chi-squared, at least no larger; the threshold is its 99.9 % point."""
    ratios = []
    for seed in range(4):
        record = hidden_record("barge", seed=500 + seed, batches=3, samples=120)
        extended = extended_model(vessel_of("barge"), record)
        windows = cut_windows(extended.model, record)
        found = fit(extended, windows, ("gain", "heading_bias"), starts=initial_states(windows))
        ratios += [found.value(key) / found.std(key) for key in ("gain", "heading_bias")]
    assert np.sum(np.square(ratios)) < chi2.isf(1e-3, len(ratios))


def test_an_imitation_is_redundant_beside_the_true_cause_and_not_the_reverse():
    """A misaligned sensor that a drift term imitates: only the imitation is redundant, whichever is added first."""
    record = hidden_record("barge", seed=41, batches=3, samples=150, faults={"heading_bias": 0.04})
    extended = extended_model(vessel_of("barge"), record)
    windows = cut_windows(extended.model, record)
    true = Candidate(cause="heading_bias", free={"heading_bias": 0.0})
    imitation = Candidate(cause="parameters", free={"theta:Y_ur": 0.0})
    for order, redundant in (((imitation, true), 0), ((true, imitation), None)):
        before = fit(extended, windows, (), starts=initial_states(windows))
        steps = []
        for candidate in order:
            scored = ScoreTest(candidate=candidate, statistic=0.0, p_value=1.0, step=np.zeros(1), multiplicity=20.0)
            chosen = fit_candidate(before, windows, starting_point(before, scored))
            assert chosen is not None
            steps.append(Step(chosen=chosen, p_value=0.0, alternatives=(), before=before, tests=()))
            before = chosen.fit
        assert redundant_step(steps, windows) == redundant


def test_uncertain_parameters_are_fitted_before_anything_is_tested():
    """The remainder of a ship 20 % off everywhere is that of one whose parameters are known, within 5 %.

    Standard deviations of white remainders over 720 samples have a relative standard error of 2.6 %, and parameters
    take 11 of 720 degrees of freedom; three channels move together with the noise, which is the same in both.
    """
    record = hidden_record("coaster", seed=8, batches=3, samples=240, relative_std=0.2)
    rng = np.random.default_rng(8)
    drawn = {name: value * (1 + 0.2 * rng.standard_normal()) for name, value in sea.SHIPS["coaster"].items()}
    vessel = vessel_of("coaster", relative_std=0.2)
    windows = cut_windows(vessel.model, record)
    known = extended_model(vessel_of("coaster"), record)
    wrong = {f"theta:{name}": drawn[name] - sea.SHIPS["coaster"][name] for name in known.model.names}
    truth = fit_nuisance(known.with_effects(wrong), windows, initial_states(windows))
    found = fit_nuisance(extended_model(vessel, record), windows, initial_states(windows))
    assert np.abs(found.noise.std / truth.noise.std - 1).max() < 0.05


def test_uncertain_parameters_beyond_their_bounds_are_still_tested_as_causes():
    """A ship's own advance loss far beyond its bounds: the nuisance fit moves it, and it is still a candidate."""
    record = hidden_record("tug", seed=9, batches=3, samples=150, effects={"kappa": -0.0025})
    extended = extended_model(vessel_of("tug", relative_std=0.1), record)
    windows = cut_windows(extended.model, record)
    base = fit_nuisance(extended, windows, initial_states(windows))
    own = [item for item in open_candidates(base, windows) if item.cause == "thrust_advance_loss"]
    assert [tuple(item.free) for item in own] == [("theta:X_kappa",)]
    assert base.ship.get("theta:X_kappa") < -2 * 0.00025  # beyond two of its standard deviations
    (found,) = score_tests(base, own)
    assert found.p_value < 1e-6


@pytest.mark.outside
def test_noise_begun_anew_at_the_likeliest_parameters_is_no_likelier():
    """On measured records: noise from the way to the parameters holds what these explain since."""
    ship = load_vessel(outside("field/crash/vessel.toml"))
    record = measured([outside(f"field/crash/zz_20_10_{side}.csv") for side in "ps"], ship)
    model = extended_model(ship, record)
    windows = stable_windows(model, record)
    base = fit_nuisance(model, windows, initial_states(windows))
    anew = fit(base.ship, windows, (), starts=base.starts, options=FitOptions(steps=1))
    assert base.deviance < anew.deviance + 10.0
