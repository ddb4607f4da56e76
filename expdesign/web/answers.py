"""What pages ask of files at once: the chart, the clearance of a place, the convex durations, a track to play.

Each function takes a path and returns plain values, ready for JSON, so that it may run in another process. Nothing is
computed here: the functions of the command line's workflows are.
"""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from expdesign.conventions import to_n_frame
from expdesign.errors import FileError, InputError, NoAnswer
from expdesign.export.words import names as names_of_runs
from expdesign.information import PrimitiveInformation
from expdesign.input_files import check_ends
from expdesign.memory import digest
from expdesign.plan.values import PlanSettings
from expdesign.scenario import Scenario, load_scenario
from expdesign.scenario.charts import load_area
from expdesign.scenario.tables import Entry, read_toml
from expdesign.scenario.vessels import load_vessel
from expdesign.sea_area import SeaArea
from expdesign.values import Array

Answer = dict[str, Any]

DEGREE_DECIMALS = 7  # about a centimetre
MOST_PLAYED = 40_000  # samples of a track that are sent at most; more are thinned
TRACK_POINTS = 120  # points of a manoeuvre's sketch


def chart_of(area_file: str, draught_m: float) -> Answer:
    """Land, allowed water, depths and named zones of an area file as GeoJSON; or what is wrong with it.

    Args:
        draught_m: of the ship, which decides what is deep enough.
    """
    try:
        area = _area(area_file, _stamp(area_file), draught_m)
        zones = read_toml(Path(area_file)).get("no_go", [])
    except (InputError, NoAnswer) as error:
        return wrong(error)
    south, west, north, east = _box(area)
    return {
        "name": area.name,
        "bounds": [[south, west], [north, east]],
        "layers": [
            {"kind": "water", "geometry": _degrees(area, area.water)},
            *({"kind": "depth", "depth_m": depth, "geometry": _degrees(area, part)} for depth, part in area.depths),
            {"kind": "forbidden", "geometry": _degrees(area, _forbidden(area))},
            {"kind": "land", "geometry": _degrees(area, area.land)},
        ],
        "zones": zones,
        "closed": [
            {"name": name, "geometry": _degrees(area, part)}
            for name, part in area.named
            if name not in [zone["name"] for zone in zones]
        ],
        "notes": [area.depth_rule, *area.notes, area.source],
        "corners": int(shapely.get_num_coordinates(area.water)),
    }


def ends_of(scenario: str) -> Answer:
    """Start and goal of a scenario in degrees, the hull, and what is wrong with either; or with a file."""
    try:
        tables, area, draught, hull = _parts(scenario)
        return {
            "length_m": float(np.ptp(hull[:, 0])),
            "beam_m": float(np.ptp(hull[:, 1])),
            "clearance_m": tables.get("plan", {}).get("clearance_m", PlanSettings.clearance_m),
            "draught_m": draught,
            "ends": {key: _end(tables[key], area) for key in ("start", "goal")},
        }
    except (InputError, NoAnswer) as error:
        return wrong(error)


def clearance_of(scenario: str, lat_deg: float, lon_deg: float, heading_deg: float) -> Answer:
    """Distance of the hull from forbidden water at a place [m]; 0 where it is in forbidden water."""
    try:
        _, area, _, hull = _parts(scenario)
    except (InputError, NoAnswer) as error:
        return wrong(error)
    pose = np.array([*area.frame.to_metres(np.array([lat_deg, lon_deg])), np.radians(heading_deg)])
    outline = shapely.Polygon(to_n_frame(hull, pose)[:, ::-1])
    inside = bool(area.water.covers(outline))
    return {"inside": inside, "clearance_m": float(outline.distance(area.water.boundary)) if inside else 0.0}


def problem_of(scenario: str) -> Answer:
    """What a command would refuse in a scenario; nothing where it would begin."""
    try:
        case = load_scenario(scenario)
    except (InputError, NoAnswer) as error:
        return wrong(error)
    return {"remarks": list(case.remarks), "notes": list(case.area.notes), "vessel": case.vessel.name}


