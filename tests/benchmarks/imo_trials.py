"""The accuracy of a shortest day by the standard trials of IMO MSC.137(76): how much longer does it take?

``python tests/benchmarks/imo_trials.py``: on the story's water, with seed 1. One set is turning circles with 35 degrees
of helm, zig-zags 10/10 and 20/20, each to both sides, and a crash stop, from the approach speed given. The same planner
places it, run-ups and repositioning included. The accuracy asked for is that of the optimal durations in `total_s`, as
for the shortest day. A set tells so much, and is repeated until it is enough: information of sets adds up, and each
takes what the first takes beyond the way to the goal. "runs" counts what the runs tell, as such trials are evaluated;
"track" counts what legs between them tell, too.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.dictionary import PrimitiveSpec
from expdesign.durations import with_repeats
from expdesign.errors import NotInformative
from expdesign.plan.solve import draft_trial, plan_trial
from expdesign.plan.verify import about_ship, track_information
from expdesign.scenario import load_dictionary, load_scenario
from expdesign.shortest_day import AccuracySettings, stated_accuracy
from expdesign.workflows.steps.day import planned_day
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import plan_problem
from expdesign.workflows.steps.scored import scored

STORY = Path(__file__).parents[2] / "scenarios" / "story.toml"
APPROACHES_MPS = (1.0, 1.5, 2.0)
IMO = STORY.parent / "dictionaries" / "imo-trials.toml"
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


if __name__ == "__main__":
    case = load_scenario(STORY)
    case = replace(case, design=replace(case.design, accuracy=AccuracySettings(as_durations=True)))
    information = scored(case)
    reference = designed(case, information, seed=1)
    accuracy = stated_accuracy(case.design.accuracy, reference, case.vessel)
    found = planned_day(case, information, reference, seed=1)
    shortest = found.plan.day
    print(f"shortest day: {shortest.planned_s:.0f} s, median {shortest.median_s:.0f} s, 95 % {shortest.most_s:.0f} s\n")
    print("| approach | one set | median | 95 % | its way | counted | tells | sets | day | times the shortest |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for speed_mps in APPROACHES_MPS:
        runs = imo_set(speed_mps)
        wide = replace(case, dictionary=(*case.dictionary, *runs))
        scores = scored(wide)
        design = designed(wide, scores, seed=1)
        names = [spec.name for spec in runs]
        design = design_of(design, [int(name in names) for name in design.problem.names])
        problem = plan_problem(wide, scores, design, seed=1)
        way_s, plan = draft_trial(problem).direct_s, plan_trial(problem)
        day_s, legs = plan.day.planned_s, track_information(case.vessel, design.problem, case.environment, plan.sailed)
        in_runs = legs[[leg.kind == "primitive" for leg in plan.legs]].sum(axis=0)
        for what, matrix in (("runs", in_runs), ("track", legs.sum(axis=0))):
            share = float(np.exp(accuracy.margin(about_ship(design.problem, matrix))))
            sets = math.ceil(1 / share) if share > 0 else math.inf
            whole_s = way_s + sets * (day_s - way_s)
            print(
                f"| {speed_mps:g} m/s | {day_s:.0f} s | {plan.day.median_s:.0f} s | {plan.day.most_s:.0f} s "
                f"| {way_s:.0f} s | {what} | {share:.3f} | {sets} | {whole_s:.0f} s "
                f"| {whole_s / shortest.planned_s:.1f} |",
                flush=True,
            )
