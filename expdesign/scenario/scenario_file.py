"""Scenario files: vessel, dictionary, area, start, goal and settings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import shapely
from pydantic import Field
from shapely.ops import nearest_points

from expdesign.conventions import to_n_frame
from expdesign.errors import FileError, NoPlan
from expdesign.plan.control import capability
from expdesign.plan.values import PathsName, PlannerName, PlanSettings, UnderWay
from expdesign.scenario.charts import Latitude, Longitude, load_area
from expdesign.scenario.design_file import design_settings, named_files
from expdesign.scenario.design_tables import DesignTable
from expdesign.scenario.dictionaries import NAME, NAME_RULE, load_dictionary
from expdesign.scenario.import_files import equipped_vessel
from expdesign.scenario.tables import (
    Entry,
    NonNegative,
    Number,
    Positive,
    PositiveSpeed,
    Speed,
    Table,
    Text,
    YawRate,
    check_table,
    read_toml,
    shown,
)
from expdesign.scenario.values import Scenario
from expdesign.scenario.vessels import EnvironmentTable, build_environment
from expdesign.sea_area import SeaArea
from expdesign.values import Array
from expdesign.vessel import Vessel, column_name

Degrees = Annotated[float, Field(ge=-360, le=360)]
FILE_KEYS = {"scenario": ("vessel", "dictionary", "area"), "design": ("prior_data",)}
"""Keys that name files, relative to the file that contains them."""
SLOWEST_MPS = 0.02  # of legs, which else last for days even in a model basin
POSITION_KEYS = ("lat_deg", "lon_deg", "north_m", "east_m")


class ScenarioTable(Table):
    """`[scenario]`."""

    name: Text | None = Field(
        default=None,
        description="the name of the scenario and of its folder of results; the file's name when not given",
    )
    vessel: Text = Field(description="the path of a vessel file, from this file")
    dictionary: Text = Field(description="the path of a dictionary file, from this file")
    area: Text = Field(description="the path of an area file, from this file")


class PoseTable(Table):
    """`[start]` or `[goal]`."""

    lat_deg: Latitude | None = Field(default=None, description="the latitude [deg], WGS84, together with lon_deg")
    lon_deg: Longitude | None = Field(default=None, description="the longitude [deg], WGS84, together with lat_deg")
    north_m: Number | None = Field(
        default=None,
        description="the distance north of the area's centre [m], together with east_m, instead of lat_deg",
    )
    east_m: Number | None = Field(
        default=None, description="the distance east of the area's centre [m], together with north_m"
    )
    heading_deg: Degrees = Field(description="the heading [deg], clockwise from north")


class StartTable(PoseTable):
    """`[start]`."""

    u_mps: Speed = Field(default=0.0, description="the speed ahead over ground with which the plan begins [m/s]")
    v_mps: Speed = Field(default=0.0, description="the speed to starboard over ground with which it begins [m/s]")
    r_radps: YawRate = Field(
        default=0.0, description="the yaw rate with which it begins [rad/s], positive to starboard"
    )
    commands: dict[str, Number] = Field(
        default_factory=dict,
        description="the actuator commands that stand as the plan begins, by column as in commands.csv, e.g. "
        "{ n1_rps = 3.0 }; 0 for the others. Without any key of motion or commands the ship begins at rest through "
        "the water",
    )


class PlanTable(Table):
    """`[plan]`: clearance, safety and repositioning legs."""

    clearance_m: NonNegative = Field(
        default=PlanSettings.clearance_m, description="the least distance of the hull from anything forbidden [m]"
    )
    confidence: float = Field(
        default=PlanSettings.confidence,
        gt=0,
        lt=1,
        description="the least share of simulated trials that stay in allowed water, with randomly drawn ships, "
        "currents and winds",
    )
    aborted_most: float = Field(
        default=PlanSettings.aborted_most,
        ge=0,
        le=0.5,
        description="the share of these trials that may be aborted because a run cannot be begun or the goal is not "
        "reached; a plan with more of them is written, but not called verified, and none is from half of them on",
    )
    start_tolerance: float = Field(
        default=PlanSettings.start_tolerance,
        ge=1,
        le=4,
        description="a factor on how far heading, speed and yaw rate may be off where a run begins, on how far its "
        "place may where there is room, and on the distance from the goal at which a trial has reached it: a ship of "
        "which little is known does not come closer",
    )
    time_budget_s: Positive = Field(
        default=PlanSettings.time_budget_s,
        description="the work budget for other placements [s] on a usual computer; work is counted, not timed, so that "
        "every computer finds the same plan",
    )
    transit_speed_mps: PositiveSpeed | None = Field(
        default=PlanSettings.transit_speed_mps,
        ge=SLOWEST_MPS,
        description="the speed of repositioning legs through water [m/s]; when not given, nine tenths of the "
        "actuators' limit, or 97 % of it where design.accuracy asks for a short day",
    )
    turning_radius_m: Positive | None = Field(
        default=PlanSettings.turning_radius_m,
        description="the turning radius of repositioning legs [m]; when not given, that of the vessel's model",
    )
    planner: PlannerName = Field(
        default=PlanSettings.planner,
        description="the search that orders and places the runs: 'beam' at any place and heading; 'lattice' on a state "
        "lattice, with a proof of how good the plan is among all on that lattice",
    )
    lattice_spacing_m: Positive | None = Field(
        default=PlanSettings.lattice_spacing_m,
        description="the distance between cells of the lattice planner [m]; when not given, a little more than the "
        "turning radius, more in large waters and less where that is too coarse",
    )
    paths: PathsName = Field(
        default=PlanSettings.paths,
        description="what finds the paths of legs that bend, of ships that turn on the spot: 'ompl', a roadmap by "
        "OMPL, whose paths are up to 1 per cent longer, or 'visibility', the graph of the shore's corners",
    )


class ScenarioFile(Table):
    """The whole file."""

    topic = "scenario"

    scenario: ScenarioTable = Field(description="a table [scenario] with vessel, dictionary and area")
    design: DesignTable = Field(description="a table [design] with total_s")
    start: StartTable = Field(
        description="a table [start] with a position and heading_deg, and the motion there if the ship is under way"
    )
    goal: PoseTable = Field(description="a table [goal] with a position and heading_deg")
    environment: EnvironmentTable = Field(default=EnvironmentTable(), description="the expected current, wind and sea")
    plan: PlanTable = Field(default=PlanTable(), description="the clearance, safety and repositioning legs of the plan")


def load_scenario(path: Path | str, *, vessel: Path | None = None, data: Sequence[Path] = ()) -> Scenario:
    """Read a scenario file and the vessel, dictionary, area and chart it names.

    Args:
        path: a TOML file with `[scenario]`, `[design]`, `[start]`, `[goal]` and optionally `[environment]`, `[plan]`.
        vessel: a vessel file in place of the one it names.
        data: measured since; an import beside it, or beside design.prior_data, tells of sensors and actuators.

    Raises:
        FileError: a file is unreadable, an entry is wrong, missing or unknown, or start or goal has no room.
        NoPlan: the area holds no allowed water.
    """
    entry = Entry(Path(path))
    content = read_toml(entry.path)
    if _is_variant(content):
        raise FileError(
            entry.path,
            "",
            "has only some keys of a scenario, as variants have; expected a whole scenario, or the variant after its "
            f"scenario: expdesign whatif SCENARIO.toml {entry.path}",
        )
    return build_scenario(content, entry, vessel=vessel, data=data)


def needed_parts(content: Mapping[str, Any]) -> list[bool]:
    """Which parts that a scenario cannot do without are there: its files, and tables."""
    files = content.get("scenario", {})
    return [
        *(isinstance(files, Mapping) and name in files for name in FILE_KEYS["scenario"]),
        *(name in content for name in ("design", "start", "goal")),
    ]


def _is_variant(content: Mapping[str, Any]) -> bool:
    """Whether most of what a scenario cannot do without is missing, and the rest is a scenario's."""
    return bool(content) and set(content) <= set(ScenarioFile.model_fields) and sum(needed_parts(content)) <= 2


