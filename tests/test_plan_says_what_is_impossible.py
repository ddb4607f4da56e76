"""A trial that cannot be planned is refused at once, and the refusal says what does not fit, where, and by how much."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign.dictionary import PrimitiveSpec, build_primitive, complete_settings, family
from expdesign.errors import NoPlan, Unreachable
from expdesign.plan import PlanSettings
from expdesign.plan.solve import plan_trial
from expdesign.plan.values import PlanProblem
from expdesign.simulation import CALM, Environment
from plan_case import acceleration, area, place_in, ship

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


def test_an_approach_speed_beyond_the_ship_names_the_run_and_what_is_lacking():
    kind = family("deceleration")
    given = complete_settings(kind, {"duration_s": 60.0, "speed_mps": 50.0})
    with pytest.raises(Unreachable, match=r"^primitive 'stop': .* cannot hold its entry state u = 50 m/s") as e:
        build_primitive(ship(), PrimitiveSpec(name="stop", family="deceleration", settings=given))
    needed, given_x = (float(x) for x in re.search(r"tau_x = (\S+), .*they give (\S+),", str(e.value)).groups())
    assert needed > given_x > 0
