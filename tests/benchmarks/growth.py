"""How time and memory grow with the hours of runs, the candidates, the drawn trials, and the corners of the chart.

``python tests/benchmarks/growth.py [PART ...]``, by default all of `PARTS`. Every row is measured in a process of its
own: processor seconds, their ratio to the baseline of `baseline.py`, and peak memory. The exponent is that between a
row and the one before it: 1 where twice as much takes twice as long. The chart is 11 km wide, with as many islands as
each has corners.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from functools import partial
from pathlib import Path

import numpy as np
import shapely

from baseline import measured_baseline
from expdesign import __version__, workflows
from expdesign.dictionary import PrimitiveSpec, build_dictionary
from expdesign.information import score_primitives
from expdesign.plan import assembly
from expdesign.plan.chart import build_goal_distance
from expdesign.plan.control import Capability
from expdesign.plan.monte_carlo import estimate_risk
from expdesign.plan.values import PlanProblem
from expdesign.scenario import Scenario, load_scenario
from expdesign.sea_area import LocalFrame
from expdesign.workflows import plan_problem
from main_job import SCENARIOS

SHARES = 0.8, 1.0  # least and largest share of the settings of a manoeuvre of which candidates are made
SCALED = ("speed_mps", "turn_speed_mps", "sway_mps", "yaw_rate_radps")
CHART_M = 11_000.0  # width of the archipelago
APART_M = 2000.0  # distance between its start and goal at least
FRAME = LocalFrame(lat_deg=60.0, lon_deg=25.0)


def runs(hours: int) -> float:
    """Plan and verify so many hours of runs off Helsinki, one process."""
    case = load_scenario(SCENARIOS / "helsinki-hour.toml")
    longer = replace(case, design=replace(case.design, total_s=3600.0 * hours))
    began = _spent_s()
    information = workflows.scored(longer)
    workflows.planned(longer, information, workflows.designed(longer, information))
    return _spent_s() - began


def candidates(count: int) -> float:
    """Build and score so many candidates in the wind and a current."""
    case = load_scenario(SCENARIOS / "helsinki-hour.toml")
    kinds, shares = case.dictionary, np.linspace(*SHARES, -(-count // len(case.dictionary)))
    specs = [_scaled(kinds[index % len(kinds)], float(shares[index // len(kinds)]), index) for index in range(count)]
    environment = replace(case.environment, current_to=np.array([0.1, -0.05]))
    began = _spent_s()
    score_primitives(case.vessel, build_dictionary(case.vessel, specs), environment=environment)
    return _spent_s() - began


def _scaled(spec: PrimitiveSpec, share: float, index: int) -> PrimitiveSpec:
    settings = {name: share * value if name in SCALED else value for name, value in spec.settings.items()}
    return replace(spec, name=f"{spec.name}-{index}", settings=settings)


def draws(count: int) -> float:
    """Sail so many drawn trials of the plan of the story, one process."""
    case = load_scenario(SCENARIOS / "story.toml")
    information = workflows.scored(case)
    design = workflows.designed(case, information)
    plan, problem = workflows.planned(case, information, design), plan_problem(case, information, design)
    water = assembly.leg_water(problem, assembly.ship_on_legs(problem))
    began = _spent_s()
    estimate_risk(water, plan.sailed, rng=np.random.default_rng(1), draws=count)
    return _spent_s() - began


def loading(corners: int) -> float:
    """Read a chart of so many corners, and crop it to what a trial can reach."""
    with tempfile.TemporaryDirectory() as folder:
        scenario = archipelago(Path(folder), corners)
        began = _spent_s()
        case = load_scenario(scenario)
    loaded_s, problem = _spent_s() - began, _small_problem(case)
    began = _spent_s()
    next(assembly.waters(problem, assembly.ship_on_legs(problem)))
    return loaded_s + _spent_s() - began


def measuring(corners: int) -> float:
    """Measure the water that the trial can reach: clearance, lines of sight, and the distance to the goal."""
    near, ship = _near(corners)
    began = _spent_s()
    water = assembly.leg_water(near, ship)
    assert water.safe.area > 0
    assert build_goal_distance(water.narrowest_graph, water.field, near.goal[:2]) is not None
    return _spent_s() - began


def paths(corners: int, finder: str) -> float:
    """Find the paths of a leg across the rows of islands; the graph of the distance to the goal is there already."""
    near, ship = _near(corners)
    pitch_m = CHART_M / math.ceil(math.sqrt(math.isqrt(corners)))
    apart = math.ceil(APART_M / pitch_m)
    ends = near.start[:2], near.start[:2] + pitch_m * np.array([apart, max(1, apart // 2)])
    water = replace(assembly.leg_water(near, ship), paths=finder)
    assert water.narrowest_graph.shortest(*ends) is not None
    began = _spent_s()
    found = list(water.candidate_paths(*ends))
    spent_s = _spent_s() - began
    told = ", ".join(f"{path.length_m:.0f} m by {path.source}" for path in found)
    print(f"{corners} corners: {told}", file=sys.stderr)
    return spent_s


def _near(corners: int) -> tuple[PlanProblem, Capability]:
    """A trial in the part of a chart of so many corners that it can reach, and the ship on legs."""
    with tempfile.TemporaryDirectory() as folder:
        problem = _small_problem(load_scenario(archipelago(Path(folder), corners)))
    ship = assembly.ship_on_legs(problem)
    near = next(assembly.waters(problem, ship))
    print(f"{shapely.get_num_coordinates(near.water)} of {corners} corners are within reach", file=sys.stderr)
    return replace(problem, area=near), ship


def _small_problem(case: Scenario) -> PlanProblem:
    """The problem of an hour of runs, made without a plan."""
    information = workflows.scored(case)
    return plan_problem(case, information, workflows.designed(case, information))


def archipelago(folder: Path, corners: int) -> Path:
    """Write a chart of islands on a jittered grid, start and goal where its lines cross; the scenario's file."""
    rng, count = np.random.default_rng(0), math.isqrt(corners)
    side = math.ceil(math.sqrt(count))
    pitch_m = CHART_M / side
    cells = np.stack(np.divmod(np.arange(count), side), axis=1)
    middles = pitch_m * (cells + 0.5 + rng.uniform(-0.05, 0.05, (count, 2))) - CHART_M / 2
    angle = np.linspace(0, 2 * np.pi, count + 1)
    size, phase = rng.uniform(-1, 1, (3, count, 1)), rng.uniform(0, 7, (3, count, 1))
    waves = sum(size[k] * np.sin(n * angle + phase[k]) / n for k, n in enumerate((2, 3, 9)))
    radius_m = pitch_m * (0.2 + 0.04 * waves)
    rings = middles[:, None] + radius_m[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    land = [
        {"type": "Feature", "properties": {"layer": "land"}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
        for ring in np.round(FRAME.to_degrees(rings)[..., ::-1], 8).tolist()
    ]
    (folder / "chart.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": land}), "utf-8")
    south, west = FRAME.to_degrees(np.full(2, -CHART_M / 2))
    north, east = FRAME.to_degrees(np.full(2, CHART_M / 2))
    (folder / "area.toml").write_text(
        '[area]\nname = "archipelago"\n[chart]\ngeojson = "chart.geojson"\nland_layers = ["land"]\nnotice = "Drawn."\n'
        f"[bounds]\nsouth_deg = {south}\nwest_deg = {west}\nnorth_deg = {north}\neast_deg = {east}\n",
        "utf-8",
    )
    middle, apart = side // 2, math.ceil(APART_M / pitch_m)
    start, goal = FRAME.to_degrees(pitch_m * np.array([[middle - apart, middle], [middle, middle]]) - CHART_M / 2)
    example = (SCENARIOS / "helsinki-hour.toml").read_text("utf-8").replace("areas/helsinki.toml", "area.toml")
    for kind in ("vessels", "dictionaries"):
        example = example.replace(f'"{kind}/', f'"{SCENARIOS}/{kind}/')
    for before, after in zip(("60.1632", "24.9628", "60.1150", "24.9450"), (*start, *goal), strict=True):
        assert before in example
        example = example.replace(before, str(after))
    (folder / "archipelago.toml").write_text(example, "utf-8")
    return folder / "archipelago.toml"


