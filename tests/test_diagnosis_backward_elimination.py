"""Backward elimination drops causes without held-out gain and causes whose size may be zero."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import hidden_effects as sea
from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.causes.candidate import Candidate, Situation
from expdesign.diagnosis.conclusions.findings import note_on_unconverged, notes_on_rejected
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit.cross_validation import CrossValidation, _fitted
from expdesign.diagnosis.fit.fit import Fit
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.fit.held_out import HeldOut, held_out_gain, judged
from expdesign.diagnosis.motion.simulation import initial_states, simulate_from_measured
from expdesign.diagnosis.select import backward_elimination
from expdesign.diagnosis.select.backward_elimination import before_first_without_gain, improves_held_out
from expdesign.diagnosis.select.fitted_candidate import Rival
from expdesign.diagnosis.select.forward_selection import fit_nuisance, to_take_out
from expdesign.diagnosis.select.score_tests import ScoreTest, score_tests
from expdesign.diagnosis.select.selection import (
    Selection,
    Step,
    insignificant_steps,
    p_value_between_runs,
    wald_p_value,
    with_alternatives_beside_all,
    with_p_values_beside_all,
    without_step,
)
from expdesign.diagnosis.select.selection_round import Work, selection_round
from expdesign.diagnosis.select.shortlist import starting_points
from expdesign.diagnosis.select.starting_point import starting_point
from expdesign.diagnosis.select.tuning import TUNING
from expdesign.diagnosis.vessel_file.reading import extended_model
from held_out_cases import POSSIBLE, RUNS, added, errors, steps_of


def kept_count(*fits: np.ndarray | float) -> int:
    """How many causes are kept, by the fits of their models to held-out runs; the first fit is of the model in use."""
    found = steps_of(*(f"effect {number}" for number in range(len(fits) - 1)))
    return len(before_first_without_gain(found, improves_held_out(found, [errors(value) for value in fits], 0)).steps)


def test_a_first_cause_that_may_cost_a_fiftieth_of_the_error_is_dropped():
    """If all runs have the same fit, the interval has no width; runs that differ widen it."""
    gain, loss = 1.2, 50.0 * TUNING.most_loss_share
    assert kept_count(50.0, 50.0 - 0.9 * loss) == 0  # certain to cost something
    assert kept_count(50.0, 50.0 + gain + 0.2 * loss * RUNS) == 1
    assert kept_count(50.0, 50.0 - 0.1 * loss + 4.0 * gain * RUNS) == 0  # no better on average
    assert kept_count(50.0, 50.0 + gain + 4.0 * gain * RUNS) == 0  # better on average, and perhaps not
    one = np.array([10.0 * gain, 0.0, 0.0]) + RUNS * np.array([0.0, -5.0 * gain, -5.0 * gain])
    assert kept_count(50.0, 50.0 + one) == 1  # certain in one output, the others as before on average
    assert kept_count(50.0, 50.0 + one - gain * np.array([0.0, 4.0, 4.0])) == 0  # and worse in these


@pytest.mark.parametrize(
    ("change", "kept"),
    [
        ([6.0, 6.0, -3.1], False),  # gains of 2.97, 3.03 and 4 points
        ([6.0, 6.0, -2.9], True),
        ([6.0, 6.0, 0.0], True),
        ([[2.4], [2.2], [0.9], [-0.6], [-0.6], [0.9]], False),  # a point, or less in an interval that excludes zero
        ([0.9], True),
    ],
)
def test_a_cause_that_imitates_others_needs_a_gain_and_costs_no_output_more_than_that(change, kept):
    found = steps_of("wind")
    held = [errors(50.0), errors(50.0 + np.array(change) * np.ones((6, 1)))]
    if len(change) == 3:  # of a cause that imitates none
        assert improves_held_out(found, held, 0) == [True]
    found.steps[0].chosen.candidate = Candidate(cause="wind", free={"effect": 0.0}, imitates=True)
    assert improves_held_out(found, held, 0) == [kept]


def test_a_cause_that_imitates_others_does_not_make_a_simpler_one_redundant():
    """Unless it gains much more than the simpler one: then that was an approximation."""

    def step(keys: int, gain: float, *, imitates: bool = False, outranked: tuple[Candidate, ...] = ()) -> Step:
        candidate = Candidate(cause="any", free={}, imitates=imitates)
        chosen = SimpleNamespace(keys=("key",) * keys, likelihood_gain=gain, candidate=candidate)
        return SimpleNamespace(chosen=chosen, outranked=outranked)  # type: ignore[return-value]

    simple, block = step(1, 70.0), step(3, 70.0)
    for gain, taken in ((29.0, 1), (31.0, 0)):  # `simple` is more or less than 0.7 of what both gain
        wind = step(3, gain, imitates=True)
        assert to_take_out([simple, wind], 0) == taken
        assert to_take_out([block, wind], 0) == 0
        assert to_take_out([simple, step(3, gain)], 0) == 0
        better = step(1, 70.0, outranked=(wind.chosen.candidate,))  # on held-out data
        assert to_take_out([better, wind], 0) == 1


def test_what_takes_less_than_a_hundredth_off_every_error_is_no_finding():
    """Errors are what is missing of a fit of 100 points; significant or not, first or later."""
    for before in (50.0, 90.0):
        little = TUNING.least_reduction * (100.0 - before)
        assert kept_count(before, before) == 0
        assert kept_count(before, before + 0.9 * little) == 0
        assert kept_count(before, before + 1.1 * little) == 1
        assert kept_count(before, before + 1.1 * little * np.array([[1.0, 0.0, 0.0]]) * np.ones((6, 1))) == 1
    assert kept_count(50.0, 60.0, 60.3) == 1


@pytest.mark.parametrize("reduction", [0.004, 0.006, 0.009, 0.011, 0.02])
def test_a_hundredth_of_the_error_is_a_fiftieth_of_its_square_in_predictions_too(monkeypatch, reduction):
    """Simulations of runs leave it open: better on average, and perhaps not."""
    held, share = [errors(50.0), errors(51.2 + 4.8 * RUNS)], 1.0 - (1.0 - reduction) ** 2
    found = steps_of("delay")
    found.steps[0].chosen.fit = SimpleNamespace(noise=None)
    monkeypatch.setattr(backward_elimination, "prediction_gain", lambda *_: (share, (0.5 * share, 1.5 * share)))
    assert improves_held_out(found, held, 0, SimpleNamespace()) == [reduction > TUNING.least_reduction]  # type: ignore[arg-type]


@pytest.mark.parametrize("several", [False, True])
@pytest.mark.parametrize("place", [0, 1])
def test_predictions_show_a_single_cause_where_simulations_leave_it_open_and_never_several_parameters(
    monkeypatch, place, several
):
    """The first cause and a later one alike; simulations are better on average, and perhaps not."""
    fits = [50.0, 51.2 + 4.8 * RUNS] if place == 0 else [50.0, 60.0, 61.6 + 4.8 * RUNS]
    found = steps_of(*("first", "later")[: place + 1])
    chosen = found.steps[place].chosen
    chosen.fit, chosen.is_block = SimpleNamespace(noise=None), several
    for share, shows in ((0.5, not several), (0.9 * TUNING.least_predicted, False)):
        interval = (0.9 * share if place or share > TUNING.least_predicted else -share, 1.1 * share)
        monkeypatch.setattr(backward_elimination, "prediction_gain", lambda *_, s=share, i=interval: (s, i))
        improves = improves_held_out(found, [errors(fit) for fit in fits], 0, SimpleNamespace())  # type: ignore[arg-type]
        assert improves[place] is shows


def test_later_causes_need_a_clear_or_a_significant_gain():
    assert kept_count(50.0, 60.0, 60.05, 70.0) == 1  # no cause after one that gains too little
    assert kept_count(50.0, 60.0, 60.5) == 2
    assert kept_count(50.0, 60.0, 60.6 + 3.0 * RUNS) == 1  # a small gain that may be zero
    assert kept_count(50.0, 60.0, 62.0 + 6.0 * RUNS) == 1  # a large one that may be zero
    assert kept_count(50.0, 60.0, 62.0 + RUNS) == 2  # a clear gain


def test_rejected_causes_are_noted_with_their_tests():
    """Beside the findings, by the tests that the page shows; what is no sign there is not called one."""
    found = steps_of("one", "two", "three")
    kept = found.with_steps(found.steps[:1])
    assert kept.last_tests == ("two",)
    assert found.with_steps(found.steps).last_tests == ()
    assert found.with_steps(()).last_tests == ("one",)
    left = [
        ScoreTest(candidate=step.chosen.candidate, statistic=0.0, p_value=p_value, step=np.zeros(1))
        for step, p_value in zip(found.steps, (0.0, 1e-4, 0.3), strict=True)
    ]
    (note,) = notes_on_rejected(found, replace(kept, last_tests=tuple(left)), "runs")
    assert "a sign of a current (p = 0.0001). It is not a finding" in note
    for names, words in (((), "values of some parameters"), (("N_r",), "a value of N_r")):
        (step,) = steps_of("one").steps
        step.chosen.candidate, step.chosen.parameters = Candidate(cause="parameters", free={"one": 0.0}), names
        tests = (ScoreTest(candidate=step.chosen.candidate, statistic=0.0, p_value=1e-4, step=np.zeros(1)),)
        (note,) = notes_on_rejected(replace(found, steps=(step,)), replace(kept, steps=(), last_tests=tests), "runs")
        assert f"a sign of {words} unlike the file's (p = " in note


@pytest.fixture(scope="module")
def barge():
    """Data of a barge with a weak thrust, and its model."""
    record = hidden_record("barge", seed=43, batches=4, samples=150, effects={"gain": -0.12})
    extended = extended_model(vessel_of("barge"), record)
    return extended, cut_windows(extended.model, record)


@pytest.fixture(scope="module")
def barge_of_two():
    """The fit before any cause of a barge with a weak thrust and a turned compass, and the data."""
    faults = {"heading_bias": 0.04}
    record = hidden_record("barge", seed=43, batches=4, samples=150, effects={"gain": -0.03}, faults=faults)
    extended = extended_model(vessel_of("barge"), record)
    windows = cut_windows(extended.model, record)
    return fit(extended, windows, (), starts=initial_states(windows)), windows


def with_p_values(steps: list[Step], last: Fit) -> tuple[Step, ...]:
    """Steps with the p-values of their sizes in the last fit."""
    return tuple(replace(step, p_value=wald_p_value(step.chosen, last)) for step in steps)


def test_a_cause_of_size_zero_is_taken_out_and_the_rest_is_estimated_anew(barge):
    """A dead time that the ship does not have is estimated as zero. It alone is taken out, first or last."""
    extended, windows = barge
    weak = Candidate(cause="thrust_gain", free={"gain": 0.0})
    late = Candidate(cause="actuator_delay", free={"delay:all": 0.5}, finite=True)
    before = fit(extended, windows, (), starts=initial_states(windows))
    alone = added(before, windows, weak)
    for order, insignificant in (((weak, late), 1), ((late, weak), 0)):
        steps, base = [], before
        for candidate in order:
            steps.append(added(base, windows, candidate))
            base = steps[-1].chosen.fit
        assert insignificant_steps(with_p_values(steps, base)) == [insignificant]
        (rest,) = without_step(steps, insignificant, windows) or ()
        assert rest.before is before
        assert rest.chosen.fit.value("gain") == pytest.approx(alone.chosen.fit.value("gain"), abs=1e-3)
        assert insignificant_steps(with_p_values([rest], rest.chosen.fit)) == []


def test_an_alternative_has_to_explain_as_much_beside_all_other_causes():
    """Cubic damping is one to a current as long as quadratic damping is missing; another form of the current stays."""
    record = hidden_record("tug", seed=45, batches=3, samples=150, current=(0.3, -0.2))
    vessel = vessel_of("tug", without=("Y_abs_v_v",))
    ship = extended_model(vessel, record)
    windows = cut_windows(ship.model, record)
    flow = Candidate(cause="current", free={"current:north": 0.0, "current:east": 0.0})
    cubic = Candidate(cause="missing_term:Y_vvv", free={"term:Y_vvv": 0.0})
    drag = Candidate(cause="missing_term:Y_abs_v_v", free={"term:Y_abs_v_v": 0.0})
    before = fit(ship, windows, (), starts=initial_states(windows))
    first = added(before, windows, flow)
    rivals = tuple(
        Rival(candidate=replace(one, cause=f"{one.cause}, too"), ship=added(before, windows, one).chosen.fit.ship,
              trails_by=0.0)
        for one in (flow, cubic, drag)
    )  # fmt: skip
    first = replace(first, alternatives=rivals)
    second = added(first.chosen.fit, windows, drag)
    found = Selection(
        steps=(first, replace(second, alternatives=rivals[:1])), first=before, last=second.chosen.fit, last_tests=()
    )
    judged, last = with_alternatives_beside_all(found, windows).steps
    (left,) = judged.alternatives
    assert left.candidate.cause == "current, too"
    assert left.trails_by < 1.0
    assert left.ship.get("term:Y_abs_v_v") == pytest.approx(found.last.value("term:Y_abs_v_v"), rel=0.01)
    assert last.alternatives == rivals[:1]  # nothing was found after it


def test_the_p_value_of_a_cause_is_that_of_taking_it_away_beside_all_others(barge_of_two):
    """Whatever the order in which causes were added: on none before it, the first gained under larger noise."""
    before, windows = barge_of_two
    alone, told = dict[str, float](), list[dict[str, float]]()
    for order in (("gain", "heading_bias"), ("heading_bias", "gain")):
        steps, base = [], before
        for name in order:
            steps.append(added(base, windows, Candidate(cause=name, free={name: 0.0})))
            base = steps[-1].chosen.fit
        found = Selection(steps=tuple(steps), first=before, last=base, last_tests=())
        judged = with_p_values_beside_all(found)
        alone[order[0]] = steps[0].chosen.likelihood_gain
        told.append({step.chosen.candidate.cause: step.chosen.likelihood_gain for step in judged.steps})
        assert all(step.p_value < 1e-100 for step in judged.steps)
    for name, gain in alone.items():
        first, second = (one[name] for one in told)
        assert first == pytest.approx(second, rel=0.4)  # noise is estimated anew
        assert min(first, second) > 2.0 * gain
    assert p_value_between_runs(steps[0].chosen, None, found.dispersion) > 1e-40


def test_a_single_cause_keeps_its_p_value(barge_of_two):
    before, windows = barge_of_two
    only = added(before, windows, Candidate(cause="gain", free={"gain": 0.0}))
    found = Selection(steps=(only,), first=before, last=only.chosen.fit, last_tests=())
    (step,) = with_p_values_beside_all(found).steps
    assert step.chosen.likelihood_gain == only.chosen.likelihood_gain


def test_runs_held_out_do_not_influence_the_estimates_they_validate(barge):
    """One run is corrupted. The fit to all runs is then many standard errors off; the fit to the others is not."""
    extended, windows = barge
    some = windows.batch < np.unique(windows.batch)[-1]
    start = initial_states(windows)
    alone = fit(extended, windows.selected(some), ("gain",), starts=start[some])
    measured = windows.measured.copy()
    measured[~some] *= 1.3
    corrupted = replace(windows, measured=measured)
    whole = fit(extended, corrupted, ("gain",), starts=initial_states(corrupted))
    apart = _fitted(whole, corrupted, some)
    assert apart is not None
    assert abs(whole.value("gain") - alone.value("gain")) > 10 * alone.std("gain")
    assert abs(apart.get("gain") - alone.value("gain")) < 2 * alone.std("gain")


def test_a_change_that_comes_after_the_data_of_a_fold_is_no_part_of_its_fit(barge):
    """Nothing is known of it there. With data from before and after the change it is estimated."""
    extended, windows = barge
    last = windows.batch == windows.batch.max()
    changing = extended.with_effects({"change:time": float(windows.time_s[last].min())})
    whole = fit(changing, windows, ("gain", "change:gain"), starts=initial_states(windows))
    assert abs(whole.value("change:gain")) > 0.0
    before = _fitted(whole, windows, ~last)
    assert before is not None
    assert before.get("change:gain") == 0.0
    assert before.get("gain") == pytest.approx(whole.value("gain"), abs=0.05)
    both = _fitted(whole, windows, windows.batch > windows.batch.min())
    assert both is not None
    assert both.get("change:gain") != 0.0


@pytest.mark.parametrize("key", ["slew:rudder", "lag:rudder", "delay:rudder"])
def test_an_actuator_that_is_quicker_than_its_file_says_is_so_in_every_fold(key: str):
    """At zero a slew time has no slope, which is no reason to hold out runs beside the time of the file."""
    record = hidden_record("coaster", seed=3, batches=3, samples=120)
    slow = extended_model(vessel_of("coaster"), record)
    ship = replace(slow, effects={key: 5.0}, stated={key: 5.0})
    windows = cut_windows(ship.model, record)
    whole = fit(ship, windows, (key,), starts=initial_states(windows))
    assert whole.value(key) == pytest.approx(0.0, abs=0.5)
    for out in np.unique(windows.batch):
        apart = _fitted(whole, windows, windows.batch != out)
        assert apart is not None
        assert apart.get(key) == pytest.approx(0.0, abs=0.5)


def test_stretches_of_a_run_are_predicted_by_models_that_saw_other_runs_only():
    """In the order of time: as simulated by hand with the models of the whole runs that were held out."""
    record = hidden_record("barge", seed=4, batches=3, samples=120, factors={"N_r": 1.2})
    ship = extended_model(vessel_of("barge", relative_std=0.2), record)
    windows = cut_windows(ship.model, record)
    validation = CrossValidation(windows, record)
    held = validation.of(fit(ship, windows, (), starts=initial_states(windows)))
    assert held.on_other_runs is not None
    found = held.on_other_runs()
    assert found.run is not None
    assert (np.diff(found.run) >= 0.0).all()
    short = validation.short_windows(ship)
    (model,) = (one for out, one in held.models if out[windows.batch == 1.0].all())
    assert model is not None
    error = simulate_from_measured(model, short.selected(short.batch == 1.0)).error[..., :3]
    assert found.squared_error[found.run == 1.0].sum() == pytest.approx(np.nansum(error**2), rel=1e-9)
    both = replace(record, batches=record.batches[:2])  # two runs: as parts of them are held out
    windows = cut_windows(ship.model, both)
    held = CrossValidation(windows, both).of(fit(ship, windows, (), starts=initial_states(windows)))
    assert held.on_other_runs is held.ahead


def test_folds_that_cannot_be_fitted_count_for_neither_model():
    before, after = errors(50.0), errors(60.0)
    lost, spread = after.squared_error.copy(), after.squared_deviation.copy()
    lost[:2], spread[:2] = np.nan, np.nan
    gap = HeldOut(squared_error=lost, squared_deviation=spread)
    assert held_out_gain(before, gap, 0) == (pytest.approx(10.0), (pytest.approx(10.0), pytest.approx(10.0)))
    assert np.isnan(held_out_gain(before, HeldOut(squared_error=np.nan * lost, squared_deviation=spread), 0)[0])
    assert kept_count(50.0, np.full((6, 1), np.nan)) == 0


def test_folds_that_did_not_converge_are_noted():
    assert note_on_unconverged([errors(50.0), errors(60.0)]) == ()
    several = [replace(errors(60.0), unconverged=2), replace(errors(61.0), unconverged=1)]
    (note,) = note_on_unconverged([errors(50.0), *several])
    assert "3 fits of the cross-validation" in note


def test_several_numbers_are_tested_together():
    """Two estimates that are insignificant singly and significant jointly, and the opposite, by the chi-squared law."""
    for correlation, values, clear in ((-0.95, (1.5, 1.5), True), (0.95, (1.5, 1.5), False), (0.0, (2.2, 0.1), False)):
        last = SimpleNamespace(
            keys=("a", "b"), covariance=np.array([[1.0, correlation], [correlation, 1.0]]),
            value=dict(zip("ab", values, strict=True)).get, ship=SimpleNamespace(stated={}), freedom=np.inf,
        )  # fmt: skip
        chosen = SimpleNamespace(keys=("a", "b"), profiled=None)
        expected = np.exp(-0.5 * np.array(values) @ np.linalg.solve(last.covariance, values))
        assert wald_p_value(chosen, last) == pytest.approx(expected)  # type: ignore[arg-type]
        assert (expected < TUNING.level) == clear


def test_what_physics_excludes_is_no_finding():
    found = steps_of("drag")
    held = [errors(50.0), errors(90.0)]
    for value, kept in ((-1.0, True), (1.0, False)):
        candidate = Candidate(cause="wind", free={"drag": 0.0}, bounds=({"drag": 1.0},))
        step = SimpleNamespace(chosen=SimpleNamespace(keys=("drag",), fit="drag", candidate=candidate))
        last = SimpleNamespace(value={"drag": value}.__getitem__, ship=POSSIBLE)
        assert improves_held_out(replace(found, steps=(step,), last=last), held, 0) == [kept]  # type: ignore[arg-type]


def test_gains_are_those_of_stretches_where_a_whole_run_leads_astray():
    """Where a model with causes simulates worse than a constant; the model in use may be as bad as it is."""
    ahead = [errors(value) for value in (70.0, 75.0, 80.0)]

    def of(*whole: float) -> list[float]:
        pairs = zip(whole, ahead, strict=True)
        return [one.fit[0] for one in judged([replace(errors(v), ahead=lambda short=e: short) for v, e in pairs])]

    assert of(-50.0, 20.0, 30.0) == pytest.approx([-50.0, 20.0, 30.0])
    assert of(50.0, 20.0, -30.0) == pytest.approx([70.0, 75.0, 80.0])


def test_air_that_pushes_against_the_wind_is_no_cause():
    """Nor is air that pushes more ahead than aside, or beyond the ends of the hull; the generator's own air is one."""
    record = hidden_record("tug", seed=1, batches=2, samples=120)
    record = replace(record, batches=tuple(replace(batch, wind=None) for batch in record.batches))
    lacking = vessel_of("tug", without=("W_abs_u_u", "W_abs_v_v", "W_uv"))
    ship = extended_model(lacking, record)
    situation = Situation(ship=ship, windows=cut_windows(ship.model, record))
    winds = [one for cause in CAUSES for one in cause.candidates(situation) if one.cause == "wind"]
    assert winds
    assert all(one.imitates for one in winds)
    true = {f"term:{name}": sea.TUG[name] for name in ("W_abs_u_u", "W_abs_v_v", "W_uv")}
    ahead, aside, turning = true
    length_m = lacking.length_m
    for change, possible in (
        ({}, True),
        ({ahead: 1e-4}, False),
        ({aside: 1e-4}, False),
        ({ahead: 1.9 * true[aside]}, True),
        ({ahead: 2.1 * true[aside]}, False),
        ({turning: 15.0 / length_m * true[aside]}, True),
        ({turning: 17.0 / length_m * true[aside]}, False),
        ({turning: -17.0 / length_m * true[aside]}, False),
    ):
        assert all(one.is_possible((true | change).__getitem__) is possible for one in winds)


