"""Standard errors and p-values count how runs differ: the mean of runs that differ has the spread of their means."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, kstest, norm
from scipy.stats import t as student

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.causes.candidate import Candidate
from expdesign.diagnosis.data.noise import Noise
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit.between_runs import (
    counting_runs,
    directions_between_runs,
    tail,
)
from expdesign.diagnosis.fit.fit import Fit
from expdesign.diagnosis.fit.held_out import HeldOut
from expdesign.diagnosis.fit.linear_model import Sensitivities, gram_matrices, marginalised
from expdesign.diagnosis.motion.simulation import initial_states
from expdesign.diagnosis.select import backward_elimination
from expdesign.diagnosis.select.forward_selection import fit_nuisance
from expdesign.diagnosis.select.score_tests import score_tests
from expdesign.diagnosis.select.selection import Selection, Step, _equivalent
from expdesign.diagnosis.select.selection_round import _alternatives, open_candidates
from expdesign.diagnosis.select.shortlist import _shortlist
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.estimation.solve import Dispersion, Spread, few_runs_factor
from expdesign.signals import Record
from held_out_cases import errors
from hidden_effects import Weather

RUNS, SAMPLES, APART, NOISE = 14, 60, 0.3, 1.0


def mean_of_runs(rng: np.random.Generator, *, runs: int = RUNS, apart: float = APART) -> Fit:
    """The least-squares mean of one channel in runs that each have an offset of their own."""
    seen = apart * rng.standard_normal((runs, 1)) + NOISE * rng.standard_normal((runs, SAMPLES))
    error = np.full((runs, SAMPLES, 4), np.nan)
    error[..., 0] = seen - seen.mean()
    values = np.zeros((1, runs, SAMPLES, 4))
    values[0, ..., 0] = 1.0
    sensitivities = Sensitivities(
        values=values, starts=np.zeros((3, runs, SAMPLES, 4)), error=error, numbers=1, spacing_s=10.0
    )
    noise = Noise(filters=np.ones((4, 1)), std=np.array([NOISE, np.inf, np.inf, np.inf]))
    grams = gram_matrices(sensitivities, noise)
    m = marginalised(grams, sensitivities, noise)
    return Fit(
        ship=None, keys=("mean",), free_count=1, covariance=np.linalg.inv(m.A), starts=np.zeros((runs, 3)), noise=noise,
        cost=0.0, deviance=0.0, linear=None, sensitivities=sensitivities, grams=grams, precision=np.zeros((1, 1)),
        step=np.zeros(1), gain=0.0, converged=True,
    )  # type: ignore[arg-type]  # fmt: skip


def std_of(found: Fit) -> float:
    """Without what makes an interval of few runs wider."""
    return found.std("mean") / float(few_runs_factor(found.freedom))


def test_the_scatter_of_run_means_is_found_exactly():
    found = mean_of_runs(np.random.default_rng(0))
    means = found.sensitivities.error[..., 0].mean(axis=1)
    counted = counting_runs(found, np.arange(RUNS))
    assert std_of(counted) == pytest.approx(means.std(ddof=1) / np.sqrt(RUNS), rel=1e-9)
    assert counted.freedom == pytest.approx(RUNS - 1)
    factor = student.ppf(0.975, RUNS - 1) / norm.ppf(0.975)
    assert counted.std("mean") == pytest.approx(factor * std_of(counted), rel=1e-9)
    assert found.covariance[0, 0] == pytest.approx(NOISE**2 / (RUNS * SAMPLES), rel=1e-9)


@pytest.mark.parametrize("runs", [3, 6])
def test_two_standard_errors_hold_the_truth_in_95_of_100_however_few_runs_there_are(runs):
    """Runs that differ by much more than noise: Student's interval, exact for Gaussian runs."""
    rng, trials, held = np.random.default_rng(runs), 400, 0
    for _ in range(trials):
        found = mean_of_runs(rng, runs=runs, apart=3.0)  # its errors are relative to the estimate
        truth = rng.standard_normal() * np.sqrt((3.0**2 + NOISE**2 / SAMPLES) / runs)  # as far off as an estimate is
        held += abs(truth) < norm.ppf(0.975) * counting_runs(found, np.arange(runs)).std("mean")
    assert abs(held / trials - 0.95) < 4 * np.sqrt(0.95 * 0.05 / trials)


def test_no_standard_error_gets_smaller():
    rng = np.random.default_rng(3)
    for _ in range(20):
        found = mean_of_runs(rng, apart=0.0)
        assert counting_runs(found, np.arange(RUNS)).std("mean") >= found.std("mean")


