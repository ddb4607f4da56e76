"""Route files of every example scenario obey their formats, stay in its water and bring its track back.

By default one manoeuvre is run at each scenario's start, in a heading that has room; the whole trials, which
take minutes to plan, are looked at with `-m slow`.
"""

from __future__ import annotations

import csv
import json
from functools import cache
from itertools import pairwise
from pathlib import Path

import gpxpy
import numpy as np
import pytest
import shapely
from lxml import etree

from expdesign import workflows
from expdesign.dictionary import build_dictionary
from expdesign.export.files import plan_json, track_csv
from expdesign.export.formats import FORMATS, route_files
from expdesign.export.formats.check import check_route_file
from expdesign.export.formats.missions import NAV_WAYPOINT
from expdesign.export.routes import build_bridge_route, build_route, planned_track, read_plan
from expdesign.export.routes.chords import corridor, sides_needed
from expdesign.plan.values import Leg, Plan, Verification
from expdesign.scenario import Scenario, load_scenario
from expdesign.signals import Trajectory
from expdesign.simulation import simulate
from route_readers import PLAN_SCHEMA, READERS
from sample_files import SAMPLES

SCENARIOS = sorted((Path(__file__).parents[1] / "scenarios").glob("*.toml"))
XSD = {
    "route.rtz": "rtz/RTZ_Schema_version_1_2.xsd",
    "route-rtz10.rtz": "rtz/RTZ_Schema_version_1_0.xsd",
    "route-rtz11.rtz": "rtz/RTZ_Schema_version_1_1.xsd",
    "route.gpx": "gpx/gpx-1.1.xsd",
}
HEADINGS = 24


@cache
def loaded(path: Path) -> Scenario:
    return load_scenario(path)


def stand_in(case: Scenario) -> Plan:
    """The first manoeuvre of the dictionary that has room at the start, as a plan of one run."""
    room_m = np.hypot(case.vessel.length_m, case.vessel.beam_m) / 2 + case.plan.clearance_m
    for primitive in build_dictionary(case.vessel, case.dictionary[:4]):
        for heading in np.linspace(0, 2 * np.pi, HEADINGS, endpoint=False):
            track = simulate(
                case.vessel, primitive.commands, pose=(*case.start[:2], heading), velocity=primitive.entry_velocity
            )
            line = shapely.LineString(track.pose[:, 1::-1])
            away = case.area.water.boundary.distance(line)
            if np.hypot(*np.ptp(track.pose[:, :2], axis=0)) > 1.0 and case.area.water.covers(line) and away > room_m:
                return _plan(case, primitive.name, primitive.commands, track, away)
    raise AssertionError(f"no manoeuvre has room at the start of {case.name}")


def _plan(case: Scenario, name: str, commands: object, track: Trajectory, clearance_m: float) -> Plan:
    half = len(commands) // 2
    return Plan(
        area=case.area,
        commands=commands,
        trajectory=track,
        legs=(Leg(kind="primitive", name=name, first=0, last=half),
              Leg(kind="reposition", name="goal", first=half, last=len(commands))),
        reposition_bound_s=0.0,
        leave_water_probability=None,
        design_efficiency_realised=None,
        verification=Verification(
            clearance_min_m=clearance_m, clearance_time_s=0.0, reproduction_error_m=0.0, limit_excess=0.0, problems=()
        ),
    )  # fmt: skip


@pytest.fixture(scope="module", params=SCENARIOS, ids=lambda path: path.stem)
def short(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Scenario, Path]:
    """A scenario, and a folder with the files of its stand-in."""
    case = loaded(request.param)
    folder = tmp_path_factory.mktemp(case.name)
    plan = stand_in(case)
    about = {"scenario": case.name, "vessel": case.vessel, "environment": case.environment}
    track = planned_track(plan, clearance_m=case.plan.clearance_m, **about)
    for build, place in ((build_bridge_route, folder), (build_route, folder / "fine")):
        route = build(track, safe_water=case.area.water)
        place.mkdir(exist_ok=True)
        for name, content in route_files(route, [known.name for known in FORMATS]).items():
            (place / name).write_bytes(content)
        (place / "track.csv").write_text(track_csv(plan))
    (folder / "plan.json").write_text(plan_json(plan, clearance_m=case.plan.clearance_m, **about))
    return case, folder


