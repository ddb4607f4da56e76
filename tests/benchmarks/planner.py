"""Plans of every example scenario: how good they are.

Run from anywhere with the package installed: ``python tests/benchmarks/planner.py [SCENARIO.toml ...]``, by default all
of `scenarios/`. One row each: whether the plan is verified, least clearance, repositioning time, its lower bound and
their ratio, the time in percent of the informative time, the repositioning time of the lattice planner by its own rule
with its proved bound and the share of it that the plan takes. What the plans cost is in `main_job.py`.

With ``--charts FOLDER`` two real charts with depths are planned on instead, those of them that the folder holds: half
an hour of trials of the 30 m ship, 2.5 m draught, through the sounds of Alesund (`aalesund.geojson`) and out of
Commencement Bay (the S-57 cell `US5WA22M.000`).

With ``--paths`` every scenario is planned by OMPL and by the visibility graph, one after the other: repositioning and
its bound, probability of leaving the water, least clearance, day as planned and the median of drawn trials, wall and
processor seconds, and what found the paths. With ``--other CHECKOUT [--seeds N ...]`` the same with the version of
another checkout and with this one, in turn, seed by seed.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import get_args

from expdesign import workflows
from expdesign.errors import NoPlan
from expdesign.plan.assembly import leg_water, search_space, ship_on_legs
from expdesign.plan.local_planner import Departure, local_planner
from expdesign.plan.search.planners import placed_on_lattice
from expdesign.plan.values import PathsName
from expdesign.scenario import load_scenario
from expdesign.workflows import plan_problem
from main_job import ROOT, SCENARIOS, MainJob, main_job

SEABED = ", ".join(f"seabed{depth}m = {depth}" for depth in (0, 5, 10, 20, 50, 100, 200, 350))
CHARTS = {
    "aalesund": (
        "aalesund.geojson",
        f'geojson = "{{chart}}"\nland_layers = ["land", "shore"]\ndepth_layers = {{{{{SEABED}}}}}',
        (62.45797, 6.23991, 62.44889, 6.14436),
    ),
    "tacoma": ("US5WA22M.000", 's57 = "{chart}"', (47.27225, -122.44194, 47.31352, -122.46154)),
}
"""File, chart table, and latitude and longitude of start and goal."""
SCENARIO = """
[scenario]
name = "{name}"
vessel = "{folder}/vessels/azimuth-30m.toml"
dictionary = "{folder}/dictionaries/standard.toml"
area = "{name}-area.toml"
[design]
total_s = 1800.0
criterion = "D"
mean_subtraction = "complete"
[start]
lat_deg = {ends[0]}
lon_deg = {ends[1]}
heading_deg = 90.0
[goal]
lat_deg = {ends[2]}
lon_deg = {ends[3]}
heading_deg = 0.0
[environment]
current_to = {{north_mps = 0.0, east_mps = 0.0, std_mps = 0.05}}
wind_to = {{north_mps = 3.0, east_mps = 2.0, std_mps = 1.0}}
[plan]
clearance_m = 20.0
confidence = 0.95
"""


def charted(charts: Path, folder: Path) -> Iterator[Path]:
    """Scenario files on the real charts that are there, written into a folder."""
    for name, (file, table, ends) in CHARTS.items():
        if (charts / file).exists():
            chart = table.format(chart=(charts / file).resolve())
            (folder / f"{name}-area.toml").write_text(f'[area]\nname = "{name}"\n[chart]\n{chart}\n', "utf-8")
            path = folder / f"{name}.toml"
            path.write_text(SCENARIO.format(name=name, folder=SCENARIOS.resolve(), ends=ends), "utf-8")
            yield path


def lattice_s(scenario: Path) -> tuple[float, float] | None:
    """Repositioning time of the lattice planner on the same problem, and its bound; None where it finds no plan."""
    case = load_scenario(scenario)
    information = workflows.scored(case)
    problem = plan_problem(case, information, workflows.designed(case, information))
    water = leg_water(problem, ship_on_legs(problem))
    space = search_space(problem, water, local_planner(water, problem.used))
    counts = [problem.repeats[item.name] for item in space.footprints]
    try:
        proof = placed_on_lattice(space, counts, Departure(pose=problem.start)).lattice
    except NoPlan:
        return None
    return None if proof is None else (proof.cost_s, proof.lower_bound_s)


def row(scenario: Path) -> str:
    """One line of the table."""
    facts = main_job(scenario).summary
    lattice = lattice_s(scenario)
    spent_s, bound_s = facts["repositioning_s"], facts["repositioning_bound_s"]
    beside = "no plan | -" if lattice is None else f"{lattice[0]:.0f} s ({lattice[1]:.0f}) | {spent_s / lattice[0]:.2f}"
    ratio = f"{spent_s / bound_s:.2f}" if bound_s > 0.1 * facts["informative_s"] else "-"
    return (
        f"| {scenario.stem} | {facts['verified']} | {facts['least_clearance_m']:.1f} m | {spent_s:.0f} s "
        f"| {bound_s:.0f} s | {ratio} | {spent_s / facts['informative_s']:.0%} | {beside} |"
    )


def path_rows(scenario: Path) -> Iterator[str]:
    """A line for each value of the key `plan.paths`."""
    for way in get_args(PathsName):
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(shutil.copytree(scenario.parent, Path(folder) / "scenarios")) / scenario.name
            copy.write_text(scenario.read_text("utf-8").replace("[plan]\n", f'[plan]\npaths = "{way}"\n'), "utf-8")
            yield told(scenario.stem, way, main_job(copy))


def version_rows(scenario: Path, other: Path, seed: int) -> Iterator[str]:
    """A line for the version of another checkout, and one for this; with odd seeds this one runs first."""
    versions = [("before", other), ("now", ROOT)]
    for name, version in versions if seed % 2 == 0 else versions[::-1]:
        yield told(f"{scenario.stem}, seed {seed}", name, main_job(scenario, seed=seed, version=version))


def told(of: str, which: str, job: MainJob) -> str:
    """A line of what a job took and gave."""
    facts, found = job.summary, ", ".join(f"{count} {source}" for source, count in sorted(job.paths.items()))
    day_s = facts["informative_s"] + facts["repositioning_s"]
    return (
        f"| {of} | {which} | {facts['repositioning_s']:.0f} ({facts['repositioning_bound_s']:.0f}) s "
        f"| {facts['leave_water_probability']:.3f} | {facts['least_clearance_m']:.1f} m "
        f"| {day_s:.0f} ({day_s + facts['extra_time_median_s']:.0f}) s | {job.wall_s:.0f} s "
        f"| {sum(job.phase_s.values()):.1f} s | {found} |"
    )


TOLD = (
    "scenario",
    "of",
    "repositioning (bound)",
    "leaves",
    "clearance",
    "day (median)",
    "wall",
    "processor",
    "found by",
)
PLANS = ("scenario", "verified", "clearance", "repositioning", "bound", "ratio", "of informative", "lattice (bound)",
         "of lattice")  # fmt: skip

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", nargs="*", type=Path)
    parser.add_argument("--charts", type=Path)
    parser.add_argument("--paths", action="store_true")
    parser.add_argument("--other", type=Path, metavar="CHECKOUT")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0], help="of --other")
    wished = parser.parse_args()
    examples = [] if wished.charts else sorted(SCENARIOS.glob("*.toml"))
    print("|", " | ".join(TOLD if wished.paths or wished.other else PLANS), "|")
    print("|---" * 9 + "|")
    with tempfile.TemporaryDirectory() as written:
        extra = [] if wished.charts is None else list(charted(wished.charts, Path(written)))
        for scenario in [*(wished.scenarios or examples), *extra]:
            if wished.other:
                lines = chain.from_iterable(version_rows(scenario, wished.other, seed) for seed in wished.seeds)
            else:
                lines = path_rows(scenario) if wished.paths else iter([row(scenario)])
            for line in lines:
                print(line, flush=True)