def build_scenario(
    content: Mapping[str, Any], entry: Entry, *, vessel: Path | None = None, data: Sequence[Path] = ()
) -> Scenario:
    """A scenario from the tables of its file; raises as `load_scenario` does.

    Args:
        entry: the file, to which the files it names are relative.
        vessel: a vessel file in place of the one it names.
        data: measured since, as of `load_scenario`.
    """
    file = check_table(ScenarioFile, content, entry)
    places = {"start": file.start, "goal": file.goal}
    for key, place in places.items():
        _check_position(place, entry.at(key))
    ship_file = vessel or entry.at("scenario.vessel").file(file.scenario.vessel)
    before = named_files(file.design.prior_data, entry.at("design.prior_data"))
    ship, told = equipped_vessel(ship_file, (*before, *data))
    dictionary = load_dictionary(entry.at("scenario.dictionary").file(file.scenario.dictionary))
    plan = PlanSettings(**file.plan.model_dump())
    area = load_area(entry.at("scenario.area").file(file.scenario.area), draught_m=ship.draught_m)
    berths = {key: _berth(place, area) for key, place in places.items()}
    for key, other in (("start", "goal"), ("goal", "start")):
        way = f"a way {'to' if other == 'goal' else 'from'} the {other}"
        problem = berth_problem(berths[key], ship, area, plan, end=berths[other].pose, way=way)
        if problem:
            raise entry.at(key).error(problem)
    return Scenario(
        name=_name(file.scenario.name, entry),
        path=entry.path,
        vessel=ship,
        dictionary=dictionary,
        area=area,
        design=design_settings(file.design, ship, tuple(spec.name for spec in dictionary), entry.at("design")),
        plan=plan,
        environment=build_environment(file.environment),
        under_way=_under_way(file.start, ship, entry.at("start")),
        start=berths["start"].pose,
        goal=berths["goal"].pose,
        told=told,
    )


