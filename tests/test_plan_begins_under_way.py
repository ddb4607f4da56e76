"""Plans begin with the motion and the commands asked for, whatever these are; rest is one of them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign import workflows
from expdesign.errors import FileError, InputError, NoPlan
from expdesign.plan import PlanSettings
from expdesign.plan.assembly import ship_on_legs
from expdesign.plan.bounds import reposition_bound_s
from expdesign.plan.solve import draft_trial
from expdesign.plan.values import PlanProblem, UnderWay
from expdesign.plan.verify import verify_plan
from expdesign.scenario import load_scenario
from expdesign.simulation import Environment, simulate, to_body
from expdesign.vessel import NUMPY, Response, column_name
from plan_case import acceleration, area, ship
from scenario_files import spoil, write_scenario
from short_examples import copied

ROOM = 600.0
TURNING = UnderWay(velocity=np.array([0.8, 0.1, 0.03]), inputs=np.array([4.0, 0.2, 4.0, -0.1]))
ASTERN = UnderWay(velocity=np.array([-0.4, -0.2, -0.05]), inputs=np.array([-3.0, 0.0, 2.0, 3.0]))
FAST = UnderWay(velocity=np.array([1.5, 0.0, 0.0]), inputs=np.array([15.0, 0.0, 15.0, 0.0]))
ACCURACY = '[design.accuracy]\nas = "durations"\n'
CURRENT = Environment(current_to=np.array([0.1, -0.2]))


def problem(under_way, *, vessel=None, north_m=0.0, environment=CURRENT) -> PlanProblem:
    """One run on the way to a goal in the north-east, in a bay."""
    vessel = vessel or ship()
    return PlanProblem(
        vessel=vessel,
        area=area(shapely.box(-ROOM, -ROOM, ROOM, ROOM)),
        environment=environment,
        settings=PlanSettings(),
        primitives=(acceleration(vessel, speed_mps=1.0),),
        design=SimpleNamespace(problem=SimpleNamespace(names=("go",)), repeats=(1,)),
        start=np.array([north_m, 0.0, 0.5]),
        goal=np.array([300.0, 250.0, 0.0]),
        under_way=under_way,
    )


def verified(asked: PlanProblem, sailed) -> tuple[str, ...]:
    """What the independent check says, of the state asked for."""
    return verify_plan(
        asked.vessel,
        asked.area,
        asked.environment,
        sailed,
        clearance_m=asked.settings.clearance_m,
        transit_mps=ship_on_legs(asked).transit_speed_mps,
        primitives={item.name: item for item in asked.primitives},
        repeats=asked.repeats,
        start=asked.start,
        goal=asked.goal,
        under_way=asked.under_way,
    ).problems


@pytest.mark.thorough
@pytest.mark.parametrize("moves", [TURNING, pytest.param(ASTERN, marks=pytest.mark.slow)], ids=["turning", "astern"])
def test_the_first_sample_is_the_state_asked_for_and_the_check_sees_when_it_is_not(moves):
    asked = problem(moves)
    draft = draft_trial(asked)
    sailed = draft.sailed
    assert np.array_equal(sailed.states[0], [*asked.start, *moves.velocity])
    assert verified(asked, sailed) == ()
    other = UnderWay(velocity=moves.velocity + np.array([0.0, 0.3, 0.0]), inputs=moves.inputs)
    assert any("off the speed asked for" in found for found in verified(replace(asked, under_way=other), sailed))
    turned = UnderWay(velocity=moves.velocity, inputs=moves.inputs + np.array([0.0, 1.5, 0.0, 0.0]))
    assert any("passes its rate" in found for found in verified(replace(asked, under_way=turned), sailed))
    assert any("off the start" in found for found in verified(replace(asked, under_way=None), sailed))
    least_s = reposition_bound_s(
        asked.vessel,
        asked.area,
        asked.environment,
        clearance_m=asked.settings.clearance_m,
        primitives=asked.primitives,
        repeats=asked.repeats,
        ends=(asked.start, asked.goal),
        transit_mps=draft.transit_mps,
        yaw_rate_radps=draft.water.ship.spot_rate_radps + draft.water.ship.yaw_rate_radps,
        under_way=moves,
    )
    assert 0 < least_s <= sailed.seconds("reposition")


@pytest.mark.thorough
def test_rest_said_as_a_motion_is_rest():
    u_c, v_c = to_body(CURRENT.current_to, 0.5, NUMPY)
    rest = UnderWay(velocity=np.array([u_c, v_c, 0.0]), inputs=np.zeros(4))
    said, silent = (draft_trial(problem(moves)).sailed for moves in (rest, None))
    assert np.array_equal(said.commands.values, silent.commands.values)
    assert np.array_equal(said.states, silent.states)


@pytest.mark.thorough
def test_actuators_that_answer_late_deliver_what_stands():
    vessel = ship()
    slow = [replace(item, responses=(Response(lag_s=2.0),) * 2) for item in vessel.model.actuators]
    asked = problem(TURNING, vessel=replace(vessel, model=replace(vessel.model, actuators=tuple(slow))))
    sailed = draft_trial(asked).sailed
    assert verified(asked, sailed) == ()
    assert np.array_equal(sailed.commands.values[0], TURNING.inputs)
    again = simulate(
        asked.vessel,
        sailed.commands,
        pose=asked.start,
        velocity=TURNING.velocity,
        environment=CURRENT,
        standing=TURNING.inputs,
    )
    assert np.abs(again.pose - sailed.trajectory.pose).max() < 1e-6
    sooner = replace(sailed, commands=replace(sailed.commands, values=sailed.commands.values + 0.3))
    assert any("answers late" in found for found in verified(asked, sooner))


def test_a_ship_that_cannot_stop_before_the_shore_is_refused_by_its_motion():
    with pytest.raises(NoPlan, match=r"come to a stop in safe water .* start.u_mps = 1.5"):
        draft_trial(replace(problem(FAST, north_m=ROOM - 37.0, environment=Environment()), start=np.array([563, 0, 0])))


@pytest.mark.parametrize(
    ("velocity", "key"), [((9.0, 0.0, 0.0), "start.u_mps and start.v_mps are 9"), ((0.0, 0.0, 3.0), "start.r_radps")]
)
def test_motion_that_the_ship_cannot_have_is_refused(velocity, key):
    moves = UnderWay(velocity=np.array(velocity), inputs=np.zeros(4))
    with pytest.raises(InputError, match=key):
        draft_trial(problem(moves, environment=Environment()))


def test_a_scenario_says_how_it_begins(tmp_path):
    path = write_scenario(tmp_path)
    assert load_scenario(path).under_way is None
    columns = [column_name(name) for name in load_scenario(path).vessel.model.inputs]
    spoil(path, "[start]\n", f"[start]\nu_mps = 0.7\nr_radps = -0.01\ncommands = {{ {columns[0]} = 3.0 }}\n")
    found = load_scenario(path).under_way
    assert found is not None
    assert found.velocity.tolist() == [0.7, 0.0, -0.01]
    assert found.inputs.tolist() == [3.0, *np.zeros(len(columns) - 1)]
    spoil(path, f"{columns[0]} = 3.0", f"{columns[0]} = 9e9")
    with pytest.raises(FileError, match=f"start.commands.{columns[0]}: is 9e.09, expected -"):
        load_scenario(path)
    spoil(path, f"{columns[0]} = 9e9", "n9_rps = 1.0")
    with pytest.raises(FileError, match=f"has 'n9_rps', expected columns among {columns[0]}"):
        load_scenario(path)


@pytest.mark.parametrize(
    ("motion", "key", "not_begun"),
    [
        ("u_mps = 9.0", "start.u_mps and start.v_mps are 9", "simulating the dictionary"),
        ("r_radps = 3.0", "start.r_radps is 3", "simulating candidates"),
    ],
)
def test_motion_that_the_ship_cannot_have_is_refused_before_the_work_that_does_not_need_it(
    motion, key, not_begun, tmp_path
):
    path = copied(tmp_path, "story", {"[start]\n": f"[start]\n{motion}\n", "[plan]\n": f"{ACCURACY}[plan]\n"})
    told = list[str]()
    with pytest.raises(InputError, match=key):
        workflows.run(path, None, cache=False, progress=lambda activity, _: told.append(activity))
    assert not_begun not in told