def drawn_runs(rng: np.random.Generator, apart: float, *, runs: int, many: int, share: float = 1.0) -> tuple:
    """Scores and information of many directions in runs, the first of which tells `share` times as much as another.

    Two effects are estimated, which imitate some of each direction; estimates differ by `apart` standard errors.
    """
    rows = 20
    X = rng.standard_normal((runs, rows, 2 + many))
    X[0] *= np.sqrt(share)
    size = np.sqrt((X**2).sum(axis=1)).mean(axis=0)
    y = rng.standard_normal((many, runs, rows))
    y += np.einsum("grk,gk->kgr", X[..., 2:], apart * rng.standard_normal((runs, many)) / size[2:])
    A, s = np.einsum("gri,grj->gij", X, X), np.einsum("gri,kgr->kgi", X, y)
    whole = A.sum(axis=0)[:2, :2]
    spreads = []
    for k in range(many):
        effects = np.linalg.solve(whole, s[k, :, :2].sum(axis=0))  # every direction has data of its own
        left = s[k] - A[:, :, :2] @ effects
        own = (A[:, :2, :2], A[:, :2, 2 + k : 3 + k], A[:, 2 + k : 3 + k, 2 + k])
        spreads.append(directions_between_runs(own, (left[:, :2], left[:, 2 + k : 3 + k]), np.zeros((2, 2))))
    names = ("ratio", "freedom", "uneven")
    return Spread(**{name: np.concatenate([getattr(item, name) for item in spreads]) for name in names})


@pytest.mark.parametrize("runs", [2, 3, 8])
def test_the_spread_of_equal_runs_is_one_on_average_whatever_is_estimated_beside(runs):
    """By the standard error of the mean: the degrees of freedom count what estimated effects and the mean take away."""
    spread = drawn_runs(np.random.default_rng(runs), 0.0, runs=runs, many=600)
    total = spread.ratio * spread.freedom
    assert abs(total.mean() - spread.freedom.mean()) < 4 * total.std() / np.sqrt(len(total))
    assert (spread.freedom < runs - 1).all()


def test_what_directions_have_in_common_is_found():
    """Ratios of inverse chi-squared variances: their size and its degrees of freedom, and none where all are alike."""
    rng, own, many = np.random.default_rng(1), 3.0, 4000
    alike = chi2.rvs(own, size=many, random_state=rng) / own
    for scale, freedom in ((1.0, math.inf), (30.0, 4.0), (5.0, 12.0)):
        each = 1.0 if math.isinf(freedom) else freedom / chi2.rvs(freedom, size=many, random_state=rng)
        found = Dispersion.of(Spread(ratio=scale * each * alike, freedom=np.full(many, own), uneven=np.ones(many)))
        assert found.ratio == pytest.approx(scale, rel=0.1)
        assert found.freedom > 50 if math.isinf(freedom) else found.freedom == pytest.approx(freedom, rel=0.25)


@pytest.mark.parametrize(("apart", "share"), [(0.0, 1.0), (3.0, 1.0), (0.0, 30.0)])
def test_p_values_of_few_runs_are_uniform_whether_or_not_runs_differ(apart, share):
    """Of three runs; where they do not differ, p-values may be a little larger: no variance is counted as less."""
    rng, many = np.random.default_rng(5), 800
    spread = drawn_runs(rng, apart, runs=3, many=many, share=share)
    factors, freedoms = Dispersion.of(spread).beside(spread)
    z = np.sqrt(1.0 + apart**2) * rng.standard_normal(many)
    p_values = np.array([tail(one**2, 1, *pair) for one, *pair in zip(z, factors, freedoms, strict=True)])
    assert kstest(p_values, "uniform", alternative="greater").pvalue > 0.01
    if apart:
        assert kstest(p_values, "uniform").statistic < 0.08
        plain = np.array([tail(one**2, 1) for one in z])
        assert (plain < 0.001).mean() > 20 * (p_values < 0.001).mean()


def test_one_run_that_tells_all_is_as_uncertain_as_a_single_run():
    """A change that one of four runs shows has the whole variance between runs, not a fourth of it."""
    even = np.array([[1.0], [1.0], [1.0], [1.0]])
    single = np.array([[1e4], [1.0], [1.0], [1.0]])
    for information, uneven in ((even, 1.0), (single, 3.0)):
        A = (np.zeros((4, 0, 0)), np.zeros((4, 0, 1)), information)
        found = directions_between_runs(A, (np.zeros((4, 0)), np.zeros((4, 1))), np.zeros((0, 0)))
        assert found.uneven[0] == pytest.approx(uneven)


