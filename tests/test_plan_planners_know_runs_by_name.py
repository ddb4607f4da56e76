"""Local planners judge a run in a space with fewer runs as in the whole: days go on without some of their runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expdesign.dictionary import PrimitiveSpec, build_primitive, complete_settings, family
from expdesign.plan import PlanSettings
from expdesign.plan.chart.goal_distance import build_goal_distance
from expdesign.plan.control.ships import DubinsShip, capability
from expdesign.plan.legs import LegWater
from expdesign.plan.local_planner import LegEnds, SearchSpace, local_planner
from expdesign.plan.runs import footprint
from expdesign.vessel import Vessel
from helm_case import coaster, open_water
from plan_case import ship


def space_in(water: LegWater, kinds: dict[str, dict[str, float]]) -> SearchSpace:
    """Of runs of these families with these settings, in open water."""
    vessel = water.vessel
    runs = [
        build_primitive(vessel, PrimitiveSpec(name=name, family=name, settings=complete_settings(family(name), values)))
        for name, values in kinds.items()
    ]
    sizes = {"length_m": vessel.length_m, "beam_m": vessel.beam_m}
    goal = np.array([10 * vessel.length_m, 0.0, 0.0])
    return SearchSpace(
        footprints=tuple(footprint(run, np.full(len(run.trajectory), vessel.length_m), **sizes) for run in runs),
        frame=water.area.frame,
        field=water.field,
        goal_distance=build_goal_distance(water.narrowest_graph, water.field, goal[:2]),
        goal=goal,
        planner=local_planner(water, runs),
        hull_m=vessel.length_m,
        leg_margin_m=vessel.length_m,
        current_to=np.array([0.1, -0.2]),
    )


def dubins(vessel: Vessel) -> LegWater:
    """The water of a ship that is taken to turn on curves, whatever else it can do."""
    water = open_water(vessel)
    agile = capability(vessel, PlanSettings())
    values = {name: value for name, value in vars(agile).items() if name in DubinsShip.__dataclass_fields__}
    return replace(water, ship=DubinsShip(**values))


HELM = {
    "turning_circle_helm": {"speed_mps": 5.0, "duration_s": 150.0, "helm_rad": 0.6},
    "zigzag_heading": {"speed_mps": 5.0, "duration_s": 180.0, "heading_rad": 0.17, "helm_rad": 0.17},
}
FORCES = {
    "acceleration": {"speed_mps": 1.0, "duration_s": 60.0},
    "turning_circle": {
        "speed_mps": 1.0,
        "turn_speed_mps": 0.8,
        "yaw_rate_radps": 0.03,
        "entry_s": 9.0,
        "duration_s": 60.0,
    },
}


@pytest.mark.parametrize("kind", ["helm", "agile", "dubins"])
def test_a_run_is_the_same_beside_fewer_others(kind):
    space = {
        "helm": lambda: space_in(open_water(coaster()), HELM),
        "agile": lambda: space_in(open_water(ship()), FORCES),
        "dubins": lambda: space_in(dubins(ship()), FORCES),
    }[kind]()
    few, planner, rng = replace(space, footprints=space.footprints[1:]), space.planner, np.random.default_rng(0)
    run = few.footprints[0]
    froms, tos = rng.uniform(-10.0, 10.0, (2, 50, 3)) * [space.hull_m, space.hull_m, 0.3]

    def leg_s(of: SearchSpace, index: int) -> np.ndarray:
        ends = LegEnds(before=index, after=index, exit_mps=run.exit_mps, entry_mps=run.entry_mps)
        return planner.leg_s(of, ends, froms, tos, np.zeros((0, 2)))

    def ways_on(of: SearchSpace, index: int) -> np.ndarray:
        far = 3.0 * froms  # where the water ends
        return planner.ways_on(of, np.full(50, index), far, far)

    np.testing.assert_array_equal(leg_s(few, 0), leg_s(space, 1))
    np.testing.assert_array_equal(ways_on(few, 0), ways_on(space, 1))
    if kind == "helm":  # as it recovers from its runs in different ways, another run is told from it
        ends = LegEnds(before=0, after=1, exit_mps=run.exit_mps, entry_mps=run.entry_mps)
        assert (planner.leg_s(space, ends, froms, tos, np.zeros((0, 2))) != leg_s(space, 1)).any()