def look_at(case: Scenario, folder: Path) -> None:
    """Everything that is asked of the route files in a folder."""
    obey_their_schemas(folder)
    obey_their_guides(folder)
    bring_the_track_back(case, folder)
    leave_room_to_the_shore(case, folder)


def obey_their_schemas(folder: Path) -> None:
    for name in ("route.rtz", "route-rtz10.rtz", "route-rtz11.rtz", "route.gpx"):
        path = folder / name
        if not path.exists():
            continue
        assert check_route_file(path) == []
        etree.XMLSchema(etree.parse(SAMPLES / XSD[name])).assertValid(etree.parse(path))


def obey_their_guides(folder: Path) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.validate(json.loads((folder / "route.plan").read_text()), PLAN_SCHEMA)
    assert gpxpy.parse((folder / "route.gpx").read_text()).routes[0].points
    features = json.loads((folder / "route.geojson").read_text())["features"]
    polygons = [feature["geometry"]["coordinates"] for feature in features if feature["geometry"]["type"] == "Polygon"]
    assert polygons
    for outer, *holes in polygons:
        assert shapely.LinearRing(outer).is_ccw
        assert not any(shapely.LinearRing(hole).is_ccw for hole in holes)


def bring_the_track_back(case: Scenario, folder: Path) -> None:
    """The line through the positions of every file lies in the allowed water and within its distance of the track."""
    frame, (xtd_m,) = case.area.frame, {float(row["xtd_m"]) for row in rows(folder / "route.csv")}
    track = np.array([(float(row["lat_deg"]), float(row["lon_deg"])) for row in rows(folder / "track.csv")])
    points = shapely.points(frame.to_metres(track)[:, ::-1])
    for known in FORMATS:
        path = folder / known.file_name
        if not path.exists():
            continue
        read = np.array(READERS[known.name](path.read_bytes()))
        line = shapely.LineString(frame.to_metres(read)[:, ::-1])
        assert case.area.water.covers(line), known.name
        assert shapely.distance(points, line).max() <= xtd_m, known.name


def leave_room_to_the_shore(case: Scenario, folder: Path) -> None:
    """The corridor of every leg lies in the allowed water, and holds the track of the leg's time."""
    table, track = rows(folder / "route.csv"), rows(folder / "track.csv")
    points = np.array([(float(row["north_m"]), float(row["east_m"])) for row in track])
    times = np.array([float(row["time_s"]) for row in track])
    for one, two in pairwise(table):
        start, end = (np.array([float(row["north_m"]), float(row["east_m"])]) for row in (one, two))
        sides = float(two["xtd_port_m"]), float(two["xtd_starboard_m"])
        assert case.area.water.covers(corridor(start, end, sides))
        sailed = (times >= float(one["time_s"])) & (times <= float(two["time_s"]) + float(two["stay_s"]))
        needed = sides_needed(points[sailed], start, end)
        assert needed[0] <= sides[0] + 1e-3
        assert needed[1] <= sides[1] + 1e-3


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_files_are_valid_in_the_water_and_near_the_track(short: tuple[Scenario, Path]) -> None:
    case, folder = short
    look_at(case, folder)
    look_at(case, folder / "fine")


@pytest.mark.filterwarnings("ignore")
def test_pymavlink_reads_every_waypoint(short: tuple[Scenario, Path]) -> None:
    _, folder = short
    mavwp = pytest.importorskip("pymavlink.mavwp")
    loader = mavwp.MAVWPLoader()
    loader.load(str(folder / "route.waypoints"))
    places = [(p.x, p.y) for p in map(loader.wp, range(1, loader.count())) if p.command == NAV_WAYPOINT]
    expected = [(float(row["lat_deg"]), float(row["lon_deg"])) for row in rows(folder / "route.csv")]
    assert np.abs(np.array(places) - expected).max() < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_files_of_the_whole_trial_are_valid_in_the_water_and_near_the_track(path: Path, tmp_path: Path) -> None:
    workflows.run(path, tmp_path, seed=1)
    look_at(loaded(path), tmp_path)
    workflows.export(tmp_path / "plan.json", tmp_path / "again", formats=[known.name for known in FORMATS])
    (tmp_path / "again" / "track.csv").write_bytes((tmp_path / "track.csv").read_bytes())
    look_at(loaded(path), tmp_path / "again")
    assert read_plan(tmp_path / "plan.json").scenario == loaded(path).name
