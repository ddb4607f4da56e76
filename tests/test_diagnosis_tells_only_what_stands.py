"""What is told of a search: nothing that may harm on unseen runs, nothing that its own estimate calls nothing."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.causes.candidate import Candidate, Situation
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.diagnose import _stuck_note
from expdesign.diagnosis.extension import as_extended
from expdesign.diagnosis.fit.cross_validation import HeldOut, _fitted, gained
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.fit.score_tests import LEVEL, Scored, screen
from expdesign.diagnosis.model.accuracy import first_states
from expdesign.diagnosis.notes import notes_on_dropped
from expdesign.diagnosis.select.contenders import contend, opening
from expdesign.diagnosis.select.forward_search import _openings, search, settled
from expdesign.diagnosis.select.pruning import MOST_HARM, mending, worthwhile
from expdesign.diagnosis.select.search_state import Search, Step, like_nothing, wald, without

SPREAD = np.ones((6, 3))


def errors(fit_percent: np.ndarray | float) -> HeldOut:
    """Of six runs with these fits (b, 1) or one fit, all outputs alike."""
    return HeldOut(lost=SPREAD * (1.0 - np.asarray(fit_percent) / 100.0) ** 2, spread=SPREAD)


def steps_of(*keys: str) -> Search:
    """A search that found one cause for every key."""
    steps = [
        SimpleNamespace(
            chosen=SimpleNamespace(keys=(key,), fit=key, candidate=Candidate(cause="current", free={key: 0.0})),
            screening=(key,), p_value=1e-4,
        )
        for key in keys
    ]  # fmt: skip
    return Search(steps=tuple(steps), first=SimpleNamespace(keys=()), last=None, final_screening=())  # type: ignore[arg-type]


def kept_count(*fits: np.ndarray | float) -> int:
    """How many of the causes are kept whose models have these fits on unseen runs, the model in use first."""
    found = steps_of(*(f"effect {number}" for number in range(len(fits) - 1)))
    return len(worthwhile(found, mending(found, [errors(value) for value in fits], 0)).steps)


def test_a_first_cause_that_may_cost_half_a_point_is_not_told():
    """Fits of all runs alike have intervals of no width; runs that differ have one that reaches further down."""
    assert kept_count(50.0, 50.0 - 0.9 * MOST_HARM) == 0  # certain to cost something
    assert kept_count(50.0, 50.0) == 1  # its test alone sees it
    runs = np.array([[-1.0], [-1.0], [-1.0], [1.0], [1.0], [1.0]])
    assert kept_count(50.0, 50.0 + 0.2 * MOST_HARM * runs) == 1  # may cost, but never half a point
    assert kept_count(50.0, 50.0 - 0.1 * MOST_HARM + 4.0 * MOST_HARM * runs) == 0  # no better on average
    apart = 50.0 + MOST_HARM + 4.0 * MOST_HARM * runs  # may cost more, but is better on average
    assert kept_count(50.0, apart * np.ones(3)) == 1
    assert kept_count(50.0, apart + MOST_HARM * np.array([1.0, 1.0, -2.0])) == 0  # and worse in one output


def test_later_causes_gain_plainly_or_surely():
    assert kept_count(50.0, 60.0, 60.05, 70.0) == 1  # nothing after what gains too little
    assert kept_count(50.0, 60.0, 60.2) == 2
    runs = np.array([[-1.0], [-1.0], [-1.0], [1.0], [1.0], [1.0]])
    assert kept_count(50.0, 60.0, 60.2 + 3.0 * runs) == 1  # a little, and perhaps nothing
    assert kept_count(50.0, 60.0, 62.0 + 6.0 * runs) == 2  # plainly


def test_what_is_not_told_is_said_with_the_tests_that_saw_it():
    """The table of tests is that of the round in which it stood out, and a note names it."""
    found = steps_of("one", "two", "three")
    told = found.with_steps(found.steps[:1])
    assert told.final_screening == ("two",)
    assert found.with_steps(found.steps).final_screening == ()
    assert found.with_steps(()).final_screening == ("one",)
    notes = notes_on_dropped(found, told, "runs")
    assert len(notes) == 2
    assert all("a sign of a current (chance 0.0001). It was left out: runs" in note for note in notes)


@pytest.fixture(scope="module")
def barge():
    """Data of a barge with a weak thrust, and its model."""
    record = hidden_record("barge", seed=43, batches=4, samples=150, effects={"gain": -0.12})
    extended = as_extended(vessel_of("barge"), record)
    return extended, cut_windows(extended.model, record)


def added(base, windows, candidate: Candidate) -> Step:
    scored = Scored(candidate=candidate, statistic=0.0, p_value=1.0, step=np.zeros(len(candidate.free)), tests=20.0)
    chosen = contend(base, windows, opening(base, scored))
    assert chosen is not None
    return Step(chosen=chosen, p_value=0.0, rivals=(), before=base, screening=())


def test_an_estimate_of_nothing_goes_and_the_rest_is_estimated_as_without_it(barge):
    """A dead time that the ship does not have stands at zero; whichever place it was found in, it alone goes."""
    extended, windows = barge
    weak = Candidate(cause="thrust_gain", free={"gain": 0.0})
    late = Candidate(cause="actuator_delay", free={"delay:all": 0.5}, finite=True)
    before = fit(extended, windows, (), starts=first_states(windows))
    alone = added(before, windows, weak)
    for order, idle in (((weak, late), 1), ((late, weak), 0)):
        steps, base = [], before
        for candidate in order:
            steps.append(added(base, windows, candidate))
            base = steps[-1].chosen.fit
        assert like_nothing(tuple(steps), base) == idle
        (rest,) = without(steps, idle, windows) or ()
        assert rest.before is before
        assert rest.chosen.fit.value("gain") == pytest.approx(alone.chosen.fit.value("gain"), abs=1e-3)
        assert like_nothing((rest,), rest.chosen.fit) is None


def test_runs_held_out_have_no_say_in_the_sizes_they_are_judged_by(barge):
    """One run is spoilt so that the fit to all runs is many standard errors off; the fit to the others is not."""
    extended, windows = barge
    some = windows.batch < np.unique(windows.batch)[-1]
    start = first_states(windows)
    alone = fit(extended, windows.picked(some), ("gain",), starts=start[some])
    measured = windows.measured.copy()
    measured[~some] *= 1.3
    spoilt = replace(windows, measured=measured)
    whole = fit(extended, spoilt, ("gain",), starts=first_states(spoilt))
    apart = _fitted(whole, spoilt, some)
    assert apart is not None
    assert abs(whole.value("gain") - alone.value("gain")) > 10 * alone.std("gain")
    assert abs(apart.get("gain") - alone.value("gain")) < alone.std("gain")


def test_folds_that_cannot_be_fitted_count_for_neither_model():
    before, after = errors(50.0), errors(60.0)
    lost, spread = after.lost.copy(), after.spread.copy()
    lost[:2], spread[:2] = np.nan, np.nan
    gap = HeldOut(lost=lost, spread=spread)
    assert gained(before, gap, 0) == (pytest.approx(10.0), (pytest.approx(10.0), pytest.approx(10.0)))
    assert np.isnan(gained(before, HeldOut(lost=np.nan * lost, spread=spread), 0)[0])
    assert kept_count(50.0, np.full((6, 1), np.nan)) == 0


def test_gains_of_sizes_that_have_seen_the_runs_are_told():
    assert _stuck_note([errors(50.0), errors(60.0)]) == ()
    (note,) = _stuck_note([errors(50.0), replace(errors(60.0), stuck=2), replace(errors(61.0), stuck=1)])
    assert "3 got nowhere" in note


def test_several_numbers_are_tested_together():
    """Two estimates that say little apart and much together, and the other way round, by the chi-squared law."""
    for correlation, values, clear in ((-0.95, (1.5, 1.5), True), (0.95, (1.5, 1.5), False), (0.0, (2.2, 0.1), False)):
        last = SimpleNamespace(
            keys=("a", "b"), covariance=np.array([[1.0, correlation], [correlation, 1.0]]),
            value=dict(zip("ab", values, strict=True)).get, ship=SimpleNamespace(stated={}),
        )  # fmt: skip
        chosen = SimpleNamespace(keys=("a", "b"), searched=None)
        expected = np.exp(-0.5 * np.array(values) @ np.linalg.solve(last.covariance, values))
        assert wald(chosen, last) == pytest.approx(expected)  # type: ignore[arg-type]
        assert (expected < LEVEL) == clear


def test_a_block_of_parameters_gives_way_to_the_one_number_behind_it(monkeypatch):
    """Found before the change on the way that hid it, a heavier ship looks like a block of yaw parameters."""
    effects = {"load_r": 0.35, "change_s": 700.0, "change_gain": 0.25}
    record = hidden_record("barge", seed=44, batches=6, samples=200, effects=effects)
    extended = as_extended(vessel_of("barge"), record)
    windows = cut_windows(extended.model, record)
    block = Candidate(cause="parameters", free={f"theta:{name}": 0.0 for name in ("N_r", "N_uv", "N_mu")})
    change = Candidate(cause="change_point", free={"change:gain": 0.0}, fixed={"change:time": 700.0})
    start = first_states(windows)
    rounds = iter((block, change))
    real = search.__globals__["_round"]

    def scripted(base, windows, refused, rng, progress, *, most=99):
        if most < 99:
            return None, ()
        candidate = next(rounds, None)
        return (
            real(base, windows, refused, rng, progress) if candidate is None else (added(base, windows, candidate), ())
        )

    monkeypatch.setitem(search.__globals__, "_round", scripted)
    found = search(extended, windows, start, np.random.default_rng(0), lambda what, share: None)
    assert {step.chosen.candidate.cause for step in found.steps} == {"change_point", "load_change"}
    assert abs(found.last.value("inertia:r") - 0.35) < 3 * found.last.std("inertia:r") + 0.01


def test_what_ends_at_nothing_makes_way_and_a_round_without_gain_ends(monkeypatch):
    """Gains of three contenders, and which of them end at nothing: the best of the others stand, or none."""
    parts = search.__globals__
    monkeypatch.setitem(parts, "finished", lambda base, windows, item: item)
    monkeypatch.setitem(parts, "judged", lambda base, items: items)
    monkeypatch.setitem(parts, "wald", lambda item, fitted: 1.0 if item.idle else 0.0)

    def standing(gains: tuple[float, ...], idle: tuple[int, ...] = ()) -> list[float]:
        rough = [SimpleNamespace(gain=gain, fit=None, idle=number in idle) for number, gain in enumerate(gains)]
        return [item.gain for item in parts["_standing"](None, None, rough)]

    assert standing((155.0, 57.0, 2.0)) == [155.0]
    assert standing((155.0, 57.0, 2.0), idle=(0,)) == [57.0]
    assert standing((155.0, 57.0, 20.0), idle=(0, 1, 2)) == []
    assert standing((-200.0, -300.0, float("-inf"))) == []
    assert standing((float("nan"), -300.0, -400.0)) == []
    assert standing(()) == []


def test_a_large_effect_is_judged_by_all_that_was_tried():
    """Short windows tell where fits of large effects begin; p-values count all tests of the round all the same."""
    record = hidden_record("barge", seed=3, batches=4, samples=200, effects={"gain": -0.35})
    ship = as_extended(vessel_of("barge"), record)
    windows = cut_windows(ship.model, record)
    base = settled(ship, windows, first_states(windows))
    situation = Situation(ship=base.ship, windows=windows)
    candidates = [item for cause in CAUSES for item in cause.candidates(situation)]
    openings, far = _openings(base, windows, screen(base, candidates, np.random.default_rng(0)))
    assert far
    assert all(one.scored.tests > 5.0 for one in openings)