def _under_way(start: StartTable, vessel: Vessel, entry: Entry) -> UnderWay | None:
    """The motion at the start; None where no key states any."""
    if not start.model_fields_set & {"u_mps", "v_mps", "r_radps", "commands"}:
        return None
    columns = [column_name(name) for name in vessel.model.inputs]
    for name, value in start.commands.items():
        if name not in columns:
            raise entry.at("commands").error(f"has {shown(name)}, expected columns among {', '.join(columns)}")
        limit = vessel.limits[columns.index(name)]
        if not limit.low <= value <= limit.high:
            raise entry.at(f"commands.{name}").error(f"is {value:g}, expected {limit.low:g} to {limit.high:g}")
    return UnderWay(
        velocity=np.array([start.u_mps, start.v_mps, start.r_radps]),
        inputs=np.array([start.commands.get(name, 0.0) for name in columns]),
    )


def _name(given: str | None, entry: Entry) -> str:
    """The given name or the file's; it must be able to name a folder."""
    name = entry.path.stem if given is None else given
    if not NAME.fullmatch(name):
        raise entry.at("scenario.name").error(f"is {shown(name)}, expected {NAME_RULE}")
    return name


def _check_position(place: PoseTable, entry: Entry) -> None:
    """A position is latitude and longitude, or north and east, not both and not half."""
    given = [name for name in POSITION_KEYS if getattr(place, name) is not None]
    if given not in (["lat_deg", "lon_deg"], ["north_m", "east_m"]):
        found = f"gives {' and '.join(given)}" if given else "gives no position"
        raise entry.error(f"{found}, expected lat_deg and lon_deg, or north_m and east_m")


@dataclass(frozen=True, kw_only=True, eq=False)
class Berth:
    """A place for the ship as somebody states it."""

    pose: Array  # (3,) in the area's frame [north m, east m, heading rad]
    stated: Array  # (2,) the position in the order stated: latitude and longitude, or north and east
    degrees: bool  # whether it is latitude and longitude

    def swapped(self, area: SeaArea) -> shapely.Point:
        """Where it would be with its two numbers swapped (east_m, north_m)."""
        other = self.stated[::-1]
        return shapely.Point((area.frame.to_metres(other) if self.degrees else other)[::-1])


def _berth(place: PoseTable, area: SeaArea) -> Berth:
    degrees = place.lat_deg is not None
    stated = np.array([place.lat_deg, place.lon_deg] if degrees else [place.north_m, place.east_m], dtype=float)
    return build_berth(stated, math.radians(place.heading_deg), area, degrees=degrees)


def build_berth(stated: Array, heading_rad: float, area: SeaArea, *, degrees: bool) -> Berth:
    """A place by latitude and longitude, or by north and east in an area's frame."""
    north_east = area.frame.to_metres(stated) if degrees else stated
    return Berth(pose=np.array([*north_east, heading_rad]), stated=stated, degrees=degrees)


