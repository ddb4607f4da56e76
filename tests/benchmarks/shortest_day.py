"""The shortest day of the accuracy that the optimal durations in total_s would have, beside their own plan.

``python tests/benchmarks/shortest_day.py [SCENARIO.toml ...] [--seed N] [--charts FOLDER] [--alone] [--starts N]``;
each scenario is planned as it is and with ``[design.accuracy]`` added, both with the same seed; with ``--alone`` only
the latter. With ``--starts`` it is the shortest of so many searches, made one after another here.
Information is that of the whole track as a share of what is needed. The median and the 95th percentile are of the 500
drawn trials that end at the goal. The bound is that on every day of the class that day.json describes. With
``--charts`` the real charts of `planner.py` that the folder holds are planned on instead.
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import tempfile
from pathlib import Path

from expdesign import workflows
from planner import charted

ROOT = Path(__file__).parents[2]
SCENARIOS = ROOT / "scenarios"
ASKED = '\n[design.accuracy]\nas = "durations"\n'


def days(plan: dict, summary: dict) -> tuple[float, float, float]:
    """The day as planned, its median and its 95th percentile [s]."""
    day_s = plan["informative_s"] + plan["reposition_s"]
    return day_s, day_s + summary["extra_time_median_s"], day_s + summary["extra_time_95_s"]


def planned(scenario: Path, folder: Path, seed: int) -> tuple[dict, dict, float]:
    """plan.json and summary of a run, and the processor seconds that it took."""
    before_s = processor_s()
    summary = workflows.run(scenario, folder, seed=seed, jobs=1, cache=False).summary
    return json.loads((folder / "plan.json").read_text("utf-8")), dict(summary), processor_s() - before_s


def processor_s() -> float:
    """Processor seconds of this process and its children."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def compared(path: Path, seed: int, ways: tuple[str, ...], starts: int) -> None:
    """Print a row for each way to plan a scenario."""
    first_s = None
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(shutil.copytree(path.parent, Path(folder) / "scenarios")) / path.name
        for what in ways:
            if what != "total_s":
                copy.write_text(f"{path.read_text('utf-8')}{ASKED}starts = {starts}\n", "utf-8")
            plan, summary, seconds = planned(copy, Path(folder) / what, seed)
            day_s, median_s, most_s = days(plan, summary)
            if what == "total_s":
                first_s = day_s
            share = f"{day_s / first_s:.2f}" if first_s else "-"
            over = f"{summary['day_over_bound']:.2f}" if "day_over_bound" in summary else "-"
            print(
                f"| {path.stem} | {seed} | {what} | {day_s:.0f} s | {median_s:.0f} s | {most_s:.0f} s "
                f"| {plan['informative_s']:.0f} s | {plan['design_efficiency_realised']:.2f} "
                f"| {share} | {over} | {seconds:.0f} s |",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("scenarios", nargs="*", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--charts", type=Path)
    parser.add_argument("--alone", action="store_true")
    parser.add_argument("--starts", type=int, default=1)
    asked = parser.parse_args()
    print(
        "| scenario | seed | planned for | day | median | 95 % | in runs | information | of the plan | over the bound ",
        end="",
    )
    print("| processor |\n|---|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as drawn:
        given = asked.scenarios or [SCENARIOS / f"{name}.toml" for name in ("story", "helsinki-hour")]
        for scenario in charted(asked.charts, Path(drawn)) if asked.charts else given:
            ways = ("shortest day",) if asked.alone else ("total_s", "shortest day")
            compared(scenario, asked.seed, ways, asked.starts)
