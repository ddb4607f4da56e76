"""A plan is called verified where its checks passed and no more drawn trials were aborted than may be; else nowhere."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from lxml import html

import export_case as case
from expdesign.errors import FileError
from expdesign.export import words
from expdesign.export.cards import cards_html
from expdesign.export.folder import write_files
from expdesign.export.report import page as report_page
from expdesign.export.report import report_html
from expdesign.export.routes import read_plan
from expdesign.plan.values import LegOutcome, Plan, RiskEstimate
from expdesign.scenario import load_scenario
from expdesign.vessel import column_name
from expdesign.workflows.steps.planned import plan_document, trial_remarks
from scenario_files import write_scenario

LIMIT = 0.1
SAID = "{:.4g} % of 500 drawn trials were aborted, above the limit of 10 % (plan.aborted_most)"


def aborted(share: float) -> Plan:
    outcome = LegOutcome(
        left=0.0,
        aborted=0.0,
        go_arounds=0.0,
        median_s=60.0,
        most_s=90.0,
        longest_s=600.0,
        position_m=20.0,
        speed_mps=0.5,
    )
    risk = RiskEstimate(
        trials=500,
        left=0.0,
        left_most=0.006,
        aborted=share,
        reasons=("on the way to run 1, 'ahead', 60.1, 24.9",),
        extra_median_s=60.0,
        extra_most_s=300.0,
        go_arounds=3,
        heading_rad=0.1,
        yaw_rate_radps=0.01,
        legs=(outcome,) * len(case.plan().legs),
        aborted_most=LIMIT,
    )
    return replace(case.plan(), risk=risk, leave_water_probability=0.0)


@pytest.fixture
def _no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages of which only the words are read are not drawn."""
    monkeypatch.setattr(report_page, "_drawn", lambda figures, *, draft: dict.fromkeys(map(id, figures), ""))


@pytest.mark.thorough
@pytest.mark.usefixtures("_no_figures")
@pytest.mark.parametrize("share", [0.0, 0.1, 0.102, 0.49])
def test_report_cards_files_and_terminal_agree_on_the_verdict(tmp_path, share: float) -> None:
    plan, within = aborted(share), share <= LIMIT
    content = case.report_content(plan=plan, remarks=("the wind moves no ship",))
    report, cards = report_html(content), cards_html(content)
    file = json.loads(case.plan_files(plan)["plan.json"])
    document = plan_document(replace(load_scenario(write_scenario(tmp_path)), vessel=case.tug()), plan)
    head = html.fromstring(report).find_class("verdict")[0]
    assert ("yes" in head.get("class")) is within
    assert ("verified" in head.text_content()) is within
    for told in (report, cards, json.dumps(file, ensure_ascii=False), json.dumps(document.facts, ensure_ascii=False)):
        plain = " ".join(told.split())
        assert (SAID.format(100 * share) in plain) is not within
    rule = f"not reached within {words.duration(600.0)} of the end of the run before."  # as drawn trials are aborted
    assert rule in report
    assert rule in cards
    assert ("Verified by simulation" in cards) is within
    assert file["verified"] is document.facts["verified"] is within
    assert file["drawn_trials"]["aborted_share"] == share
    assert file["drawn_trials"]["aborted_most"] == LIMIT
    (checks,) = html.fromstring(report).xpath("//section[h2='Verification']")
    marks = [mark.get("class") for mark in checks.find_class("mark")]
    assert all("yes" in mark for mark in marks) is within
    assert "Worth knowing: the wind moves no ship." in report


def test_a_plan_often_aborted_can_be_sailed_and_one_that_failed_its_checks_cannot(tmp_path) -> None:
    write_files(tmp_path, case.plan_files(aborted(0.49)))
    path = tmp_path / "plan.json"
    assert read_plan(path).legs == case.plan().legs
    path.write_text(re.sub(r'"aborted_share": 0.49', '"aborted_share": 0.05', path.read_text()), encoding="utf-8")
    with pytest.raises(FileError, match="verified: is false"):
        read_plan(path)


def test_an_actuator_that_a_plan_never_uses_is_named(tmp_path) -> None:
    scenario, plan = replace(load_scenario(write_scenario(tmp_path)), vessel=case.tug()), case.plan()
    columns = [column_name(name) for name in plan.commands.names]
    assert not [line for line in trial_remarks(scenario, plan) if "no run of this plan uses" in line]
    for actuator in case.tug().actuators:
        own = [name in actuator.signals for name in plan.commands.names]
        idle = replace(plan.commands, values=np.where(own, 0.0, plan.commands.values))
        (line,) = [
            line for line in trial_remarks(scenario, replace(plan, commands=idle)) if "no run of this plan uses" in line
        ]
        assert [name in line for name in columns] == own


def test_no_ship_that_left_allowed_water_is_not_told_as_never(tmp_path) -> None:
    """The terminal said 0; the page has said the bound of 95 % confidence beside it."""
    scenario = replace(load_scenario(write_scenario(tmp_path)), vessel=case.tug())
    facts = plan_document(scenario, aborted(0.0)).facts
    assert (facts["leave_water_probability"], facts["leave_water_probability_below"]) == (0.0, 0.006)
