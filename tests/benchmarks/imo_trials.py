"""The accuracy of a shortest day by the standard trials of IMO MSC.137(76): how much longer does it take?

``python tests/benchmarks/imo_trials.py``: on the story's water, with seed 1; with ``--near`` the goal is 100 m east of
the start. One set is turning circles with 35 degrees of helm, zig-zags 10/10 and 20/20, each to both sides, and a crash
stop, from the approach speed given. The same planner places it, run-ups and repositioning included. The accuracy asked
for is that of the optimal durations in `total_s`, as for the shortest day: by the criterion, or for each parameter by
itself, which asks both for the same standard deviations. A set tells so much, and is repeated until it is enough:
information of sets adds up, and each takes what the first takes beyond the way to the goal. "runs" counts what the runs
tell, as such trials are evaluated; "track" counts what legs between them tell, too.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.dictionary import PrimitiveSpec
from expdesign.durations import with_repeats
from expdesign.errors import NotInformative
from expdesign.information.expected import expected_covariance
from expdesign.plan.solve import draft_trial, plan_trial
from expdesign.plan.verify import part_of_track, track_information
from expdesign.rehearsal import trial_parts
from expdesign.scenario import load_dictionary, load_scenario
from expdesign.shortest_day import AccuracySettings, stated_accuracy
from expdesign.workflows.steps.day import planned_day
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import plan_problem
from expdesign.workflows.steps.scored import scored

STORY = Path(__file__).parents[2] / "scenarios" / "story.toml"
APPROACHES_MPS = (1.0, 1.5, 2.0)
IMO = STORY.parent / "dictionaries" / "imo-trials.toml"
NEAR_M = np.array([0.0, 100.0, 0.0])
FAMILIES = ("turning_circle_helm", "zigzag_heading", "crash_stop")


def imo_set(speed_mps: float) -> tuple[PrimitiveSpec, ...]:
    """The runs of one set at an approach speed, of the dictionary of standard trials."""
    return tuple(
        replace(spec, name=f"imo-{spec.name}", settings={**spec.settings, "speed_mps": speed_mps})
        for spec in load_dictionary(IMO)
        if spec.family in FAMILIES
    )


def design_of(design, repeats):
    """A design with these runs, which alone need not tell of every parameter."""
    try:
        return with_repeats(design, repeats)
    except NotInformative:
        return replace(design, repeats=tuple(repeats), efficiency_repeats=0.0, note="")


def each_parameter(case, runs, design):
    """Every parameter as accurate as the optimal durations make it, to first order in the noise of the sensors."""
    problem = design.problem
    covariance = expected_covariance(
        case.vessel,
        trial_parts(runs, design.fractions * problem.total_s / problem.run_s, environment=case.environment),
        problem.parameters,
        environment=case.environment,
        mean_subtraction=problem.mean_subtraction,
        unknown_current=case.environment.current_std_mps > 0,
    )
    return AccuracySettings(std=dict(zip(problem.parameters, np.sqrt(np.diag(covariance)).tolist(), strict=True)))


def told(case, problem, plan, accuracy):
    """Share of what is needed that a set's runs alone tell, and its whole track."""
    sailed = plan.sailed
    legs = track_information(case.vessel, problem, case.environment, sailed)
    runs = [leg for leg in sailed.legs if leg.kind == "primitive"]
    in_runs = legs[[leg.kind == "primitive" for leg in sailed.legs]].sum(axis=0)
    parts = [part_of_track(sailed, leg.first, leg.last) for leg in runs], [part_of_track(sailed)]
    for what, matrix, some in zip(("runs", "track"), (in_runs, legs.sum(axis=0)), parts, strict=True):
        try:
            covariance = expected_covariance(
                case.vessel,
                some,
                problem.parameters,
                environment=case.environment,
                mean_subtraction=problem.mean_subtraction,
                unknown_current=case.environment.current_std_mps > 0,
            )
        except NotInformative:
            covariance = None
        yield what, float(np.exp(accuracy.margin_of_track(matrix, covariance)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--near", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    case = load_scenario(STORY)
    if asked.near:
        case = replace(case, goal=case.start + NEAR_M)
    information = scored(case)
    reference = designed(case, information, seed=asked.seed)
    dictionary = tuple(item.primitive for item in information)
    settings_of = {
        "criterion": AccuracySettings(as_durations=True),
        "each parameter": each_parameter(case, dictionary, reference),
    }
    accuracies, shortest_s = {}, {}
    for name, settings in settings_of.items():
        ask = replace(case, design=replace(case.design, accuracy=settings))
        accuracies[name] = stated_accuracy(settings, reference, case.vessel, dictionary, case.environment)
        day = planned_day(ask, information, reference, seed=asked.seed).plan.day
        shortest_s[name] = day.planned_s
        print(f"{name}: shortest day {day.planned_s:.0f} s, median {day.median_s:.0f} s, 95 % {day.most_s:.0f} s")
    print("\n| approach | one set | median | 95 % | its way | accuracy of | counted | tells | sets | day ", end="")
    print("| times the shortest |\n|---|---|---|---|---|---|---|---|---|---|---|")
    for speed_mps in APPROACHES_MPS:
        runs = imo_set(speed_mps)
        wide = replace(case, dictionary=(*case.dictionary, *runs))
        scores = scored(wide)
        design = designed(wide, scores, seed=asked.seed)
        names = [spec.name for spec in runs]
        design = design_of(design, [int(name in names) for name in design.problem.names])
        problem = plan_problem(wide, scores, design, seed=asked.seed)
        way_s, plan = draft_trial(problem).direct_s, plan_trial(problem)
        day_s = plan.day.planned_s
        for name, accuracy in accuracies.items():
            for what, share in told(case, design.problem, plan, accuracy):
                sets = math.ceil(1 / share) if share > 0 else math.inf
                whole_s = way_s + sets * (day_s - way_s)
                print(
                    f"| {speed_mps:g} m/s | {day_s:.0f} s | {plan.day.median_s:.0f} s | {plan.day.most_s:.0f} s "
                    f"| {way_s:.0f} s | {name} | {what} | {share:.3f} | {sets} | {whole_s:.0f} s "
                    f"| {whole_s / shortest_s[name]:.1f} |",
                    flush=True,
                )
