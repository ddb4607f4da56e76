"""Small sea areas and the example ship, for tests of the planner's parts."""

from __future__ import annotations

import re

import numpy as np
import shapely

from expdesign.dictionary import Primitive, PrimitiveSpec, build_primitive, complete_settings, family
from expdesign.plan import PlanSettings
from expdesign.plan.chart.goal_distance import build_goal_distance, clearance_field
from expdesign.plan.control.ships import capability
from expdesign.plan.legs import LegTask, LegWater
from expdesign.plan.local_planner import SearchSpace, local_planner
from expdesign.plan.runs import footprint
from expdesign.scenario import load_vessel
from expdesign.sea_area import LocalFrame, SeaArea, as_multipolygon
from expdesign.simulation import CALM
from expdesign.vessel import Vessel
from scenario_files import SCENARIOS

VESSELS = SCENARIOS / "vessels"


def area(water: shapely.Geometry) -> SeaArea:
    """A sea area from a polygon in (east, north) metres."""
    return SeaArea(
        name="test",
        frame=LocalFrame(60.0, 25.0),
        water=as_multipolygon(water),
        land=shapely.MultiPolygon(),
        depth_rule="",
    )


def ship() -> Vessel:
    """The nominal 30 m ship."""
    return load_vessel(VESSELS / "azimuth-30m.toml")


def acceleration(vessel: Vessel, *, speed_mps: float = 4.0, duration_s: float = 60.0) -> Primitive:
    """The run 'go': an acceleration from rest."""
    settings = complete_settings(family("acceleration"), {"duration_s": duration_s, "speed_mps": speed_mps})
    return build_primitive(vessel, PrimitiveSpec(name="go", family="acceleration", settings=settings))


def primitive(vessel: Vessel) -> Primitive:
    """The run 'go' at 1 m/s: a straight minute."""
    return acceleration(vessel, speed_mps=1.0)


def random_path(rng: np.random.Generator, begin: np.ndarray, steps: int) -> np.ndarray:
    """A random path (steps + 1, 2) from a point."""
    course = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(0, 0.5, steps))
    step = rng.uniform(20, 60, (steps, 1)) * np.stack([np.cos(course), np.sin(course)], axis=1)
    return np.asarray(begin + np.r_[np.zeros((1, 2)), np.cumsum(step, axis=0)])


def place_in(text: str) -> np.ndarray:
    """North and east [m] of the position that a message names."""
    found = re.search(r"near (-?[\d.]+), (-?[\d.]+)", text)
    assert found is not None, text
    frame = LocalFrame(60.0, 25.0)
    metres_per_degree = 1.0 / (frame.to_degrees(np.array([1.0, 1.0])) - [60.0, 25.0])
    return (np.array(found.groups(), dtype=float) - [60.0, 25.0]) * metres_per_degree


def leg_water(water: shapely.Geometry, *, clearance_m: float = 20.0) -> LegWater:
    """Everything legs need, in calm water."""
    vessel, sea = ship(), area(water)
    return LegWater(
        vessel=vessel,
        environment=CALM,
        ship=capability(vessel, PlanSettings(clearance_m=clearance_m)),
        area=sea,
        clearance_m=clearance_m,
        field=clearance_field(sea, resolution_m=vessel.length_m / 8),
    )


def find_leg(task: LegTask, water: LegWater) -> np.ndarray | None:
    """Commands of the ship's own local planner."""
    found = local_planner(water).leg(task, water)
    return None if found is None else found.commands


def space_of(sea: LegWater, run: Primitive, goal: np.ndarray) -> SearchSpace:
    """What a search that places one kind of run on its way to a goal (3,) works on, in calm water."""
    vessel = sea.vessel
    room = np.full(len(run.trajectory), 25.0)
    return SearchSpace(
        footprints=(footprint(run, room, length_m=vessel.length_m, beam_m=vessel.beam_m),),
        frame=sea.area.frame,
        field=sea.field,
        goal_distance=build_goal_distance(sea.narrowest_graph, sea.field, goal[:2]),
        goal=goal,
        planner=local_planner(sea, (run,)),
        hull_m=vessel.length_m,
        leg_margin_m=25.0,
        current_to=np.zeros(2),
    )


def at_rest(north: float, east: float, heading: float) -> np.ndarray:
    """(6,) state."""
    return np.array([north, east, heading, 0.0, 0.0, 0.0])
