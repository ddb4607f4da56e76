"""Are whole days as accurate as stated? Standard deviations of estimates from simulated days, over those stated.

``python tests/benchmarks/stated_accuracy.py [--trials N]``: the shortest day of the story, with seed 1, is planned for
an unknown steady current, as its forecast says. Its commands are sailed by the nominal ship so often, each time with
other noise of the sensors, and with another current. Parameters are estimated from the whole track, legs included, by
the method named, as by `expdesign estimate`. "Report" are the standard deviations to first order in the noise, those of
the report for iv-current; "limit" are those of information that takes the noise of samples one after the other for
independent, as the criterion does. In weather that varies, the report's count only what is white.
With ``--asked`` the day is asked for by standard deviations and the interval of an outcome, and these are compared.
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
from expdesign.shortest_day import AccuracySettings, stated_accuracy
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


ASKED = AccuracySettings(relative_std={"X_u": 0.05, "N_r": 0.03}, outcomes_95={"advance_m": 0.6})
"""Of a day that is asked for by standard deviations and the 95 % interval of an outcome."""


def asked_and_found(case, information, design, trials):
    """Print what estimates from a day have of the standard deviations asked for, and of the outcome's interval."""
    ask = replace(case, design=replace(case.design, accuracy=ASKED))
    runs = tuple(item.primitive for item in information)
    limits = stated_accuracy(ASKED, design, case.vessel, runs, case.environment).limits
    plan = planned_day(ask, information, design, seed=1).plan
    days = simulated_days(case, plan.commands, trials=trials, environment=case.environment, method="iv-current", seed=3)
    errors = (days.estimates - days.truth) @ limits.slopes.T
    print(f"{trials} days of {plan.day.planned_s:.0f} s each, asked for as below; chance: {chance(trials):.1%}\n")
    print("| asked for | standard deviation asked | found | over | within 1.96 of it |\n|---|---|---|---|---|")
    for name, asked, error in zip(limits.names, limits.std.tolist(), errors.T, strict=True):
        within = np.mean(np.abs(error) <= 1.959963984540054 * asked)
        print(f"| {name} | {asked:.3g} | {error.std(ddof=1):.3g} | {error.std(ddof=1) / asked:.2f} | {within:.1%} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=500)
    parser.add_argument("--asked", action="store_true")
    given = parser.parse_args()
    trials, case = given.trials, load_scenario(STORY)
    information = scored(case)
    if given.asked:
        asked_and_found(case, information, designed(case, information, seed=1), trials)
        sys.exit()
    case = replace(case, design=replace(case.design, accuracy=AccuracySettings(as_durations=True)))
    day = planned_day(case, information, designed(case, information, seed=1), seed=1)
    problem = day.design.problem
    told = about_ship(problem, track_information(case.vessel, problem, case.environment, day.plan.sailed).sum(axis=0))
    p = len(problem.parameters)
    limit = equation_noise(case.vessel, problem.parameters) * np.sqrt(np.diag(np.linalg.inv(told))[:p])
    print(f"{trials} days of {day.plan.day.planned_s:.0f} s each; chance: {chance(trials):.1%}\n")
    print("| weather | method | parameter | found | over the report's | over the limit's | in 95 % intervals |")
    print("|---|---|---|---|---|---|---|")
    for name, method in TRIED:
        found = simulated_days(
            case, day.plan.commands, trials=trials, environment=WEATHERS[name], method=method, seed=3
        )
        for k, parameter in enumerate(found.parameters):
            print(
                f"| {name} | {method} | {parameter} | {found.found[k]:.3g} | {found.found[k] / found.forecast[k]:.2f} "
                f"| {found.found[k] / limit[k]:.2f} | {found.coverage[k]:.1%} |",
                flush=True,
            )
