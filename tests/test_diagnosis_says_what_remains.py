"""Where a simulation explains little, the verdict says so, and how much a force that nobody measured would explain."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis import Lead, Unexplained, diagnose
from expdesign.diagnosis.accuracy import accuracy
from expdesign.diagnosis.conclusions.verdict import remarks, verdict
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit import CrossValidation
from expdesign.diagnosis.fit.fit import unmeasured_force_share
from expdesign.diagnosis.motion import linearise
from expdesign.diagnosis.motion.simulation import initial_states, simulate_from_measured
from expdesign.diagnosis.select import forward_selection
from expdesign.diagnosis.select.forward_selection import fit_nuisance
from expdesign.diagnosis.select.selection_round import Work, selection_round
from expdesign.diagnosis.select.tuning import TUNING
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.progress import Estimated, silent
from expdesign.signals import Record
from hidden_effects import Weather

PERIOD_S = 200.0


def shares(record: Record) -> np.ndarray:
    ship = extended_model(vessel_of("barge"), record)
    return unmeasured_force_share(
        linearise(simulate_from_measured(ship, cut_windows(ship.model, record))), ("u", "v", "r")
    )


def with_slow_sway_force(record: Record, size: float) -> Record:
    """The same motion, of which the inputs do not tell a slow part of the force."""

    def untold(batch):
        slow = np.sin(2 * np.pi * np.arange(len(batch)) / PERIOD_S)
        return replace(batch, inputs=batch.inputs - size * slow[:, None] * np.array([0.0, 1.0, 0.0]))

    return Record(batches=tuple(untold(batch) for batch in record.batches))


def test_a_slow_force_takes_away_the_error_that_one_causes_and_no_white_noise():
    calm = hidden_record("barge", seed=6, batches=4, samples=300, weather=Weather(current_std=0.0, wind_std=0.0))
    pushed = with_slow_sway_force(calm, np.abs(calm.batches[0].inputs[:, 1]).mean())
    noise, slow = shares(calm), shares(pushed)
    assert (noise < 0.1).all()
    assert slow[1] > 0.5
    assert slow[0] < slow[1]


def test_little_explained_is_never_called_no_error():
    record = hidden_record("barge", seed=6, batches=2, samples=120)
    before = accuracy(extended_model(vessel_of("barge"), record), record)
    remains = Unexplained(
        outputs=("u", "v", "r"), fit=np.array([29.0, -68.0, -400.0]), force_share=np.array([0.4, 0.75, 0.0]),
        leads=(Lead("wind", 3.2, (-1.0, 6.0)), Lead("current", 0.5, (-2.0, 2.0))),
    )  # fmt: skip
    assert verdict((), before, "runs", remains) == (
        "The simulation explains little of these data and no cause is certain. The fit is 29 % in surge and -68 % in "
        "sway and the simulation diverges in yaw; the best candidate is wind (+3.2 points of fit, -1.0 to 6.0) on runs "
        "held out. Keep the vessel file; sail more runs, and measure wind and current, before it is changed."
    )
    force, leads = remarks("runs", remains, (), (), ())
    assert force == (
        "A slowly varying force that nobody measured would take 40 % off the surge error, 75 % off the sway error and "
        "0 % off the yaw error."
    )
    assert "a current (+0.5 points of fit, -2.0 to 2.0)" in leads
    assert "no error" in verdict((), before)


def test_a_search_ends_at_its_limit_and_says_what_it_left():
    work = Work()
    assert work.allows("a")
    work.spend(TUNING.most_simulations)
    assert not work.allows("b")
    assert not work.allows("c")
    assert not work.allows("b")
    assert work.untried == ["b", "c"]


def test_a_limit_of_nothing_leaves_all_causes_untried(monkeypatch: pytest.MonkeyPatch):
    spent = Work(simulations=TUNING.most_simulations)
    monkeypatch.setattr(forward_selection, "Work", lambda **_: spent)
    record = hidden_record("barge", seed=6, batches=2, samples=120, effects={"gain": -0.3})
    ship = extended_model(vessel_of("barge"), record)
    windows = cut_windows(ship.model, record)
    found = forward_selection.select_forward(
        ship,
        windows,
        initial_states(windows),
        np.random.default_rng(0),
        Estimated(silent),
        CrossValidation(windows),
    )
    assert found.steps == ()
    assert found.untried == ("further causes",)


@pytest.mark.thorough
def test_a_cause_stays_that_is_found_with_the_last_of_the_work(monkeypatch: pytest.MonkeyPatch):
    """The one before it becomes redundant, and no work is left to begin again without that."""

    def first_of_two(steps, search):
        if len(steps) < 2:
            return None
        search.work.spend(TUNING.most_simulations)
        return 0

    monkeypatch.setattr(forward_selection, "_to_reject", first_of_two)
    hidden = {"effects": {"gain": -0.1}, "faults": {"heading_bias": 0.1}}
    record = hidden_record("barge", seed=6, batches=3, samples=200, **hidden)
    ship = extended_model(vessel_of("barge"), record)
    windows = cut_windows(ship.model, record)
    arguments = np.random.default_rng(0), Estimated(silent), CrossValidation(windows)
    found = forward_selection.select_forward(ship, windows, initial_states(windows), *arguments)
    (step,) = found.steps
    assert found.last is step.chosen.fit
    (cause,) = {"thrust_gain", "heading_bias"} & {step.chosen.candidate.cause}
    kept, dropped = ("gain", "heading_bias") if cause == "thrust_gain" else ("heading_bias", "gain")
    assert abs(found.last.value(kept)) > 3 * found.last.std(kept)
    assert dropped not in found.last.free_keys
    assert found.untried[0] == "further causes"


@pytest.mark.thorough
def test_a_second_round_from_the_same_fit_costs_no_simulations():
    record = hidden_record("barge", seed=6, batches=2, samples=120, effects={"gain": -0.3})
    ship = extended_model(vessel_of("barge"), record)
    windows = cut_windows(ship.model, record)
    base, work, validation = fit_nuisance(ship, windows, initial_states(windows)), Work(), CrossValidation(windows)
    costs = []
    for _ in range(2):
        before = work.simulations
        step, _ = selection_round(base, windows, (), np.random.default_rng(0), work, validation)
        assert step is not None
        assert step.chosen.candidate.cause == "thrust_gain"
        costs.append(work.simulations - before)
    assert costs[0] > 0
    assert costs[1] == 0


@pytest.mark.thorough
def test_parameters_within_their_standard_deviations_are_re_estimated_and_nothing_is_called_missing():
    """The true ship's parameters are drawn with the standard deviations that the file states."""
    record = hidden_record("barge", seed=11, relative_std=0.3, batches=4, samples=200)
    found = diagnose(vessel_of("barge", relative_std=0.3), record)
    assert found.findings == ()
    assert found.verdict.startswith("These data show no error of the model beyond the stated standard deviations")
    assert (found.after.fit > found.before.fit).all()
    stated, refined = found.vessel.model, found.extended.model
    assert (refined.parameter_std < stated.parameter_std).all()
    assert (np.abs(refined.parameters - stated.parameters) < 4.0 * stated.parameter_std).all()
