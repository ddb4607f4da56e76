"""A gap or a basin that is just wide enough is found at any angle to the grid, in small charts and in large ones."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign.errors import NoPlan
from expdesign.plan import PlanSettings
from expdesign.plan.assembly import leg_water, plan_room, roomy_water, ship_on_legs, waters
from expdesign.plan.feasibility import place_of
from expdesign.plan.values import PlanProblem
from expdesign.progress import silent
from expdesign.simulation import CALM
from expdesign.vessel.vessel import covering_discs
from plan_case import acceleration, area, ship

CLEARANCE_M = 20.0


def problem(water: shapely.Geometry, angle_deg: float, *, ends_m: float) -> PlanProblem:
    """A straight run of a ship that is known exactly; start and goal lie along an angle, from east to north."""
    vessel = ship()
    certain = replace(vessel, model=replace(vessel.model, parameter_std=np.zeros(len(vessel.model.names))))
    angle = np.radians(angle_deg)
    ahead = np.array([np.sin(angle), np.cos(angle)])
    turned = shapely.affinity.rotate(water, angle_deg, origin=(0, 0))
    return PlanProblem(
        vessel=certain,
        area=area(turned),
        environment=CALM,
        settings=PlanSettings(clearance_m=CLEARANCE_M),
        primitives=(acceleration(certain, speed_mps=1.0),),
        design=SimpleNamespace(problem=SimpleNamespace(names=("go",)), repeats=(1,)),
        start=np.r_[-ends_m * ahead, np.pi / 2 - angle],
        goal=np.r_[ends_m * ahead, np.pi / 2 - angle],
    )


@pytest.mark.parametrize("angle_deg", [0.0, 17.0, 45.0, 68.0])
@pytest.mark.parametrize(("half_m", "ends_m"), [(400.0, 150.0), (6000.0, 150.0), (9000.0, 5000.0)])
def test_a_gap_a_foot_wider_than_the_hull_and_its_clearance_is_found(angle_deg, half_m, ends_m):
    open_sea = problem(shapely.box(-400, -400, 400, 400), 0.0, ends_m=100.0)
    needed_m = leg_water(open_sea, ship_on_legs(open_sea)).straight_margin_m
    for wider_m, found in ((0.3, True), (-0.3, False)):
        gap_m = needed_m + wider_m
        wall = shapely.box(-10, -3 * half_m, 10, -gap_m).union(shapely.box(-10, gap_m, 10, 3 * half_m))
        case = problem(shapely.box(-half_m, -half_m, half_m, half_m).difference(wall), angle_deg, ends_m=ends_m)
        capable = ship_on_legs(case)
        for part in waters(case, capable):
            water = leg_water(replace(case, area=part), capable)
            assert water.joins(case.start[:2], case.goal[:2]) == found
            break


@pytest.mark.parametrize("angle_deg", [0.0, 17.0, 45.0])
def test_a_run_has_a_place_in_a_basin_that_the_usual_grid_is_too_coarse_for(angle_deg):
    _, disc_m = covering_discs(ship().length_m, ship().beam_m)
    wide_m = disc_m + CLEARANCE_M + 2.5
    case = problem(shapely.box(-130, -wide_m, 130, wide_m), angle_deg, ends_m=10.0)
    capable = ship_on_legs(case)
    with pytest.raises(NoPlan, match="no room for 'go'"):
        plan_room(case, leg_water(case, capable), silent, strict=True)
    water, room = roomy_water(case, capable, silent)
    assert water.field.cell_m < ship().length_m / 8
    assert place_of(room.space, 0).pose is not None