def test_runs_that_differ_by_themselves_are_no_evidence_of_a_cause_on_average():
    """Thrust of every run is off by some share of its own: where runs happen to agree, a common one is no certainty."""
    candidate, plain, counted = Candidate(cause="thrust_gain", free={"gain": 0.0}), [], []
    for seed in range(5):
        rng = np.random.default_rng([7, seed])
        runs = [
            hidden_record("barge", seed=10 * seed + run, batches=1, samples=100, effects={"gain": off}).batches[0]
            for run, off in enumerate((0.3 * rng.standard_normal(5)).tolist())
        ]
        record = Record(batches=tuple(replace(one, name=f"run {number}") for number, one in enumerate(runs)))
        ship = extended_model(vessel_of("barge"), record)
        windows = cut_windows(ship.model, record)
        base = fit_nuisance(ship, windows, initial_states(windows))
        tests = score_tests(base, open_candidates(base, windows))
        (own,) = [item for item in tests if item.candidate.free == candidate.free]
        plain.append(tail(own.statistic, 1))
        counted.append(own.p_value)
    assert min(plain) < 1e-6
    assert min(counted) > 0.05 / len(counted) / 10
    assert np.median(counted) > np.median(plain)


@pytest.mark.thorough
def test_a_missing_term_that_noise_cannot_imitate_is_fitted_however_much_runs_differ_without_it():
    """Y_ur is missing: without it, its own effect in turns of all kinds is most of how three runs differ."""
    counted = []
    for seed in (0, 4, 5):
        calm = Weather(current_std=0.0, wind_std=0.0)
        record = hidden_record("tug", seed=seed, batches=3, samples=200, weather=calm)
        ship = extended_model(vessel_of("tug", without=("Y_ur",), relative_std=0.1), record)
        windows = cut_windows(ship.model, record)
        base = fit_nuisance(ship, windows, initial_states(windows))
        tests = score_tests(base, open_candidates(base, windows), np.random.default_rng(seed))
        (own,) = [item for item in tests if "term:Y_ur" in item.candidate.free]
        assert tail(own.statistic, 1) < 1e-7
        assert own in _shortlist(tests)
        counted.append(own.p_value)
    assert np.median(counted) > 0.01


def test_candidates_are_equivalent_by_a_margin_that_grows_with_the_spread_between_runs():
    """An offset of angles and a moment of thrust are two answers of one cause; further behind, they are told apart."""
    ahead = SimpleNamespace(
        candidate=Candidate(cause="thruster_asymmetry", free={"offset:rudder": 0.0}), penalised_gain=100.0,
        likelihood_gain=105.0,
    )  # fmt: skip

    def other(cause: str, key: str, gain: float) -> SimpleNamespace:
        return SimpleNamespace(
            candidate=Candidate(cause=cause, free={key: 0.0}), penalised_gain=gain, fit=SimpleNamespace(ship=key)
        )

    fitted = [
        ahead, other("thruster_asymmetry", "offset:all", 99.0), other("thruster_asymmetry", "asymmetry", 97.0),
        other("parameters", "theta:N_0", 80.0), other("current", "current:north", 20.0),
    ]  # fmt: skip
    rivals = _alternatives(ahead, fitted)  # type: ignore[arg-type]
    for ratio, named in ((1.0, ["asymmetry"]), (5.0, ["asymmetry", "theta:N_0"])):
        assert [item.ship for item in _equivalent(rivals, Dispersion(ratio=ratio, freedom=10.0))] == named


@pytest.mark.parametrize(
    ("runs", "cause", "share", "told"),
    [(2, "delay", 0.5, True), (3, "delay", 0.5, False), (1, "delay", 0.5, False), (2, "delay", 0.04, False),
     (2, "change_point", 0.5, False)],
)  # fmt: skip
def test_held_out_parts_tell_of_two_runs_what_one_degree_of_freedom_cannot(monkeypatch, runs, cause, share, told):
    """Of causes that may show in predictions, by enough to be a finding; among as many tests as before."""
    chosen = SimpleNamespace(
        candidate=Candidate(cause=cause, free={}), is_block=False, multiplicity=10.0, fit=SimpleNamespace(noise=None)
    )
    step = Step(chosen=chosen, p_value=0.11, alternatives=(), before=None, tests=())  # type: ignore[arg-type]
    found = Selection(steps=(step,), first=None, last=None, last_tests=())  # type: ignore[arg-type]
    monkeypatch.setattr(backward_elimination, "prediction_gain", lambda *_: (share, (0.1, 0.9)))
    windows, whole, apart = SimpleNamespace(batch=np.repeat(np.arange(float(runs)), 4)), errors(60.0), errors(50.0)

    def p_value(before: HeldOut, after: HeldOut, *_: object) -> float:
        return 1e-4 if (before, after) == (apart, whole) else 1.0

    monkeypatch.setattr(backward_elimination, "prediction_p_value", p_value)
    (after,) = backward_elimination.two_runs_by_predictions(found, [apart, whole], lambda _: apart, windows).steps  # type: ignore[arg-type]
    assert after.p_value == pytest.approx(1e-3 if told else 0.11, rel=0.01)


