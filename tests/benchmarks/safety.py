"""Whole trials of drawn ships in drawn weather: how many leave allowed water or are aborted, and what time it costs.

Run with the package installed: ``python tests/benchmarks/safety.py [DRAWS] [SCENARIO.toml ...]``, by default 500 draws
of all examples; `--jobs` and `--scheduler` share them. One draw is one trial, sailed by the procedure of
`expdesign.plan.monte_carlo.procedure`; the hull is looked at against the chart at every step, of runs, of legs and of
go-arounds alike. The draws are others than the plan's own.

Each scenario is sailed four times: in the weather it forecasts; with current and wind that besides wander slowly
(Gauss-Markov, `WANDERING`), which the plan knew nothing of; in the forecast weather with *legs as planned*, none
parallel to them; and *without go-arounds*: every run begins wherever the ship is. The last two show what the procedure
is worth. A table in Markdown ends the output.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign import workflows
from expdesign.plan import Plan
from expdesign.plan.assembly import leg_water, ship_on_legs
from expdesign.plan.legs.water import LegWater
from expdesign.plan.monte_carlo import guidance, risk
from expdesign.plan.monte_carlo.procedure import Tolerances
from expdesign.plan.monte_carlo.risk import estimate_risk, upper_limit
from expdesign.plan.values import RiskEstimate
from expdesign.processes import in_order
from expdesign.scenario import load_scenario
from expdesign.scenario.values import Scenario
from expdesign.simulation import Environment, Variation
from expdesign.workflows import plan_problem
from shared_work import add_sharing, shared_work

SCENARIOS = Path(__file__).parents[2] / "scenarios"
WANDERING = 1.0, 300.0
"""How much current and wind wander, in the standard deviations with which their means are known, and how slowly [s]."""
AT_ALL = 1e6  # value of all tolerances with which every ship begins at once, in the units of each


def wandering(forecast: Environment) -> Environment:
    """The same forecast with weather that wanders as much as it is uncertain."""
    share, memory_s = WANDERING
    return replace(
        forecast,
        current_variation=Variation(std_mps=share * forecast.current_std_mps, correlation_s=memory_s),
        wind_variation=Variation(std_mps=share * forecast.wind_std_mps, correlation_s=memory_s),
    )


@contextmanager
def as_planned() -> Iterator[None]:
    """No ship sails parallel to a leg."""
    kept = guidance.PARALLEL_SHARE
    guidance.PARALLEL_SHARE = 0.0
    try:
        yield
    finally:
        guidance.PARALLEL_SHARE = kept


@contextmanager
def unbroken() -> Iterator[None]:
    """Tolerances so wide that no ship ever goes around; legs as planned."""
    kept = risk.tolerances
    wide = Tolerances(position_m=AT_ALL, heading_rad=AT_ALL, speed_mps=AT_ALL, yaw_rate_radps=AT_ALL)
    risk.tolerances = lambda water, spare_m: wide
    try:
        with as_planned():
            yield
    finally:
        risk.tolerances = kept


def water_of(case: Scenario, plan: Plan) -> LegWater:
    """Vessel, weather and water of the plan."""
    information = workflows.scored(case)
    problem = plan_problem(case, information, workflows.designed(case, information))
    return leg_water(problem, ship_on_legs(problem))


def row(name: str, kind: str, found: RiskEstimate, planned_s: float) -> str:
    """A line of the table."""
    count = round(found.left * found.trials)
    return (
        f"| {name} | {kind} | {found.left:.1%} (< {upper_limit(count, found.trials):.1%}) | {found.aborted:.1%} | "
        f"{planned_s:.0f} s | {found.extra_median_s:.0f} s | {found.extra_most_s:.0f} s |"
    )


def report(draws: int, path: Path) -> tuple[list[str], list[str]]:
    """Plan a scenario and sail it: the lines of the table, and what happens leg by leg."""
    case = load_scenario(path)
    information = workflows.scored(case)
    plan = workflows.planned(case, information, workflows.designed(case, information))
    calm = water_of(case, plan)
    wanders = replace(calm, environment=wandering(case.environment))
    kinds = {
        "as forecast": (calm, nullcontext, 7),
        "wandering": (wanders, nullcontext, 8),
        "legs as planned": (calm, as_planned, 7),
        "without go-arounds": (calm, unbroken, 9),
    }
    rows, told = [], []
    for kind, (water, changed, seed) in kinds.items():
        with changed():
            found = estimate_risk(water, plan.sailed, draws=draws, rng=np.random.default_rng(seed))[0]
        rows.append(row(case.name, kind, found, plan.commands.duration_s))
        told.append("\n  ".join([rows[-1], *found.reasons]))
        for leg, sails in zip(plan.legs, found.legs, strict=True):
            told.append(
                f"    {leg.kind:10s} {leg.name:28s} left {sails.left:6.2%} aborted {sails.aborted:6.2%} "
                f"go-arounds {sails.go_arounds:4.2f} takes {sails.median_s:7.1f} s, {sails.most_s:7.1f} s in 95 %"
            )
    return rows, told


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("draws", nargs="?", type=int, default=500)
    parser.add_argument("scenarios", nargs="*", type=Path, default=sorted(SCENARIOS.glob("*.toml")))
    add_sharing(parser)
    chosen = parser.parse_args()
    lines = []
    with shared_work(chosen):
        for rows, told in in_order(report, (chosen.draws,), ((path,) for path in chosen.scenarios)):
            lines += rows
            print(*told, sep="\n", file=sys.stderr, flush=True)
    print("\n| scenario | weather | left water (95 %) | aborted | plan | extra time, median | extra time, 95 % |")
    print("|---|---|---|---|---|---|---|", *lines, sep="\n")
