"""`new` makes a folder of each kind whose trial is planned and verified, and says what acts in it and what does not."""

import json
import re
import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.dictionary import build_primitive
from expdesign.errors import NoAnswer, NoPlan
from expdesign.indices import Stop, measured_trial
from expdesign.scenario import Scenario, load_scenario, load_vessel
from expdesign.simulation import Environment, simulate
from expdesign.vessel import UNSTATED_SHARE
from expdesign.workflows import new, scored
from expdesign.workflows.commands.new import KINDS
from expdesign.workflows.steps import day
from expdesign.workflows.steps.first_trial import (
    ABLE,
    DRAWN,
    NEAR_HULLS,
    calibration,
    first_note,
    half_as_wide,
    is_wide,
    legs_for_most,
)
from expdesign.workflows.steps.scored import actuation_remarks, speed_remarks
from measured_trials import as_batch


@pytest.mark.parametrize("kind", KINDS)
def test_a_folder_of_each_kind_is_whole_and_its_own(kind: str, tmp_path: Path) -> None:
    folder = tmp_path / "mytrial"
    paths = new(folder, kind=kind).files
    assert {path.name for path in paths} == {path.name for path in folder.iterdir()}
    case = load_scenario(folder / "scenario.toml")
    assert case.name == "mytrial"
    assert case.remarks == ()  # everything stated acts, and nothing is taken as certain
    assert len((folder / "README.md").read_text("utf-8").splitlines()) <= 12
    width_m, height_m = np.diff(np.reshape(case.area.water.bounds, (2, 2)), axis=0)[0]
    assert 100 < width_m / case.vessel.length_m < 120  # room of the same size for every ship
    assert 100 < height_m / case.vessel.length_m < 120


def test_commands_that_are_shown_can_be_typed_whatever_the_folder_is_called(tmp_path: Path) -> None:
    folder = tmp_path / "Fahrt 1 + 2"
    outcome = new(folder)
    (then,) = (value for key, value in outcome.document.facts.items() if key == "then")
    assert shlex.split(then) == ["expdesign", "run", str(folder / "scenario.toml")]
    shown = re.findall("`(expdesign .*?)`", (folder / "README.md").read_text("utf-8"))
    words = [word for line in shown for word in shlex.split(line)]
    named = [word for word in words if "Fahrt" in word]
    assert named == [f"{folder.name}/{name}.toml" for name in ("scenario", "vessel")]


@pytest.mark.parametrize("kind", KINDS)
def test_candidates_of_each_kind_tell_of_every_parameter(kind: str, tmp_path: Path) -> None:
    case = load_scenario(new(tmp_path / kind, kind=kind).files[0])
    whole = sum(item.X for item in scored(case))
    scale = np.sqrt(np.diag(whole))
    assert np.linalg.eigvalsh(whole / np.outer(scale, scale))[0] > 1e-6


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "asv"])
def test_stops_of_each_kind_are_stops_of_drawn_ships_in_a_cross_current(kind: str, tmp_path: Path) -> None:
    """95 %, within four standard errors, in 0.3 m/s at the coaster's speed; none lay still after times once stated."""
    case, count = load_scenario(new(tmp_path / kind, kind=kind).files[0]), 60
    ship, rng = case.vessel, np.random.default_rng(3)
    (spec,) = (one for one in case.dictionary if one.family == "crash_stop")
    run = build_primitive(ship, spec)
    across, found = Environment(current_to=(0.0, 0.075 * spec.settings["speed_mps"])), []
    for values in ship.model.drawn_parameters(count, rng):
        other = replace(ship, model=ship.model.with_parameters(values))
        start = {"velocity": run.entry_velocity, "standing": run.entry_inputs}
        found.append(measured_trial(other, as_batch(other, run.commands, simulate(
            other, run.commands, environment=across, **start
        ))))  # fmt: skip
    stopped = np.mean([isinstance(one, Stop) for one in found])
    assert stopped > 0.95 - 4 * np.sqrt(0.95 * 0.05 / count)


