"""Are whole days as accurate as stated? Standard deviations of estimates from simulated days, over those stated.

``python tests/benchmarks/stated_accuracy.py [--trials N]``: the shortest day of the story, with seed 1, is planned for
an unknown steady current, as its forecast says. Its commands are sailed by the nominal ship so often, each time with
other noise of the sensors, and with another current. Parameters are estimated from the whole track, legs included, by
the method named, as by `expdesign estimate`. "Report" are the standard deviations to first order in the noise, those of
the report for iv-current; "limit" are those that `[design.accuracy] std` counts with, which take the noise of samples
one after the other for independent. In weather that varies, the report's count only what is white.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from expdesign.information.prior import equation_noise
from expdesign.plan.verify import about_ship, track_information
from expdesign.scenario import load_scenario
from expdesign.shortest_day import AccuracySettings
from expdesign.simulation import CALM, Environment, Variation
from expdesign.workflows.steps.day import planned_day
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.scored import scored
from whole_days import chance, simulated_days

STORY = Path(__file__).parents[2] / "scenarios" / "story.toml"
WEATHERS = {
    "calm": CALM,
    "current that wanders by 0.02 m/s in 30 s": Environment(
        current_variation=Variation(std_mps=0.02, correlation_s=30.0)
    ),
    "unknown steady current, 0.15 m/s": Environment(current_std_mps=0.15),
}
TRIED = (
    ("calm", "iv-current"),
    ("unknown steady current, 0.15 m/s", "iv-current"),
    ("unknown steady current, 0.15 m/s", "iv"),
    ("current that wanders by 0.02 m/s in 30 s", "iv-current"),
)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=500)
    trials = parser.parse_args().trials
    case = load_scenario(STORY)
    case = replace(case, design=replace(case.design, accuracy=AccuracySettings(as_durations=True)))
    information = scored(case)
    day = planned_day(case, information, designed(case, information, seed=1), seed=1)
    problem = day.design.problem
    told = about_ship(problem, track_information(case.vessel, problem, case.environment, day.plan.sailed).sum(axis=0))
    p = len(problem.parameters)
    limit = equation_noise(case.vessel, problem.parameters) * np.sqrt(np.diag(np.linalg.inv(told))[:p])
    print(f"{trials} days of {day.plan.day.planned_s:.0f} s each; chance: {chance(trials):.1%}\n")
    print("| weather | method | parameter | found | over the report's | over the limit's | in 95 % intervals |")
    print("|---|---|---|---|---|---|---|")
    for name, method in TRIED:
        found = simulated_days(case, day.plan, trials=trials, environment=WEATHERS[name], method=method, seed=3)
        for k, parameter in enumerate(found.parameters):
            print(
                f"| {name} | {method} | {parameter} | {found.found[k]:.3g} | {found.found[k] / found.forecast[k]:.2f} "
                f"| {found.found[k] / limit[k]:.2f} | {found.coverage[k]:.1%} |",
                flush=True,
            )
