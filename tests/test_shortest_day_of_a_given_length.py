"""A day of a given length is kept to, tells as much as prices allow, and is refused where the way alone is longer."""

import numpy as np
import pytest

from expdesign.errors import FileError, NoAnswer
from expdesign.scenario import load_scenario
from expdesign.shortest_day import AccuracySettings, alternate, check_way_fits, fullest_day, stated_accuracy
from expdesign.shortest_day.cheapest import cheapest_shares, fullest_level
from expdesign.shortest_day.prices import Offer
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import plan_problem
from expdesign.workflows.steps.scored import scored
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")

STORY = SCENARIOS / "story.toml"
DAY_S = 620.0


@pytest.fixture(scope="module")
def asked():
    case = load_scenario(STORY)
    information = scored(case)
    design = designed(case, information)
    accuracy = stated_accuracy(AccuracySettings(as_durations=True), design, case.vessel)
    return plan_problem(case, information, design, seed=1), accuracy


@pytest.mark.thorough
def test_the_plan_is_no_longer_and_tells_what_it_says(asked, monkeypatch):
    problem, accuracy = asked
    monkeypatch.setattr(alternate, "ROUNDS", 1)
    found = fullest_day(problem, accuracy, DAY_S)
    assert found.plan.verification.passed
    assert found.plan.commands.duration_s <= DAY_S
    assert found.most_s == DAY_S
    fitting = [item.information for item in found.tried if item.day_s <= DAY_S]
    assert found.information == pytest.approx(max(fitting))
    assert found.information == pytest.approx(found.plan.design_efficiency_realised, rel=1e-6)
    parts = found.parts
    assert parts.way_s + parts.runs_s + parts.legs_s == pytest.approx(found.plan.commands.duration_s)
    assert parts.way_s == pytest.approx(457.0, abs=2.0)  # 985.9 m round the islet at 2.15 m/s


def test_a_day_in_which_the_way_alone_does_not_fit_is_refused_with_the_time_that_it_takes(asked):
    problem, _ = asked
    check_way_fits(problem, 460.0)
    with pytest.raises(
        NoAnswer, match=r"design.day_s is 300: the way to the goal alone takes at least 45\d s at 2.15 m/s"
    ):
        check_way_fits(problem, 300.0)


def test_the_largest_level_costs_what_there_is(asked):
    _, accuracy = asked
    d, rng = len(accuracy.prior), np.random.default_rng(2)
    root = rng.normal(size=(6, d, d))
    matrices = accuracy.samples * root @ root.transpose(0, 2, 1)
    offer = Offer(
        matrices=matrices,
        cost_s=rng.uniform(50.0, 150.0, 6),
        saved_s=np.zeros(6),
        way_s=0.0,
        known=0.3 * matrices[0],
        fewest=np.zeros(6),
        most=np.full(6, 200.0),
    )
    level = fullest_level(accuracy, offer, 800.0)
    assert cheapest_shares(accuracy, offer, level=level).bound_s <= 800.0
    assert cheapest_shares(accuracy, offer, level=level + 0.05).bound_s > 800.0


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (
            "day_s = 600.0\n[design.accuracy]\nas = 'durations'",
            r"design.day_s: is given beside \[design.accuracy\], expected",
        ),
        ("day_s = 0.1", r"design.day_s: is 0.1, expected .* two samples, to 1000000, eleven days"),
        ("day_s = -5.0", r"design.day_s: is -5, expected more than 0"),
        ("day_s = 'long'", r"design.day_s: is 'long', expected"),
    ],
)
def test_a_wrong_length_is_one_line_with_the_key(tmp_path, more, says):
    text = STORY.read_text("utf-8").replace('criterion = "D"\n', f'criterion = "D"\n{more}\n', 1)
    text = text.replace('mean_subtraction = "complete"\n', "", 1)
    for folder in ("vessels", "dictionaries", "areas"):
        text = text.replace(f'"{folder}/', f'"{STORY.parent}/{folder}/')
    (tmp_path / "story.toml").write_text(text, "utf-8")
    with pytest.raises(FileError, match=says):
        load_scenario(tmp_path / "story.toml")