def a_step(cause: str, p_value: float) -> Step:
    chosen = SimpleNamespace(candidate=Candidate(cause=cause, free={cause: 0.0}), fit=cause, is_block=cause == "block")
    return Step(chosen=chosen, p_value=p_value, alternatives=(), before=None, tests=())  # type: ignore[arg-type]


def causes_left(monkeypatch, steps: tuple[Step, ...], runs: int, improves, held) -> list[str]:
    """Causes after the elimination of those found in so many runs, by stubs of what improves and of errors."""
    for name, instead in {
        "improves_held_out": improves,
        "open_candidates": lambda *_: [],
        "as_told": lambda selection, *_: selection,
        "without_step": lambda given, index, _windows: [*given[:index], *given[index + 1 :]],
    }.items():
        monkeypatch.setattr(backward_elimination, name, instead)
    found = Selection(steps=steps, first=None, last=None, last_tests=())  # type: ignore[arg-type]
    windows = SimpleNamespace(batch=np.arange(float(runs)))
    kept, _ = backward_elimination.eliminate_backward(found, windows, lambda one: (one, held(one)), 0)  # type: ignore[arg-type]
    return [one.chosen.candidate.cause for one in kept.steps]


def test_what_gains_nothing_beside_a_cause_of_which_nothing_is_left_is_asked_again(monkeypatch):
    """A change of the ship takes the gain of a rudder's scale, and how runs differ leaves nothing of the change."""

    def improves(found: Selection, *_: object) -> list[bool]:
        return [index == 0 for index, _ in enumerate(found.steps)]

    steps = a_step("change_point", 1.0), a_step("actuator_scale", 1e-9), a_step("lever_arm", 0.5)
    assert causes_left(monkeypatch, steps, 3, improves, lambda _: []) == ["actuator_scale"]


def all_improve(found: Selection, *_: object) -> list[bool]:
    return [True] * len(found.steps)


def is_in(found: Selection, cause: str) -> bool:
    return any(one.chosen.candidate.cause == cause for one in found.steps)


@pytest.mark.parametrize(
    ("runs", "cause", "without", "left"),
    [
        (2, "current", 40.0, ["current", "delay"]),  # 40 points are lost without it
        (2, "current", 79.9, ["delay"]),  # too little for a word
        (2, "current", 40.0 + 40.0 * np.array([[-2.0], [0.0], [1.2]] * 2), ["delay"]),  # much, but not for certain
        (3, "current", 40.0, ["delay"]),  # more degrees of freedom
        (2, "change_point", 40.0, ["delay"]),
        (2, "block", 40.0, ["delay"]),
    ],
)  # fmt: skip
def test_of_two_runs_a_cause_stays_that_simulations_need_beside_the_others(monkeypatch, runs, cause, without, left):
    """The least significant one; the next is not needed and goes instead."""

    def held(found: Selection) -> list[HeldOut]:
        return [errors(0.0), *[errors(80.0 if is_in(found, cause) else without)] * len(found.steps)]

    steps = a_step(cause, 0.11), a_step("lever_arm", 0.07), a_step("delay", 1e-9)
    assert causes_left(monkeypatch, steps, runs, all_improve, held) == left


@pytest.mark.parametrize("with_it", [False, True])
def test_errors_with_and_without_a_cause_are_measured_alike(monkeypatch, with_it):
    """Those of one are of whole runs, which tell the opposite, those of the other of stretches."""

    def held(found: Selection) -> list[HeldOut]:
        there = is_in(found, "current")
        ahead = errors(80.0 if there else 40.0)
        if there == with_it:
            ahead = replace(ahead, in_stretches=True)
        else:
            ahead = replace(errors(10.0 if there else 95.0), ahead=lambda one=ahead: one)
        return [errors(0.0), *[ahead] * len(found.steps)]

    steps = a_step("current", 0.11), a_step("delay", 1e-9)
    assert causes_left(monkeypatch, steps, 2, all_improve, held) == ["current", "delay"]


def test_of_two_runs_the_only_cause_has_to_be_significant(monkeypatch):
    steps = (a_step("current", 0.11),)
    held = [errors(0.0), errors(80.0)]
    assert causes_left(monkeypatch, steps, 2, all_improve, lambda found: held[: 1 + len(found.steps)]) == []