def test_a_folder_that_exists_and_a_kind_that_does_not_are_refused(tmp_path: Path, capsys) -> None:
    there = tmp_path / "there"
    there.mkdir()
    assert main(["new", str(there), "--quiet"]) == 2
    assert "exists, expected the name of a folder to be made" in capsys.readouterr().err
    assert list(there.iterdir()) == []
    assert main(["new", str(tmp_path / "half & half"), "--quiet"]) == 2
    assert "the folder's name is the scenario's and is 'half & half', expected at most 80" in capsys.readouterr().err
    assert not (tmp_path / "half & half").exists()
    assert main(["new", str(tmp_path / "other"), "--kind", "submarine", "--quiet"]) == 2
    assert "submarine" in (said := capsys.readouterr().err)
    assert all(kind in said for kind in KINDS)
    assert not (tmp_path / "other").exists()


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_trial_of_each_kind_is_verified(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "mytrial", "--kind", kind, "--quiet"]) == 0
    assert main(["run", "mytrial/scenario.toml", "--quiet"]) == 0
    plan = json.loads(Path("runs/mytrial/plan.json").read_text("utf-8"))
    assert plan["verified"] is True


@pytest.mark.slow
def test_what_follows_a_trial_works_with_terms_that_read_actuators(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Simulated with the file's own ship, whose parameters are found within five standard errors."""
    monkeypatch.chdir(tmp_path)
    vessel, plan, data = "mytrial/vessel.toml", "runs/mytrial/plan.json", "runs/sailed/measured.csv"
    for command in (
        "new mytrial --kind propeller-rudder",
        "run mytrial/scenario.toml",
        f"simulate {plan} --truth {vessel} --out runs/sailed",
        f"estimate {data} --vessel {vessel} --method ls iv oe --out runs/estimate",
        f"diagnose {data} --vessel {vessel} --out runs/diagnosis",
        f"indices {data} --vessel {vessel} --out runs/indices",
        f"foresee mytrial/scenario.toml --plan {plan} --out runs/foresight",
    ):
        assert main([*command.split(), "--quiet"]) == 0, command
    true, found = load_vessel(vessel).model, load_vessel("runs/estimate/vessel-estimated.toml").model
    assert (np.abs(found.parameters - true.parameters) < 5 * found.parameter_std).all()
    assert found.speeds_mps is not None
    assert found.speeds_mps[1] > found.speeds_mps[0]
    assert found.missed is not None  # her own structure, so that unseen runs are missed by what noise does
    assert 0.0 < found.missed.turn_share < 0.05


def test_ships_differ_in_what_nobody_stated_and_the_file_can_say_that_they_do_not(tmp_path: Path) -> None:
    new(tmp_path / "trial", kind="asv")
    path = tmp_path / "trial" / "vessel.toml"
    head, _, rest = path.read_text("utf-8").partition("[model.parameter_std]\n")
    rest = rest[rest.index("\n#") :]
    path.write_text(head + "[model.parameter_std]\nX_vr = 0.0\n" + rest, "utf-8")
    model, rng = load_vessel(path).model, np.random.default_rng(0)
    drawn = model.drawn_parameters(4000, rng)
    spread = np.where(np.array(model.names) == "X_vr", 0.0, UNSTATED_SHARE) * np.abs(model.parameters)
    assert np.allclose(drawn.std(axis=0), spread, rtol=5 / np.sqrt(2 * 4000), atol=1e-9)
    assert not model.parameter_std.any()  # estimates and designs take nothing from it
    remarks = load_scenario(tmp_path / "trial" / "scenario.toml").remarks
    assert [line for line in remarks if line.startswith("exactly known") and line.endswith("X_vr")]
    assert [line for line in remarks if line.startswith("no model.parameter_std of") and "X_vr" not in line]
    path.write_text(head.replace('form = "continuous"', 'form = "continuous"\nparameter_std_unstated = 0.0') + rest)
    assert not np.ptp(load_vessel(path).model.drawn_parameters(5, rng), axis=0).any()


def test_a_thruster_that_no_candidate_uses_and_limits_far_off_are_named(tmp_path: Path) -> None:
    case = load_scenario(new(tmp_path / "trial").files[0])
    ahead = [item for item in case.dictionary if item.family in ("crash_stop", "acceleration")]  # to rounding
    commands = [item.primitive.commands for item in scored(replace(case, dictionary=tuple(ahead)))]
    (idle,) = [line for line in actuation_remarks(case.vessel, commands, "candidate") if "uses" in line]
    assert idle == "no candidate uses n3_rps"
    half = [replace(each, values=0.4 * each.values) for each in commands]
    (far,) = [line for line in actuation_remarks(case.vessel, half, "candidate") if "far from its limit" in line]
    assert "n1_rps" in far
    assert "n3_rps" not in far


@pytest.mark.thorough
def test_speeds_beyond_those_of_the_data_are_named(tmp_path: Path) -> None:
    new(tmp_path / "trial")
    path = tmp_path / "trial" / "vessel.toml"
    text = path.read_text("utf-8")
    for high, told in ((6.0, False), (2.0, True)):
        stated = f'form = "continuous"\nspeeds_mps = [-1.0, {high}]'
        path.write_text(text.replace('form = "continuous"', stated), "utf-8")
        case = load_scenario(tmp_path / "trial" / "scenario.toml")
        tracks = [item.primitive.trajectory for item in scored(case)]
        assert max(track.velocity[:, 0].max() for track in tracks) > 2.2
        assert bool(speed_remarks(case.vessel, tracks, "candidate")) is told


@pytest.mark.thorough
def test_most_ships_of_a_wide_prior_reach_the_speed_and_the_turn_of_a_first_trials_legs(tmp_path: Path) -> None:
    """Other ships, drawn anew: full ahead they are faster than legs on a straight course, and so than all runs."""
    case = load_scenario(new(tmp_path / "trial", kind="propeller-rudder").files[0])
    model = case.vessel.model
    wide = replace(model, parameter_std=0.4 * np.abs(model.parameters))
    usual, case = case.plan, replace(case, vessel=replace(case.vessel, model=wide))
    asked = replace(case, plan=replace(usual, transit_speed_mps=2.0))
    assert legs_for_most(asked, np.random.default_rng(0)).transit_speed_mps == 2.0  # what a file states stays
    legs = legs_for_most(case, np.random.default_rng(0))
    known = legs_for_most(replace(case, vessel=replace(case.vessel, model=model)), np.random.default_rng(0))
    assert legs.transit_speed_mps < 0.8 * known.transit_speed_mps
    assert legs.turning_radius_m > 1.2 * known.turning_radius_m
    drawn, u = wide.drawn_parameters(2000, np.random.default_rng(1)), legs.transit_speed_mps
    full = [max(limit.high for limit in case.vessel.limits[:1]), 0.0]
    surge = wide.accelerations((u, 0.0, 0.0), (u, 0.0), full, parameters=drawn.T)[0]
    assert np.mean(surge > 0.0) > ABLE - 4 * np.sqrt(ABLE * (1 - ABLE) / DRAWN)  # of the speed's own draws


def test_legs_of_a_prior_that_is_far_too_wide_are_finite_or_refused(tmp_path: Path) -> None:
    """Some ships of it never turn, and of others the thrust is negative: a mean over them is no number."""
    case = load_scenario(new(tmp_path / "trial", kind="asv").files[0])
    model = case.vessel.model
    wide = replace(model, parameter_std=20.0 * model.parameter_std)
    case = replace(case, vessel=replace(case.vessel, model=wide))
    for seed in range(4):
        legs = legs_for_most(case, np.random.default_rng(seed))
        assert 0.0 < legs.transit_speed_mps < np.inf
        assert 0.0 < legs.turning_radius_m < np.inf
    unbounded = replace(case, vessel=replace(case.vessel, model=replace(wide, parameter_range={})))
    with pytest.raises(NoAnswer, match="make no way"):
        legs_for_most(unbounded, np.random.default_rng(0))


@pytest.mark.thorough
def test_a_first_trial_keeps_ships_of_a_wide_prior_near_its_tracks(tmp_path: Path) -> None:
    """Runs are cut to the time that most ships stay near; other ships, drawn anew, do as well."""
    from expdesign.dictionary import build_primitive
    from expdesign.plan.runs import dispersion_m
    from expdesign.vessel.vessel import covering_discs

    case = load_scenario(new(tmp_path / "trial", kind="asv").files[0])
    assert not is_wide(case.vessel.model)
    model = case.vessel.model
    wide = replace(model, parameter_std=0.4 * np.abs(model.parameters))
    assert is_wide(wide)
    case = replace(case, vessel=replace(case.vessel, model=wide))
    first = calibration(case, seed=1)
    asked = {spec.name: spec.settings["duration_s"] for spec in case.dictionary}
    assert 0 < len(first.dictionary) <= len(asked)
    assert any(spec.settings["duration_s"] < asked[spec.name] for spec in first.dictionary)
    centres, _ = covering_discs(case.vessel.length_m, case.vessel.beam_m)
    for spec in first.dictionary:
        apart = dispersion_m(
            case.vessel,
            build_primitive(case.vessel, spec),
            case.environment,
            centres_m=centres,
            confidence=0.8,
            rng=np.random.default_rng(7),
            draws=300,
        )
        assert apart[-1] <= 1.1 * NEAR_HULLS * case.vessel.length_m


@pytest.mark.parametrize("kind", KINDS)
def test_drawn_ships_of_a_wide_prior_are_driven_and_steered_to_the_side_of_the_nominal_one(
    kind: str, tmp_path: Path
) -> None:
    model = load_vessel(new(tmp_path / "trial", kind=kind).files[-1].parent / "vessel.toml").model
    wide = replace(model, parameter_std=0.5 * np.abs(model.parameters))
    drawn = wide.drawn_parameters(500, np.random.default_rng(0))
    pushes = [index for index, name in enumerate(wide.names) if name in wide.parameter_range]
    assert len(pushes) >= 7
    assert (drawn[:, pushes] * wide.parameters[pushes] >= 0.0).all()


def test_the_draft_of_a_first_trial_tries_no_other_prior(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A draft is never verified; what comes of ships that differ half as much is told where it is refused."""
    case = load_scenario(new(tmp_path / "trial", kind="asv").files[0])
    tried = []

    def calibrated(first: Scenario, *_) -> day.Day:
        tried.append(first)
        plan = SimpleNamespace(verified=False, draft=case.plan.draft)
        return day.Day(information=(), design=None, plan=plan, note="a first trial")

    def refused_once(first: Scenario, *_) -> day.Day:
        if not tried:
            tried.append(first)
            raise NoPlan("no way", place=(1.0, 2.0))
        return calibrated(first)

    monkeypatch.setattr(day, "whole_trial", lambda *_: None)
    monkeypatch.setattr(day, "plan_problem", lambda *_, **__: None)
    monkeypatch.setattr(day, "_calibrated", calibrated)
    for draft in (True, False):
        case, tried = replace(case, plan=replace(case.plan, draft=draft)), []
        wide = replace(case.vessel.model, parameter_std=0.5 * np.abs(case.vessel.model.parameters))
        case = replace(case, vessel=replace(case.vessel, model=wide))
        note = day.planned_day(case, (), None).note
        assert len(tried) == (1 if draft else 2)
        assert ("half the standard deviations" in note) is not draft
        tried = []
        monkeypatch.setattr(day, "_calibrated", refused_once)
        told = "parameter_std) a first trial is drafted" if draft else "do not help either"
        with pytest.raises(NoPlan, match=re.escape(told)) as caught:
            day.planned_day(case, (), None)
        assert caught.value.place == (1.0, 2.0)
        assert told in caught.value.remedies[0]
        monkeypatch.setattr(day, "_calibrated", calibrated)


def test_half_as_wide_a_prior_has_half_the_deviations_also_where_none_is_stated(tmp_path: Path) -> None:
    case = load_scenario(new(tmp_path / "trial", kind="asv").files[0])
    model = replace(case.vessel.model, unstated_std={"X_vr": 0.5})
    model = replace(model, parameter_std=np.where(np.array(model.names) == "X_vr", 0.0, model.parameter_std))
    case = replace(case, vessel=replace(case.vessel, model=model))
    np.testing.assert_allclose(half_as_wide(case).vessel.model.drawn_std, model.drawn_std / 2)


def _with_values(path: Path, table: str, values: dict[str, float]) -> None:
    """Other values in a table of a vessel file."""
    head, _, rest = path.read_text("utf-8").partition(f"[model.{table}]\n")
    rest = rest[rest.index("\n[") :]
    rows = "".join(f"{name} = {value!r}\n" for name, value in values.items())
    path.write_text(f"{head}[model.{table}]\n{rows}{rest}", "utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.3, 0.5])
def test_from_a_wide_prior_by_a_first_trial_to_the_whole_plan(
    share: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The true ship is drawn from the wide prior; the first trial narrows it, and the rest is planned and verified."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "wide", "--kind", "propeller-rudder", "--quiet"]) == 0
    path = Path("wide/vessel.toml")
    model = load_vessel(path).model
    stated = dict(zip(model.names, (share * np.abs(model.parameters)).tolist(), strict=True))
    _with_values(path, "parameter_std", stated)
    assert main(["run", "wide/scenario.toml", "--out", "first", "--quiet"]) == 0
    plan = json.loads(Path("first/plan.json").read_text("utf-8"))
    assert plan["verified"] is True
    model = load_vessel(path).model
    drawn = model.drawn_parameters(1, np.random.default_rng(1))[0]
    shutil.copy(path, "wide/true.toml")
    _with_values(Path("wide/true.toml"), "parameters", dict(zip(model.names, drawn.tolist(), strict=True)))
    for command in (
        "simulate first/plan.json --truth wide/true.toml --out sailed",
        "estimate sailed/measured.csv --vessel wide/vessel.toml --method oe --out estimate",
        "replan wide/scenario.toml --data sailed/measured.csv --vessel estimate/vessel-estimated.toml --remaining 640 "
        "--stopped --out rest",
    ):
        assert main([*command.split(), "--quiet"]) == 0, command
    found = load_vessel("estimate/vessel-estimated.toml").model
    assert np.median(found.parameter_std / np.abs(found.parameters)) < 0.5 * share
    assert json.loads(Path("rest/plan.json").read_text("utf-8"))["verified"] is True


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["azimuth", "twin-screw", "asv"])
def test_a_wide_prior_of_each_kind_has_a_verified_trial(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """31 to 61 s of processor each."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "wide", "--kind", kind, "--quiet"]) == 0
    model = load_vessel("wide/vessel.toml").model
    stated = dict(zip(model.names, (0.4 * np.abs(model.parameters)).tolist(), strict=True))
    _with_values(Path("wide/vessel.toml"), "parameter_std", stated)
    assert main(["run", "wide/scenario.toml", "--out", "first", "--quiet"]) == 0
    assert json.loads(Path("first/plan.json").read_text("utf-8"))["verified"] is True


def test_the_note_on_a_first_trial_counts_the_runs_that_it_slows(tmp_path: Path) -> None:
    asked = load_scenario(new(tmp_path / "trial", kind="asv").files[0]).dictionary
    slower = [
        replace(spec, settings={k: v / 2 if k.endswith("speed_mps") else v for k, v in spec.settings.items()})
        for spec in asked
    ]
    count = sum(one.settings != other.settings for one, other in zip(slower, asked, strict=True))
    assert count > 0
    assert "slower than asked" not in first_note(asked, asked)
    assert f"({count} of them slower than asked" in first_note(slower, asked)
