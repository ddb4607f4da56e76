"""The shortest day of the accuracy that the optimal durations in total_s would have, beside their own plan.

``python tests/benchmarks/shortest_day.py [SCENARIO.toml ...]``; each scenario is planned as it is and with
``[design.accuracy]`` added, both with seed 1. Information is that of the whole track as a share of what is needed. The
median and the 95th percentile are of the 500 drawn trials that end at the goal.
"""

from __future__ import annotations

import json
import resource
import shutil
import sys
import tempfile
from pathlib import Path

from expdesign import workflows

ROOT = Path(__file__).parents[2]
SCENARIOS = ROOT / "scenarios"
ASKED = '\n[design.accuracy]\nas = "durations"\n'


def days(plan: dict, summary: dict) -> tuple[float, float, float]:
    """The day as planned, its median and its 95th percentile [s]."""
    day_s = plan["informative_s"] + plan["reposition_s"]
    return day_s, day_s + summary["extra_time_median_s"], day_s + summary["extra_time_95_s"]


def planned(scenario: Path, folder: Path) -> tuple[dict, dict, float]:
    """plan.json and summary of a run, and the processor seconds that it took."""
    before_s = processor_s()
    summary = workflows.run(scenario, folder, seed=1, jobs=1, cache=False).summary
    return json.loads((folder / "plan.json").read_text("utf-8")), dict(summary), processor_s() - before_s


def processor_s() -> float:
    """Processor seconds of this process and its children."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


if __name__ == "__main__":
    given = [Path(item) for item in sys.argv[1:]] or [SCENARIOS / f"{name}.toml" for name in ("story", "helsinki")]
    print("| scenario | planned for | day | median | 95 % | in runs | information | of the plan | processor |")
    print("|---|---|---|---|---|---|---|---|---|")
    for path in given:
        first_s = None
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(shutil.copytree(path.parent, Path(folder) / "scenarios")) / path.name
            for what in ("total_s", "shortest day"):
                if what != "total_s":
                    copy.write_text(path.read_text("utf-8") + ASKED, "utf-8")
                plan, summary, seconds = planned(copy, Path(folder) / what)
                day_s, median_s, most_s = days(plan, summary)
                first_s = first_s or day_s
                print(
                    f"| {path.stem} | {what} | {day_s:.0f} s | {median_s:.0f} s | {most_s:.0f} s "
                    f"| {plan['informative_s']:.0f} s | {plan['design_efficiency_realised']:.2f} "
                    f"| {day_s / first_s:.2f} | {seconds:.0f} s |",
                    flush=True,
                )
