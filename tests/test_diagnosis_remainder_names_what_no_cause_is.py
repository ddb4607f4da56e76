"""What no cause of the catalogue is gets a name: a term with its size, or the kind of what is missing."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from beyond_catalogue import CASES, slower_at_low_speed, trial, ventilated
from expdesign.diagnosis import diagnose
from expdesign.diagnosis.fit import CrossValidation, Fit, continuing, fit, linear_model
from expdesign.diagnosis.motion import initial_states, stable_windows
from expdesign.diagnosis.remainder import missing_effects, search, with_unlisted_terms
from expdesign.diagnosis.remainder.search import UNLISTED
from expdesign.diagnosis.remainder.stability_selection import UnitInformation, greedy, stable_selection, term_dictionary
from expdesign.diagnosis.select import Selection, fit_nuisance, open_candidates, score_tests
from expdesign.diagnosis.vessel_file import extend, extended_model
from expdesign.signals import Record
from expdesign.vessel import Vessel

SHORT = {"runs": 4, "samples": 200}


def fitted(vessel: Vessel, record: Record) -> Fit:
    ship = extended_model(vessel, record)
    windows = stable_windows(ship, record)
    return fit_nuisance(ship, windows, initial_states(windows))


def planted(seed: int, size: float, count: int = 40, units: int = 10) -> UnitInformation:
    """White noise regressed on columns of which only the first two act."""
    rng = np.random.default_rng(seed)
    X = rng.standard_normal((units, 300, count))
    y = size * (X[..., 0] - X[..., 1]) + rng.standard_normal((units, 300))
    return UnitInformation(
        A=np.einsum("wki,wkj->wij", X, X), s=np.einsum("wki,wk->wi", X, y), precision=np.zeros((0, 0)),
        offset=np.zeros(0),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_the_regressors_that_act_are_chosen_and_no_others(seed: int):
    found = stable_selection(planted(seed, 0.2), np.random.default_rng(seed))
    assert {item.index for item in found} == {0, 1}
    assert stable_selection(planted(seed, 0.0), np.random.default_rng(seed)) == ()


def test_the_first_step_of_matching_pursuit_explains_most():
    given = planted(0, 0.2)
    A, s = given.beside_nuisance(np.ones(10, dtype=bool))
    index, statistic = greedy(A, s)[0]
    assert statistic == pytest.approx((s**2 / np.diag(A)).max())
    assert index == int(np.argmax(s**2 / np.diag(A)))


def test_nuisance_effects_are_projected_out():
    """A regressor that a free nuisance effect equals has no information left."""
    whole = planted(0, 0.2)
    same = UnitInformation(A=whole.A, s=whole.s, precision=np.zeros((1, 1)), offset=np.zeros(1))
    A, s = same.beside_nuisance(np.ones(10, dtype=bool))
    doubled = np.block([[whole.A.sum(0)[:1, :1], whole.A.sum(0)[:1]], [whole.A.sum(0)[:, :1], whole.A.sum(0)]])
    twice = UnitInformation(
        A=doubled[None], s=np.concatenate([whole.s.sum(0)[:1], whole.s.sum(0)])[None], precision=np.zeros((1, 1)),
        offset=np.zeros(1),
    )  # fmt: skip
    left, score = twice.beside_nuisance(np.ones(1, dtype=bool))
    assert left[0, 0] == 0.0
    assert not left[0].any()  # numbers of rounding would overflow once they are divided by their size
    assert not score[0]
    assert np.allclose(left[1:, 1:], A)
    assert np.allclose(score[1:], s)


def test_a_dictionary_has_no_term_twice():
    vessel, record = trial("barge", 0, runs=1, samples=60)
    ship = extended_model(vessel, record)
    terms = term_dictionary(ship.model, ship.library)
    texts = [(term.equation, term.expression) for term in terms.values()]
    assert len(set(texts)) == len(texts)
    assert ("r", "u*r*abs(r)") in texts
    assert ("r", "u*v") not in texts  # the model has it


@pytest.mark.parametrize("ship", ["barge", "coaster"])
def test_nothing_is_missing_where_nothing_is_hidden(ship: str):
    base = fitted(*trial(ship, 3, **SHORT))
    assert missing_effects(base, base.linear.motion.windows, np.random.default_rng(0)) == ()


@pytest.mark.parametrize(
    ("case", "words", "size"),
    [
        (("barge", {"drift": 1.5e-3}), "time stamps", 1.5e-3),
        (("tug", {"alter": ventilated}), "less effect of n above", 0.8),
        (("barge", {"effects": {"bank_sway": 0.02, "bank_yaw": -0.0015}}), "a steady", None),
    ],
)
def test_kinds_are_named_with_their_size(case: tuple[str, dict], words: str, size: float | None):
    base = fitted(*trial(case[0], 0, **case[1], **SHORT))
    found = missing_effects(base, base.linear.motion.windows, np.random.default_rng(0))[0]
    assert found.term is None
    assert words in found.words
    assert size is None or abs(found.value - size) < 4.0 * found.std


@pytest.mark.thorough
def test_a_lag_that_changes_with_speed_is_named_beside_its_mean():
    """12 s at rest, 3 s less for each m/s."""
    vessel, record = trial("coaster", 0, alter=slower_at_low_speed, runs=6, samples=300)
    base = fitted(vessel, record)
    windows = base.linear.motion.windows
    ship = base.ship.with_effects({"lag:rudder": 2.0})
    lagging = fit(ship, windows, ("lag:rudder",), starts=base.starts, options=continuing(base))
    (found, *_) = missing_effects(lagging, windows, np.random.default_rng(0))
    assert found.words == "a lag of rudder that changes with speed"
    assert found.value < -4.0 * found.std


@pytest.mark.thorough
def test_what_is_found_does_not_depend_on_how_many_windows_are_taken_at_once(monkeypatch):
    base = fitted(*trial("tug", 0, alter=ventilated, **SHORT))
    windows = base.linear.motion.windows

    def found() -> tuple[list[float], list[float]]:
        tests = score_tests(base, open_candidates(base, windows)[::4])
        missing = missing_effects(base, windows, np.random.default_rng(0))
        return sorted(item.statistic for item in tests), [item.value for item in missing]

    together = found()
    monkeypatch.setattr(linear_model, "SENSITIVITIES_AT_ONCE", 700_000)
    for one, other in zip(together, found(), strict=True):
        assert one == pytest.approx(other, rel=1e-6)


@pytest.mark.thorough
def test_a_term_that_no_cause_is_gets_into_the_vessel_file():
    """A yaw damping like u r |r|; the model with it simulates held-out runs better."""
    true = -1.0
    vessel, record = trial("barge", 0, effects={"N_ur_abs_r": true}, **SHORT)
    base = fitted(vessel, record)
    windows = base.linear.motion.windows
    validation = CrossValidation(windows, record)
    before = validation.without(None, base.ship)
    found = with_unlisted_terms(
        Selection(steps=(), first=base, last=base, last_tests=()), [before], windows, validation, 0
    )
    step = found.kept.steps[0]
    assert step.chosen.candidate.cause.startswith(f"{UNLISTED}:a term like")
    assert found.held[1].fit[2] > before.fit[2] + 5.0
    assert found.kinds == ()
    (key,) = step.chosen.keys
    added = found.kept.last.ship.library[key.split(":")[1]]
    extended, _ = extend(vessel, found.kept.last.ship, {key: found.kept.last.std(key)})
    assert extended.model.terms[-1] == added
    assert added.equation == "r"
    assert "r" in added.expression


@pytest.mark.parametrize("remains", [True, False])
def test_what_an_uncertain_cause_explains_as_well_is_not_named_instead_of_it(
    remains: bool, monkeypatch: pytest.MonkeyPatch
):
    """Time stamps that drift, beside a late sensor: named only where they show with that too."""
    drift = SimpleNamespace(words="drift", term=None, share=0.2, chosen=SimpleNamespace(statistic=100.0))
    last, late = object(), object()
    found = {id(last): (drift,), id(late): (drift,) * remains}
    monkeypatch.setattr(search, "missing_effects", lambda base, *_: found[id(base)])
    kept = SimpleNamespace(steps=(), first=last, last=last)
    rest = with_unlisted_terms(kept, [None], None, None, 0, rejected=[late])  # type: ignore[arg-type,list-item]
    assert [item.words for item in rest.kinds] == ["drift"] * remains


@pytest.mark.slow
@pytest.mark.parametrize("name", ["nothing", "bank", "drifting time stamps", "cubic damping", "speed-dependent lag"])
def test_whole_diagnoses_say_what_is_missing(name: str):
    found = diagnose(*CASES[name](0))
    expected = {
        "nothing": "no error of the model", "bank": "a steady",
        "drifting time stamps": "time stamps of the sensors that drift", "cubic damping": "the term N_rrr",
        "speed-dependent lag": "a lag of rudder that changes with speed",
    }  # fmt: skip
    assert expected[name] in " ".join([found.verdict, *found.notes])
