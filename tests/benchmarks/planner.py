"""Plans of every example scenario: how good, how long, how much memory.

Run from anywhere with the package installed: ``python tests/benchmarks/planner.py [SCENARIO.toml ...]``, by default all
of `scenarios/`. One row each: whether the plan is verified, least clearance, repositioning time, its lower bound and
their ratio, the time in percent of the informative time, processor seconds and peak memory of the whole job.
"""

from __future__ import annotations

import sys
from pathlib import Path

from main_job import SCENARIOS, baseline_s, main_job


def row(scenario: Path, unit_s: float) -> str:
    """One line of the table."""
    wall_s, busy_s, peak_mib, facts = main_job(scenario)
    spent_s, bound_s = facts["repositioning_s"], facts["repositioning_bound_s"]
    ratio = f"{spent_s / bound_s:.2f}" if bound_s > 0.1 * facts["informative_s"] else "-"
    return (
        f"| {scenario.stem} | {facts['verified']} | {facts['least_clearance_m']:.1f} m | {spent_s:.0f} s "
        f"| {bound_s:.0f} s | {ratio} | {spent_s / facts['informative_s']:.0%} | {wall_s:.0f} s | {busy_s:.0f} s "
        f"| {busy_s / unit_s:.0f} | {peak_mib:.0f} MiB |"
    )


if __name__ == "__main__":
    wanted = [Path(name) for name in sys.argv[1:]] or sorted(SCENARIOS.glob("*.toml"))
    unit = baseline_s()
    print(f"baseline loop {unit:.2f} s of processor time\n")
    print(
        "| scenario | verified | clearance | repositioning | bound | ratio | of informative | wall | processor "
        "| x baseline | memory |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for scenario in wanted:
        print(row(scenario, unit), flush=True)