def berth_problem(berth: Berth, vessel: Vessel, area: SeaArea, settings: PlanSettings, *, end: Array, way: str) -> str:
    """What is wrong with a start or goal, or "" when the hull keeps its clearance there.

    Args:
        settings: with the least distance of the hull from anything forbidden.
        end: (3,) pose at the other end of the trial.
        way: to it or from it, e.g. "a way to the goal".
    """
    pose, clearance_m = berth.pose, settings.clearance_m
    swapped = f", {ORDER[berth.degrees]} swapped it is in the area" if _is_swapped(berth, area) else ""
    if not np.isfinite(pose).all():
        return f"is thousands of kilometres from the area {area.name!r}{swapped}, expected a position in it"
    hull = shapely.Polygon(to_n_frame(vessel.hull_b, pose)[:, ::-1])
    centre = shapely.Point(pose[1], pose[0])
    if area.land.covers(centre):
        problem = f"is on land, {_metres(centre.distance(area.water))} from allowed water{swapped}"
    elif not area.water.covers(centre):
        off = _metres(centre.distance(area.water))
        problem = f"is outside the allowed water (bounds, depth, no-go zones), {off} from it{swapped}"
    elif not area.water.covers(hull):
        distance = centre.distance(area.water.boundary)
        problem = f"is {_metres(distance)} from forbidden water, less than the hull of {vessel.length_m:g} m needs"
    else:
        distance = hull.distance(area.water.boundary)
        if distance >= clearance_m:
            return ""
        problem = f"leaves {_metres(distance)} between the hull and forbidden water"
    remedy = _remedy(berth, vessel, area, settings, end, way)
    return f"{problem}, expected at least clearance_m = {clearance_m:g} around the hull; {remedy}"


def _is_swapped(berth: Berth, area: SeaArea) -> bool:
    """Whether a place outside the area lies in its water with its two numbers swapped.

    In metres, many a place in the area has its mirror image there, too, which tells nothing.
    """
    outside = not shapely.box(*area.water.bounds).covers(shapely.Point(berth.pose[1::-1]))
    return outside and bool(area.water.covers(berth.swapped(area)))


ORDER = {True: "with latitude and longitude", False: "with north and east"}
"""What may be swapped, by whether a place is in degrees."""


def _remedy(berth: Berth, vessel: Vessel, area: SeaArea, settings: PlanSettings, end: Array, way: str) -> str:
    """The nearest position with room at any heading and a way to the other end, rounded as printed."""
    radius = float(np.hypot(vessel.length_m, vessel.beam_m)) / 2
    roomy = area.safe_water(settings.clearance_m + radius + (1.0 if berth.degrees else 0.01))
    if roomy.is_empty:
        return "nowhere in the area is there that much room"
    connected = _connected(area.safe_water(settings.clearance_m + _spare_m(vessel, settings)), roomy, end)
    roomy = shapely.intersection(roomy, connected)
    if roomy.is_empty:
        return f"nowhere with {way} is there that much room"
    point = nearest_points(roomy, shapely.Point(berth.pose[1], berth.pose[0]))[0]
    found = f"the nearest place with room and {way} is"
    if not berth.degrees:
        return f"{found} north_m = {point.y:.2f}, east_m = {point.x:.2f}"
    lat, lon = area.frame.to_degrees(np.array([point.y, point.x]))
    return f"{found} lat_deg = {lat:.6f}, lon_deg = {lon:.6f}"


def _connected(ways: shapely.MultiPolygon, roomy: shapely.MultiPolygon, end: Array) -> shapely.Geometry:
    """The part of the water that legs may use with a pose in it; with none, the nearest part that has room."""
    if not np.isfinite(end).all():
        return ways
    point = shapely.Point(end[1], end[0])
    around = [part for part in ways.geoms if part.covers(point)]
    with_room = (part for part in ways.geoms if part.intersects(roomy))
    return around[0] if around else min(with_room, key=point.distance, default=shapely.MultiPolygon())


def _spare_m(vessel: Vessel, settings: PlanSettings) -> float:
    """The distance beyond the clearance that centre lines of legs keep from the shore [m]."""
    try:
        return float(capability(vessel, settings).path_spares_m(vessel)[-1])
    except NoPlan:  # the planner says why
        return vessel.beam_m / 2


def _metres(distance: float) -> str:
    return f"{distance:.3g} m" if distance < 100 else f"{distance:.0f} m"
