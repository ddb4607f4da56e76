"""A record of a ship with [roll] tells whether she still rolls as her file says, and if not, what changed."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from expdesign.errors import NotInformative
from expdesign.export.roll_changes import RollVerdict, roll_sentences, with_roll
from expdesign.roll.record import RollJudgement, judge_roll
from expdesign.scenario import load_vessel
from expdesign.vessel import NOMINAL, Load, RollPendulum
from expdesign.workflows import diagnose, estimate
from rolling_ship import HIGH, ROLL_MODEL, loaded, measured, roll_model, trial, write_csv

pytestmark = pytest.mark.usefixtures("undrawn")

SHIP = roll_model()
assert SHIP.pendulum is not None
PARAMETERS = SHIP.pendulum.parameters
KNOWN = replace(SHIP.pendulum, parameter_std={})  # a file that is certain
LOST_GM = {"k": PARAMETERS["k"] - 0.2 * KNOWN.righting_nm}  # the metacentric height is less by a fifth
CHANGES: dict[str, tuple[dict[str, float], Load]] = {
    "k": (LOST_GM, NOMINAL),
    "d": ({"d": 1.5 * PARAMETERS["d"]}, NOMINAL),
    "K_delta": ({"K_delta": 0.7 * PARAMETERS["K_delta"]}, NOMINAL),
    "load": ({}, HIGH),
}


@cache
def judged(seed: int, change: str = "", file: RollPendulum = KNOWN, samples: int = 2000) -> RollJudgement | None:
    """None where the record does not tell."""
    values, load = CHANGES.get(change, ({}, NOMINAL))
    truth = replace(SHIP, pendulum=replace(KNOWN, parameters={**PARAMETERS, **values}))
    try:
        return judge_roll(file, [measured(truth, load, seed, samples)], beam_m=SHIP.beam_m)
    except NotInformative:
        return None


@pytest.mark.thorough
def test_nothing_is_named_where_nothing_changed() -> None:
    """At 1 % a record, two or more of eight have a chance of 0.3 %."""
    told = [judged(seed) for seed in range(9100, 9108)]
    assert sum(one is not None for one in told) >= 6
    assert sum(one is not None and one.changed for one in told) <= 1


@pytest.mark.parametrize("change", CHANGES)
def test_what_changed_is_named_with_its_size(change: str) -> None:
    found = [one for one in (judged(seed, change) for seed in range(9200, 9204)) if one is not None]
    assert len(found) >= 3
    values, load = CHANGES[change]
    for one in found:
        assert one.changed
        best = one.changes[0]
        assert best.causes == (change,)
        truth = values[change] - PARAMETERS[change] if values else load.mass_kg * (load.z_m + PARAMETERS["z_f"])
        assert abs(best.sizes[0] - truth) < 5 * best.stds[0]
        right = replace(KNOWN, parameters={**PARAMETERS, **values}, load=load).righting_nm
        assert best.righting_nm == pytest.approx(right, rel=0.02)


def test_a_change_of_the_path_is_none_of_roll() -> None:
    """Another yaw damping and rudder force move the ship otherwise, and the roll follows as her file says."""
    truth = replace(SHIP, model=SHIP.model.with_parameters({"N_ur": -2.5, "Y_ud": -0.14}))
    for seed in (9301, 9302, 9303):
        found = judge_roll(KNOWN, [measured(truth, NOMINAL, seed, 2000)], beam_m=SHIP.beam_m)
        assert not found.changed


def test_a_file_that_does_not_know_is_not_contradicted() -> None:
    """The file has k to a fifth: a loss of a tenth of k is within what it says, and sharper files notice it."""
    rough = replace(KNOWN, parameter_std={"k": 1.8})
    sharp, open_ = judged(9200, "k"), judged(9200, "k", rough)
    assert sharp is not None
    assert open_ is not None
    assert sharp.changed
    assert not open_.changed


def test_a_load_is_written_into_the_file_as_a_mass_at_a_height() -> None:
    told = judged(9200, "load") or judged(9201, "load")
    assert told is not None
    pendulum = with_roll(SHIP, RollVerdict(judgement=told)).pendulum
    assert pendulum is not None
    assert pendulum.load.mass_kg == pytest.approx(HIGH.mass_kg, rel=0.05)
    assert pendulum.load.z_m == pytest.approx(HIGH.z_m, abs=0.01)
    assert "kg on board at a height of 0.2" in roll_sentences(RollVerdict(judgement=told))[0]


def test_a_run_that_is_too_short_is_left_out() -> None:
    run = measured(SHIP, NOMINAL, 9100, 2000)
    short = replace(run, signals=run.signals[:60])
    one, both = (judge_roll(KNOWN, runs, beam_m=SHIP.beam_m).p_value for runs in ([run], [run, short]))
    assert one == both


def known_file(folder: Path) -> Path:
    """The vessel file without the standard deviations of its roll."""
    path = folder / "ship.toml"
    path.write_text(ROLL_MODEL.read_text().split("[roll.parameter_std]")[0])
    return path


@pytest.mark.thorough
def test_diagnose_names_it_in_page_file_and_vessel(tmp_path: Path) -> None:
    ship = replace(SHIP, pendulum=replace(KNOWN, parameters={**PARAMETERS, **LOST_GM}))
    data = write_csv(tmp_path / "trial.csv", trial(ship, NOMINAL, 9201, samples=1500))
    summary = diagnose([data], tmp_path / "out", vessel=known_file(tmp_path)).summary
    assert str(summary["roll"]).startswith("She does not roll as her file says. What explains it: righting moment")
    told = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert told["findings"] == []
    assert list(told["roll"]["explanations"][0]["causes"]) == ["k"]
    assert "righting moment of the hull, k by" in (tmp_path / "out" / "diagnosis.html").read_text()
    found = load_vessel(tmp_path / "out" / "vessel-extended.toml").pendulum
    assert found is not None
    assert found.parameters["k"] == pytest.approx(LOST_GM["k"], rel=0.02)


@pytest.mark.thorough
def test_estimates_are_those_without_roll_and_say_so(tmp_path: Path) -> None:
    data = write_csv(tmp_path / "trial.csv", trial(loaded(SHIP, HIGH), HIGH, 1, samples=1000))
    plain = tmp_path / "plain.toml"
    plain.write_text(ROLL_MODEL.read_text().split("[roll]")[0])
    with_, without = (
        estimate([data], tmp_path / name, vessel=vessel, methods=["ls"]).document
        for name, vessel in (("with", known_file(tmp_path)), ("without", plain))
    )
    assert with_.values["methods"] == without.values["methods"]
    assert "does not act back on the ship's path" in " ".join(with_.notes)
    assert "act back" not in " ".join(without.notes)
