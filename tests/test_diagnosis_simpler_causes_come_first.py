"""Of causes that explain as much, one with fewer numbers comes first, and as little work as will do decides it."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.causes.candidate import Candidate
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit.cross_validation import CrossValidation
from expdesign.diagnosis.fit.held_out import HeldOut
from expdesign.diagnosis.motion.simulation import initial_states
from expdesign.diagnosis.select import forward_selection
from expdesign.diagnosis.select.backward_elimination import improves_held_out
from expdesign.diagnosis.select.forward_selection import select_forward
from expdesign.diagnosis.select.selection_round import (
    NEARLY_AS_MUCH,
    _best_on_held_out,
    simplest,
)
from expdesign.diagnosis.select.shortlist import ABOUT_AS_LIKELY
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.progress import Estimated, silent
from held_out_cases import added, errors, steps_of


@pytest.mark.thorough
def test_a_block_of_parameters_is_replaced_by_the_one_effect_behind_it(monkeypatch):
    """While a change during the trial is unknown, a heavier ship looks like a block of yaw parameters."""
    effects = {"load_r": 0.35, "change_s": 350.0, "change_gain": 0.25}
    record = hidden_record("barge", seed=44, batches=4, samples=150, effects=effects)
    extended = extended_model(vessel_of("barge"), record)
    windows = cut_windows(extended.model, record)
    block = Candidate(cause="parameters", free={f"theta:{name}": 0.0 for name in ("N_r", "N_uv", "N_mu")})
    change = Candidate(cause="change_point", free={"change:gain": 0.0}, fixed={"change:time": 350.0})
    start = initial_states(windows)
    rounds = iter((block, change))
    real = select_forward.__globals__["selection_round"]

    def scripted(base, windows, rejected, rng, work, validation, *, most=99):
        if most < 99:
            return None, ()
        candidate = next(rounds, None)
        if candidate is not None:
            return added(base, windows, candidate), ()
        return real(base, windows, rejected, rng, work, validation)

    monkeypatch.setitem(select_forward.__globals__, "selection_round", scripted)
    found = select_forward(
        extended, windows, start, np.random.default_rng(0), Estimated(silent), CrossValidation(windows)
    )
    causes = {step.chosen.candidate.cause for step in found.steps}
    assert {"change_point", "load_change"} <= causes
    assert "parameters" not in causes
    assert abs(found.last.value("inertia:r") - 0.35) < 3 * found.last.std("inertia:r") + 0.01


def test_a_cause_with_fewer_numbers_comes_before_one_that_imitates_many():
    """If it explains nearly as much; a candidate that imitates nothing keeps its place."""

    def item(gain: float, count: int, *, imitates: bool = False) -> SimpleNamespace:
        return SimpleNamespace(
            likelihood_gain=gain, keys=tuple(range(count)), candidate=SimpleNamespace(imitates=imitates)
        )

    wind, block = item(100.0, 3, imitates=True), item(100.0, 3)
    near, far = (item(share * 100.0 * NEARLY_AS_MUCH, 1) for share in (1.01, 0.99))
    assert simplest([wind, near]) is near
    assert simplest([wind, far, near]) is near
    assert simplest([wind, far]) is wind
    assert simplest([wind, item(99.0, 3)]) is wind
    assert simplest([block, near]) is block


def test_a_cause_with_fewer_numbers_comes_first_where_it_simulates_held_out_data_better():
    """By more than a point, or by less where it is about as likely; one of the same cause is no rival.

    One with as many numbers is a rival where it is about as likely, and comes first where it is better by a point for
    certain. Any other comes first where it leaves a fifth less unexplained. Of the same cause only one with fewer
    numbers is a rival, where it is about as likely.
    """
    about, less = (100.0 * (ABOUT_AS_LIKELY + more) for more in (0.01, -0.01))

    def item(cause: str, numbers: int, fit_percent: np.ndarray | float, gain: float) -> SimpleNamespace:
        candidate = Candidate(cause=cause, free={})
        return SimpleNamespace(candidate=candidate, numbers=numbers, fit=fit_percent, likelihood_gain=gain)

    validation = SimpleNamespace(of=errors)
    wind = item("wind", 3, 60.0, 100.0)
    for numbers, gain, fit_percent, better in (
        (1, less, 60.5, False),
        (1, less, 61.5, True),
        (1, about, 58.5, False),
        (1, about, 59.5, True),
        (3, less, 67.5, False),
        (3, less, 68.5, True),
        (3, about, 60.5, False),
        (3, about, 61.5, True),
        (4, about, 67.5, False),
        (4, about, 68.5, True),
    ):
        rival = item("actuator_scale", numbers, fit_percent, gain)
        accepted = [wind, item("wind", 1, 90.0, less), item("current", 3, 64.0, less), rival]
        chosen = _best_on_held_out(wind, accepted, validation)  # type: ignore[arg-type,list-item]
        assert chosen is (rival if better else wind)
    apart = np.array([[-9.0], [-9.0], [-9.0], [9.0], [9.0], [9.0]])  # better on average, and perhaps not
    for numbers, better in ((1, True), (3, False), (4, False)):
        rival = item("actuator_scale", numbers, 66.0 + apart, about)
        assert (_best_on_held_out(wind, [wind, rival], validation) is rival) == better  # type: ignore[arg-type,list-item]
    one = item("wind", 1, 59.5, about)
    for fewer in (item("wind", 3, 90.0, about), item("wind", 1, 58.5, about), one):
        assert (_best_on_held_out(wind, [wind, fewer], validation) is fewer) == (fewer is one)  # type: ignore[arg-type,list-item]


@pytest.mark.parametrize(("fits", "tried"), [((60.0, 70.0, 80.0, 85.0), 4), ((60.0, 60.05, 80.0, 85.0), 2)])
def test_smaller_causes_beside_a_block_end_where_one_improves_nothing_held_out(monkeypatch, fits, tried):
    """As the search itself does; the first is not asked."""
    asked = iter(steps_of(*fits).steps)
    search = SimpleNamespace(
        validation=SimpleNamespace(of=errors), round=lambda _base, most: (next(asked, None), ())
    )  # fmt: skip
    block = SimpleNamespace(chosen=SimpleNamespace(keys=("a", "b", "c", "d"), fit=50.0), before=50.0)
    monkeypatch.setattr(forward_selection, "log_likelihood_gain", lambda *_: 100.0)
    path = forward_selection._smaller_causes(block, search)  # type: ignore[arg-type]
    assert [step.chosen.fit for step in path] == [*fits[:tried]]


def test_stretches_are_not_simulated_for_what_is_ruled_out_already():
    """A later cause whose whole runs gain nothing; one that gains without certainty is asked in stretches."""
    spread = np.array([[-9.0], [-9.0], [-9.0], [12.0], [12.0], [12.0]])
    for later, asked in ((55.0, False), (72.0 + spread, True)):
        calls = list[str]()

        def ahead(fit_percent: float, calls: list[str] = calls) -> HeldOut:
            calls.append("")
            return errors(fit_percent)

        held = [replace(errors(value), ahead=partial(ahead, 60.0)) for value in (50.0, 70.0, later)]
        improves_held_out(steps_of("first", "later"), held, 0)
        assert bool(calls) is asked