PARTS: dict[str, tuple[Callable[[int], float], tuple[int, ...]]] = {
    "hours of runs": (runs, (1, 2, 4)),
    "candidates": (candidates, (10, 100, 1000, 10_000)),
    "drawn trials": (draws, (500, 5000, 100_000)),
    "corners of a chart, loading": (loading, (1000, 10_000, 100_000, 1_000_000)),
    "corners of a chart, measuring": (measuring, (1000, 10_000, 100_000, 1_000_000)),
    "corners of a chart, paths by OMPL": (partial(paths, finder="ompl"), (1000, 10_000, 100_000, 1_000_000)),
    "corners of a chart, paths by graph": (partial(paths, finder="graph"), (1000, 10_000, 100_000, 1_000_000)),
}


def _spent_s() -> float:
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def measured(part: str, size: int) -> tuple[float, float]:
    """Processor seconds and peak memory [MiB] of a row, in a process of its own that remembers nothing."""
    command = [sys.executable, __file__, "--row", str(size), part]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "EXPDESIGN_CACHE": "off"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as process:
        output = process.stdout.read() if process.stdout else b""
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{part}, {size}: exit status {process.returncode}")
    return float(output), usage.ru_maxrss / 1024


def rows(part: str, unit_s: float) -> None:
    """Print the lines of the table of a part."""
    before: tuple[int, float] | None = None
    for size in PARTS[part][1]:
        spent_s, peak_mib = measured(part, size)
        comparable = before is not None and min(spent_s, before[1]) > 0  # times are counted in hundredths
        grown = f"{math.log(spent_s / before[1]) / math.log(size / before[0]):.2f}" if comparable else "-"
        print(
            f"| {__version__} ({date.today()}) | {part}: {size:,} | {spent_s:.2f} s | {spent_s / unit_s:.1f} | {grown} "
            f"| {peak_mib:.0f} MiB |",
            flush=True,
        )
        before = size, spent_s


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help="; ".join(PARTS))
    parser.add_argument("--row", type=int, help="print the processor seconds of one size, spent by this process")
    chosen = parser.parse_args()
    if unknown := set(chosen.parts) - set(PARTS):
        parser.error(f"no part {', '.join(sorted(unknown))}; there are: {'; '.join(PARTS)}")
    if chosen.row:
        print(PARTS[chosen.parts[0]][0](chosen.row))
        raise SystemExit
    unit = measured_baseline().total_s
    print("| version | what grows | processor | x baseline | exponent | memory |")
    print("|---" * 6 + "|")
    for name in chosen.parts or PARTS:
        rows(name, unit)
