"""`expdesign trial-result`: what its sentences say follows from the numbers in the files."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import export_case as case
from expdesign.cli import main
from expdesign.export import words
from expdesign.export.files import plan_json, planned_accuracy
from expdesign.export.result_page import CHANCE, Estimated, PlanResult, ResultContent, result_document, run_rows
from expdesign.shortest_day import AccuracySettings
from expdesign.vessel import Actuator, Limit, Response, Sensors, Term


def plan_text(asked: AccuracySettings | None = None) -> str:
    vessel = replace(case.tug(), sensors=Sensors(velocity_mps=0.01, yaw_rate_radps=0.001))
    about = {"vessel": vessel, "environment": case.ENVIRONMENT}
    accuracy = planned_accuracy(case.plan(), case.design().problem, asked=asked, **about)
    return plan_json(case.plan(), scenario="test-sound", clearance_m=case.CLEARANCE_M, accuracy=accuracy, **about)


def estimate_text(plan: dict, *, times: float = 1.0, off: dict[str, float] | None = None, whole: bool = True) -> str:
    """An estimate, `times` as inaccurate as planned, parameters `off` by standard deviations of both uncertainties."""
    key = "std_after" if whole else "std_after_runs"
    values = {}
    for name, one in plan["parameters"].items():
        std = times * one[key]
        shift = (off or {}).get(name, 0.0) * np.hypot(std, one["std_before"] or 0.0)
        values[name] = {"value": one["nominal"] + shift, "std": std}
    legs = [leg for leg in plan["legs"] if leg["kind"] == "primitive"]
    spans = [
        (f"{number:02d}-{leg['name']}.csv", leg["end"]["time_s"] - leg["start"]["time_s"])
        for number, leg in enumerate(legs, start=1)
    ]
    if whole:
        spans = [("trial.csv", plan["legs"][-1]["end"]["time_s"])]
    runs = [{"name": name, "use": "estimation", "samples": round(span)} for name, span in spans]
    ahead = {"iv": {"u": 0.031, "v": 0.2, "r": 0.05, "together": 0.07, "unseen": True}}
    entry = {"title": "instrumental variables", "in_vessel_file": True, "parameters": values, "predictions": ahead,
             "sample_time_s": 1.0, "data": {"runs": runs}}  # fmt: skip
    return json.dumps({"ls": {**entry, "in_vessel_file": False}, "iv": entry})


def contents(plan: dict, estimate: dict) -> ResultContent:
    read = PlanResult.model_validate(plan), Estimated.model_validate(estimate)
    return ResultContent(plan=read[0], estimate=read[1], indices=None)


def told(tmp_path: Path, plan: str, estimate: str, *more: str) -> tuple[dict, str]:
    """result.json, and the text of the page."""
    (tmp_path / "plan.json").write_text(plan)
    (tmp_path / "estimate.json").write_text(estimate)
    call = ["trial-result", str(tmp_path / "plan.json"), "--estimate", str(tmp_path / "estimate.json"), *more]
    assert main([*call, "--quiet"]) == 0
    return json.loads((tmp_path / "result.json").read_text()), (tmp_path / "result.html").read_text()


@pytest.mark.parametrize("whole", [True, False])
def test_estimates_twice_as_inaccurate_as_planned_are_said_to_be(tmp_path: Path, whole: bool) -> None:
    plan = plan_text()
    _, page = told(tmp_path, plan, estimate_text(json.loads(plan), times=2.0, whole=whole))
    assert "are 2 times those planned (median; 2 to 2)" in page
    assert ("The data hold the runs alone" in page) != whole
    assert "No parameter differs from the vessel file" in page
    assert "3.1 % in surge" in page.replace("\N{NO-BREAK SPACE}", " ")


def test_runs_that_are_missing_or_held_out_are_no_data_of_the_estimate() -> None:
    plan = json.loads(plan_text())
    estimate = json.loads(estimate_text(plan, whole=False))["iv"]
    held_out, *used = estimate["data"]["runs"]
    held_out["use"] = "test"
    (note,) = result_document(contents(plan, estimate)).notes
    assert f"from {words.duration(sum(run['samples'] for run in used))} of data" in note


def test_an_accuracy_asked_for_is_met_exactly_where_the_estimate_is_as_accurate(tmp_path: Path) -> None:
    first, second = case.design().problem.parameters[:2]
    free = json.loads(plan_text())["parameters"]
    asked = AccuracySettings(std={first: 1.1 * free[first]["std_after"], second: 0.9 * free[second]["std_after"]})
    plan = plan_text(asked)
    found, page = told(tmp_path, plan, estimate_text(json.loads(plan)))
    assert {name: one["met"] for name, one in found["parameters"].items() if one["met"] is not None} == {
        first: True, second: False
    }  # fmt: skip
    assert f"1 parameter of 2 as accurate as asked; not {second}." in page
    assert "not all as accurate as asked" in page


def test_a_relative_accuracy_is_a_share_of_the_nominal_value() -> None:
    name = case.design().problem.parameters[0]
    plan = json.loads(plan_text(AccuracySettings(relative_std={name: 0.07})))["parameters"]
    assert plan[name]["std_asked"] == pytest.approx(0.07 * abs(plan[name]["nominal"]))


def test_a_ship_that_is_not_as_her_file_says_is_told_with_both_numbers(tmp_path: Path) -> None:
    plan, name = plan_text(), case.design().problem.parameters[2]
    _, page = told(tmp_path, plan, estimate_text(json.loads(plan), off={name: -6.0}))
    assert f"The ship is not as her file said: {name} is" in page


@pytest.mark.parametrize("key", ["unstated", "doubts"])
def test_what_the_estimate_warns_of_stands_beside_what_is_said_of_the_ship(key: str) -> None:
    """A current that nobody knew of moved parameters by four standard deviations, and the ship was called another."""
    plan, said = json.loads(plan_text()), "The data show a steady current of 0.11 m/s."
    off = {case.design().problem.parameters[2]: -6.0}
    estimate = json.loads(estimate_text(plan, off=off))["iv"]
    (estimate if key == "unstated" else estimate["data"])[key] = [said]
    page = result_document(contents(plan, estimate))
    assert said in page.notes
    (line,) = [line for line in page.findings if "as her file said" in line]
    assert line.startswith("The ship seems not to be")
    assert line.endswith("may be why.")


def test_a_ship_as_her_file_says_is_seldom_called_another() -> None:
    """The rate over draws of prior and noise is at most the stated one, by three standard errors."""
    plan, draws, rng = json.loads(plan_text()), 400, np.random.default_rng(3)
    names = list(plan["parameters"])
    false = 0
    for _ in range(draws):
        off = dict(zip(names, rng.standard_normal(len(names)), strict=True))
        found = result_document(contents(plan, json.loads(estimate_text(plan, off=off))["iv"]))
        false += any("not as her file" in line for line in found.findings)
    assert false / draws <= CHANCE + 3 * np.sqrt(CHANCE * (1 - CHANCE) / draws)
    assert false > 0  # the test can tell


def test_records_of_runs_stand_beside_the_runs_of_the_plan() -> None:
    plan = json.loads(plan_text())
    estimate = json.loads(estimate_text(plan, whole=False))["iv"]
    estimate["data"]["runs"].append({"name": "added.csv", "use": "test", "samples": 90})
    rows = run_rows(contents(plan, estimate))
    spans = [leg["end"]["time_s"] - leg["start"]["time_s"] for leg in plan["legs"] if leg["kind"] == "primitive"]
    assert [row[1:] for row in rows] == [
        *((words.duration(span), words.duration(round(span)), "estimation") for span in spans),
        ("", words.duration(90), "test"),
    ]


def verdict(**changes: object) -> dict[str, object]:
    return {"source": "measured", "run": "06-circle.csv", "side": "port", "index": "advance_m", "name": "advance",
            "value": 120.0, "tolerance": 1.0, "limit": 135.0, "rule": "4.5 L", "met": True} | changes  # fmt: skip


def test_indices_stand_beside_those_of_the_model_to_the_same_side(tmp_path: Path) -> None:
    plan = plan_text()
    rows = [verdict(), verdict(run="07-circle.csv", side="starboard", value=140.0, met=False),
            verdict(source="simulated", run="circle to port", value=118.0),
            verdict(source="simulated", run="circle to starboard", side="starboard", value=119.0)]  # fmt: skip
    path = tmp_path / "indices.json"
    path.write_text(json.dumps({"vessel": case.tug().name, "applies": "", "verdicts": rows}))
    _, page = told(tmp_path, plan, estimate_text(json.loads(plan)), "--indices", str(path))
    assert "1 of 2 measured indices within their limits; not advance in 07-circle.csv." in page
    assert page.index("120 ± 1 m") < page.index("118 m") < page.index("140 ± 1 m") < page.index("119 m")


@pytest.mark.parametrize(
    ("file", "change", "said"),
    [
        ("plan.json", lambda made: made.pop("parameters"), "plan.json: parameters: is missing"),
        ("plan.json", lambda made: made.update(draft=True), "plan.json: draft: is true"),
        ("estimate.json", lambda made: made["iv"]["parameters"].clear(), "estimates no parameter of the plan"),
        ("estimate.json", lambda made: made["iv"].pop("data"), "iv.data: is missing"),
    ],
)
def test_files_that_are_not_of_this_trial_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], file: str, change, said: str
) -> None:
    plan = plan_text()
    texts = {"plan.json": plan, "estimate.json": estimate_text(json.loads(plan))}
    for name, text in texts.items():
        made = json.loads(text)
        if name == file:
            change(made)
        (tmp_path / name).write_text(json.dumps(made))
    call = ["trial-result", str(tmp_path / "plan.json"), "--estimate", str(tmp_path / "estimate.json")]
    assert main([*call, "--out", str(tmp_path / "out")]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


def test_a_thruster_that_stands_still_leaves_its_own_parameter_without_an_accuracy_and_no_other():
    vessel = replace(case.tug(), sensors=Sensors(velocity_mps=0.01, yaw_rate_radps=0.001))
    of_tug = planned_accuracy(case.plan(), case.design().problem, vessel=vessel, environment=case.ENVIRONMENT)
    model = vessel.model
    tunnel = Actuator(kind="tunnel", number=1, limits=(Limit(low=-5, high=5),), responses=(Response(rate=1),))
    more = replace(
        model,
        terms=(*model.terms, Term(equation="v", name="Y_n1", expression="abs(n1)*n1")),
        parameters=np.append(model.parameters, 0.01),
        parameter_std=np.append(model.parameter_std, 0.002),
        actuators=(*model.actuators, tunnel),
    )
    commands = case.plan().commands
    values = np.column_stack([commands.values, np.zeros(len(commands))])
    standing = replace(commands, names=more.inputs, values=values)
    found = planned_accuracy(
        replace(case.plan(), commands=standing),
        replace(case.design().problem, parameters=more.names),
        vessel=replace(vessel, model=more),
        environment=case.ENVIRONMENT,
    )
    assert np.isnan([found.runs[-1], found.track[-1]]).all()
    assert found.runs[:-1] == pytest.approx(of_tug.runs)
    assert found.track[:-1] == pytest.approx(of_tug.track)


def test_thrusters_that_are_always_ordered_alike_leave_only_their_own_parameters_without_an_accuracy():
    """Of a ship with two of each and no run that has them apart, the command ended with a defect."""
    vessel = replace(case.tug(), sensors=Sensors(velocity_mps=0.01, yaw_rate_radps=0.001))
    model, weather = vessel.model, replace(case.ENVIRONMENT, current_std_mps=0.1)
    twice = replace(
        model,
        terms=(*model.terms, Term(equation="u", name="X_again", expression=model.terms[0].expression)),
        parameters=np.append(model.parameters, 0.5 * model.parameters[0]),
        parameter_std=np.append(model.parameter_std, 0.1),
    )
    assert model.terms[0].equation == "u"
    once = replace(model, parameters=np.r_[1.5 * model.parameters[0], model.parameters[1:]])
    of_tug, found = (
        planned_accuracy(
            case.plan(), replace(case.design().problem, parameters=own.names), vessel=replace(vessel, model=own),
            environment=weather,
        )
        for own in (once, twice)
    )  # fmt: skip
    for one, other in ((of_tug.runs, found.runs), (of_tug.track, found.track)):
        assert np.isnan(other[[0, -1]]).all()
        assert other[1:-1] == pytest.approx(one[1:], rel=1e-4)
