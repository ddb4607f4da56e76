"""A trial that cannot be planned is refused at once, and the refusal says what does not fit, where, and by how much."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign.cli import main
from expdesign.dictionary import PrimitiveSpec, build_primitive, complete_settings, family
from expdesign.errors import NoPlan, Unreachable
from expdesign.plan import PlanSettings
from expdesign.plan.assembly import check_current
from expdesign.plan.solve import plan_trial
from expdesign.plan.values import PlanProblem
from expdesign.simulation import CALM, Environment
from expdesign.workflows.commands import run
from helm_case import coaster
from plan_case import acceleration, area, place_in, ship
from scenario_files import SCENARIOS

WIDE = shapely.box(-1000, -1000, 1000, 1000)


def refusal(water: shapely.Geometry, *, start=(0.0, -200.0, 0.0), goal=(0.0, 200.0, 0.0), environment=CALM, **wishes):
    vessel = ship()
    problem = PlanProblem(
        vessel=vessel,
        area=area(water),
        environment=environment,
        settings=PlanSettings(**wishes),
        primitives=(acceleration(vessel),),
        design=SimpleNamespace(problem=SimpleNamespace(names=("go",)), repeats=(2,)),
        start=np.array(start),
        goal=np.array(goal),
    )
    with pytest.raises(NoPlan) as caught:
        plan_trial(problem)
    return str(caught.value)


def test_water_too_small_for_a_run_names_the_run_its_length_and_the_widest_place():
    text = refusal(shapely.box(-55, -55, 55, 55), start=(0.0, -5.0, 0.0), goal=(0.0, 5.0, 0.0))
    assert text.startswith("no room for 'go'")
    told = float(re.search(r"goes up to ([\d.]+) m", text)[1])
    track = acceleration(ship()).trajectory.pose[:, :2]
    assert told == pytest.approx(np.hypot(*(track - track[0]).T).max(), abs=15.0)  # the hull's ends lie ahead of it
    assert "fits nowhere in the water that can be reached" in text
    assert np.hypot(*place_in(text)) < 15.0  # the middle of the square
    assert "no single change of those tried helps" in text


@pytest.mark.thorough
def test_too_narrow_a_passage_names_its_width_its_place_and_the_setting():
    wall = shapely.box(-10, -1000, 10, 300).union(shapely.box(-10, 330, 10, 1000))
    text = refusal(WIDE.difference(wall))
    widest = float(re.search(r"leaves ([\d.]+) m on each side", text)[1])
    assert widest == pytest.approx(15.0, abs=4.0)
    np.testing.assert_allclose(place_in(text), [315.0, 0.0], atol=15.0)
    assert "plan.clearance_m = 20" in text


def test_a_goal_on_another_lake_is_distinguished_from_a_narrow_passage():
    text = refusal(WIDE.difference(shapely.box(-10, -1000, 10, 1000)))
    assert "forbidden water lies between them on every path" in text


def test_a_speed_between_runs_beyond_the_ship_names_both():
    text = refusal(WIDE, transit_speed_mps=50.0)
    assert re.search(r"plan\.transit_speed_mps is 50, vessel '.+' reaches [\d.]+ m/s", text)


def test_a_current_as_fast_as_the_ship_is_named():
    text = refusal(WIDE, environment=Environment(current_to=np.array([0.0, 3.0])), transit_speed_mps=1.25)
    assert text.startswith("the mean current of 3 m/s is not slower than repositioning at 1.25 m/s, vessel ")
    assert "no single change of those tried helps" in text


CURRENT = np.array([3.0, 0.0])  # to the north [m/s], slower than the coaster on legs, and faster than she goes sideways


@pytest.mark.parametrize("heading_deg", [0.0, 60.0, 90.0, 180.0, 270.0])
def test_a_current_in_which_a_helm_cannot_stop_her_is_refused_where_it_sets_across(heading_deg: float):
    weather, goal = Environment(current_to=CURRENT), np.array([0.0, 0.0, np.deg2rad(heading_deg)])
    across = CURRENT[0] * abs(np.sin(goal[2]))
    if across < 1.0:
        check_current(coaster(), PlanSettings(), weather, goal)
        return
    with pytest.raises(NoPlan, match=rf"with {across:.2g} m/s across the heading at the goal") as caught:
        check_current(coaster(), PlanSettings(), weather, goal)
    told = float(re.search(r"a heading of (\d+) degrees", str(caught.value))[1])
    assert told == pytest.approx(180.0)  # against it
    check_current(coaster(), PlanSettings(), weather, np.array([0.0, 0.0, np.deg2rad(told)]))


@pytest.mark.parametrize(("north_mps", "why"), [(9.0, "not slower than repositioning"), (3.0, "she cannot stop there")])
def test_a_current_that_she_cannot_stem_is_said_before_anything_is_simulated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], north_mps: float, why: str
):
    text = (
        (SCENARIOS / "coaster.toml").read_text(encoding="utf-8").replace("north_mps = 0.0", f"north_mps = {north_mps}")
    )
    for kind in ("vessels", "dictionaries", "areas"):
        text = text.replace(f'"{kind}/', f'"{SCENARIOS.as_posix()}/{kind}/')
    (tmp_path / "swift.toml").write_text(text, encoding="utf-8")

    def simulated(*_arguments: object, **_options: object) -> None:
        raise AssertionError("candidates were simulated")

    monkeypatch.setattr(run, "ready", simulated)
    assert main(["run", str(tmp_path / "swift.toml"), "--out", str(tmp_path / "out"), "--quiet"]) == 3
    assert why in capsys.readouterr().err
    assert (tmp_path / "out" / "refused.html").exists()


def test_an_approach_speed_beyond_the_ship_names_the_run_and_what_is_lacking():
    kind = family("deceleration")
    given = complete_settings(kind, {"duration_s": 60.0, "speed_mps": 50.0})
    with pytest.raises(Unreachable, match=r"^primitive 'stop': .* cannot hold its entry state u = 50 m/s") as e:
        build_primitive(ship(), PrimitiveSpec(name="stop", family="deceleration", settings=given))
    needed, given_x = (float(x) for x in re.search(r"tau_x = (\S+), .*they give (\S+),", str(e.value)).groups())
    assert needed > given_x > 0