def durations_of(scenario: str) -> Answer:
    """The convex durations of a scenario's design as it stands, with the certificate and what each run tells.

    The accuracy that a shortest day must reach and the search for more manoeuvres are left aside, and named: these are
    the durations of the dictionary in `total_s`.
    """
    from expdesign.durations import bordered, pool_gains
    from expdesign.workflows.steps.design_problem import designed

    try:
        case = load_scenario(scenario)
        aside = [key for key in ("accuracy", "grow") if getattr(case.design, key) is not None]
        case = replace(case, design=replace(case.design, grow=None, accuracy=None))
        information = _scored(case)
        matrices = np.array([bordered(item, case.design.mean_subtraction) for item in information])
        shares = 1.0 + pool_gains(matrices) / matrices.shape[1]
        design = designed(case, information)
    except (InputError, NoAnswer) as error:
        return wrong(error)
    problem, proof = design.problem, design.certificate
    names = names_of_runs((run.name, run.family, run.settings) for run in (item.primitive for item in information))
    return {
        "criterion": problem.aim.criterion,
        "total_s": problem.total_s,
        "efficiency_at_least": float(np.exp(-design.gap_relative)),
        "theorem": proof.kind,
        "efficiency_repeats": design.efficiency_repeats,
        "efficiency_uniform": design.efficiency_uniform,
        "note": design.note,
        "aside": aside,
        "excluded": list(case.design.limits.excluded),
        "runs": [
            {
                "name": item.primitive.name,
                "words": names[item.primitive.name],
                "family": item.primitive.family,
                "run_s": item.primitive.duration_s,
                "duration_s": float(seconds),
                "repeats": int(repeats),
                "of_average": None if np.isnan(share) else float(share),  # information per second, in all parameters
                "track": _sketch(item.primitive.trajectory.pose),
            }
            for item, seconds, repeats, share in zip(
                information, design.durations_s, design.repeats, shares, strict=True
            )
        ],
    }