def test_candidates_that_converge_to_zero_make_room_for_the_next_best(monkeypatch):
    """Gains of three candidates, some of which converge to zero: the best of the others remain, or none."""
    names = selection_round.__globals__
    monkeypatch.setitem(names, "fit_to_convergence", lambda base, windows, item: item)
    monkeypatch.setitem(names, "ranked_by_gain", lambda base, items: items)
    monkeypatch.setitem(names, "wald_p_value", lambda item, fitted: 1.0 if item.zero else 0.0)

    def remaining(gains: tuple[float, ...], zero: tuple[int, ...] = ()) -> list[float]:
        rough = [
            SimpleNamespace(likelihood_gain=gain, numbers=1, fit=SimpleNamespace(converged=True), zero=number in zero)
            for number, gain in enumerate(gains)
        ]
        return [item.likelihood_gain for item in names["_significant"](None, None, rough, Work())]

    assert remaining((155.0, 57.0, 2.0)) == [155.0]
    assert remaining((155.0, 57.0, 2.0), zero=(0,)) == [57.0]
    assert remaining((155.0, 57.0, 20.0), zero=(0, 1, 2)) == []
    assert remaining((-200.0, -300.0, float("-inf"))) == []
    assert remaining((float("nan"), -300.0, -400.0)) == []
    assert remaining(()) == []


@pytest.mark.thorough
def test_p_values_of_a_large_effect_count_all_tests(monkeypatch):
    """Short windows give the starting points of large effects; p-values still count all tests of the round."""
    record = hidden_record("barge", seed=3, batches=4, samples=200, effects={"gain": -0.35})
    ship = extended_model(vessel_of("barge"), record)
    windows = cut_windows(ship.model, record)
    base = fit_nuisance(ship, windows, initial_states(windows))
    situation = Situation(ship=base.ship, windows=windows)
    candidates = [item for cause in CAUSES for item in cause.candidates(situation)]
    tests, known = score_tests(base, candidates, np.random.default_rng(0)), {}
    openings, far = starting_points(base, windows, tests, known)
    assert far
    assert all(one.test.multiplicity > 5.0 for one in openings)
    monkeypatch.setitem(starting_point.__globals__, "fit", None)  # another round from the same fit makes none anew
    again, _ = starting_points(base, windows, tests, known)
    assert [one.effects for one in again] == [one.effects for one in openings]