def played(plan: str) -> Answer:
    """The track of a plan in degrees, with headings, commands and velocities, and its legs; or what is wrong.

    Of a draft, which nobody sails, only where its legs are.
    """
    path = Path(plan)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content.get("draft"):
            names = said(path)
            return {
                "sketch": [
                    {"kind": leg["kind"], "name": names.get(leg["name"], leg["name"]), "places": leg["sketch_deg"]}
                    for leg in content["legs"]
                ]
            }
        track = path.with_name("track.csv")
        check_ends(track, "a track")
        header = track.open(encoding="utf-8").readline().strip().split(",")
        rows = np.loadtxt(track, delimiter=",", skiprows=1, ndmin=2)
        inputs = path.with_name("commands.csv").open(encoding="utf-8").readline().strip().split(",")[1:-1]
        orders = np.loadtxt(path.with_name("commands.csv"), delimiter=",", skiprows=1, ndmin=2)
    except (OSError, ValueError, KeyError) as error:
        return {"problem": f"{plan} has no track beside it that can be played: {error}"}
    step = max(1, -(-len(rows) // MOST_PLAYED))
    columns = {name: np.round(rows[::step, index], 8).tolist() for index, name in enumerate(header)}
    held = np.minimum(np.arange(0, len(rows), step), len(orders) - 1)  # the last order stands at the last sample
    commands = {name: np.round(orders[held, 1 + index], 5).tolist() for index, name in enumerate(inputs)}
    names = said(path)
    return {
        "scenario": content["scenario"],
        "verified": content["verified"],
        "verdict": content["verdict"],
        "length_m": content["vessel"]["length_m"],
        "beam_m": content["vessel"]["beam_m"],
        "columns": columns,
        "commands": commands,
        "legs": [
            {"kind": leg["kind"], "name": names.get(leg["name"], leg["name"]), "duration_s": leg["duration_s"]}
            for leg in content["legs"]
        ],
        "informative_s": content["informative_s"],
        "reposition_s": content["reposition_s"],
    }


def said(plan: Path) -> dict[str, str]:
    """Names of the runs of a plan as people say them, by the dictionary beside it; none where there is none."""
    try:
        runs = json.loads(plan.with_name("dictionary.json").read_text(encoding="utf-8"))["primitives"]
        return names_of_runs((run["name"], run["family"], run["settings"]) for run in runs)
    except (OSError, ValueError, KeyError):
        return {}


def wrong(error: Exception) -> Answer:
    """What is wrong, with the key of the file where it is."""
    found = {"problem": str(error)}
    if isinstance(error, FileError):
        found |= {"file": str(error.path), "key": error.key, "why": error.problem}
    return found


@lru_cache(maxsize=8)
def _area(area_file: str, stamp: int, draught_m: float) -> SeaArea:
    return load_area(area_file, draught_m=draught_m)


SCORED: dict[str, tuple[PrimitiveInformation, ...]] = {}
"""Dictionaries that were scored before, by all that this depends on."""
MOST_SCORED = 8


def _scored(case: Scenario) -> tuple[PrimitiveInformation, ...]:
    """The scored dictionary; at once where only limits, criterion or time have changed."""
    from expdesign.workflows.steps.scored import scored

    design = case.design
    settings = design.fixed_parameters, design.mean_subtraction, design.excitation
    key = digest(case.vessel, case.dictionary, case.environment, settings)
    if key not in SCORED:
        while len(SCORED) >= MOST_SCORED:
            SCORED.pop(next(iter(SCORED)))
        SCORED[key] = scored(case)
    return SCORED[key]


def _stamp(path: str) -> int:
    """Changes when the area file, or a chart beside it, does."""
    try:
        return hash(tuple(sorted((item.name, item.stat().st_mtime_ns) for item in Path(path).parent.iterdir())))
    except OSError:
        return 0


def _parts(scenario: str) -> tuple[dict[str, Any], SeaArea, float, Array]:
    """Tables of a scenario, its area, and the draught and hull of its vessel, whether or not its ends have room."""
    entry = Entry(Path(scenario))
    tables = read_toml(entry.path)
    files = tables.get("scenario", {})
    for key in ("vessel", "area"):
        if not isinstance(files.get(key), str):
            raise entry.at(f"scenario.{key}").error("is missing, expected the path of a file")
    vessel = load_vessel(entry.at("scenario.vessel").file(files["vessel"]))
    path = str(entry.at("scenario.area").file(files["area"]))
    return tables, _area(path, _stamp(path), vessel.draught_m), vessel.draught_m, vessel.hull_b


def _end(place: dict[str, Any], area: SeaArea) -> Answer:
    if "lat_deg" in place:
        lat, lon = place["lat_deg"], place["lon_deg"]
    else:
        lat, lon = area.frame.to_degrees(np.array([place["north_m"], place["east_m"]])).tolist()
    return {"lat_deg": lat, "lon_deg": lon, "heading_deg": place["heading_deg"]}


def _forbidden(area: SeaArea) -> shapely.Geometry:
    """Water inside the bounds where the trial may not be."""
    bounds = shapely.box(*shapely.union(area.water, area.land).bounds)
    return shapely.difference(shapely.difference(bounds, area.water), area.land)


def _box(area: SeaArea) -> tuple[float, float, float, float]:
    west, south, east, north = area.water.bounds
    low, high = area.frame.to_degrees(np.array([[south, west], [north, east]])).tolist()
    return (*low, *high)


def _degrees(area: SeaArea, geometry: shapely.Geometry) -> Answer:
    """A geometry in metres as a GeoJSON geometry in degrees."""

    def turned(points: Array) -> Array:
        return np.round(area.frame.to_degrees(points[:, ::-1])[:, ::-1], DEGREE_DECIMALS)

    found: Answer = json.loads(shapely.to_geojson(shapely.transform(geometry, turned)))
    return found


def _sketch(pose: Array) -> list[list[float]]:
    """(east, -north) of a track, thinned, for a drawing with x to the right and y down."""
    points = pose[:: max(1, len(pose) // TRACK_POINTS), :2]
    return np.round(points[:, ::-1] * [1.0, -1.0], 2).tolist()  # type: ignore[no-any-return]


CHANGE = re.compile(
    r"(?:with )?(plan|design|start|goal|environment)\.(\w+) = (\[[^\]]*\]|'[^']*'|-?[\d.]+(?:e-?\d+)?)(?=[ ,;]|$)"
)
"""A change of one key at the beginning of a remedy."""


def change_in(remedy: str) -> tuple[tuple[str, str], Any] | None:
    """The table, key and value that a remedy of a refusal changes; None where it is no change of one key."""
    found = CHANGE.match(remedy)
    if found is None:
        return None
    return (found[1], found[2]), tomllib.loads(f"value = {found[3]}")["value"]
