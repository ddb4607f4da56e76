"""`expdesign run` and `expdesign plan`: one verified trajectory, with or without route files and report."""

from __future__ import annotations

from dataclasses import replace

from expdesign import requests
from expdesign.durations import with_repeats
from expdesign.export.files import planned_accuracy
from expdesign.progress import Progress, in_phases, silent, within
from expdesign.requests import repeating
from expdesign.scenario import Scenario, load_repeats
from expdesign.workflows.outcome import Outcome, results_folder, shared, workflow
from expdesign.workflows.steps.case import drafted, loaded, written
from expdesign.workflows.steps.day import Day, compared_criteria, day_document, day_files, planned_day
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import (
    built_route,
    check_no_trial,
    check_plannable,
    plan_document,
    plan_files,
    planned,
    report_content,
    trial_files,
)
from expdesign.workflows.steps.scored import growth_document, ready


@workflow
def plan(request: requests.Plan, *, progress: Progress = silent) -> Outcome:
    """One verified trajectory with the runs of a durations file, or of the optimal durations."""
    case = loaded(request, progress)
    with drafted(request, case):
        check_plannable(case)
        with shared(request):
            return _plan(request, case, progress)


def _plan(request: requests.Plan, case: Scenario, progress: Progress) -> Outcome:
    seed = request.seed
    information, _ = ready(case, seed=seed, progress=within(progress, 0.02, 0.1))
    design = designed(case, information, seed=seed)
    planning = within(progress, 0.1, 0.95)
    if request.durations is not None:
        design = with_repeats(design, load_repeats(request.durations, names=design.problem.names))
        day = Day(
            information=information,
            design=design,
            plan=planned(case, information, design, seed=seed, progress=planning),
        )
    else:
        day = planned_day(case, information, design, seed=seed, progress=planning)
    accuracy = planned_accuracy(
        day.plan,
        day.design.problem,
        vessel=case.vessel,
        environment=case.environment,
        asked=case.design.accuracy,
    )
    files = {**plan_files(case, day.plan, accuracy), **day_files(case, day)}
    document = plan_document(case, day.plan) + day_document(day)
    return written(request, case, files, document, progress)


WORK = (0.05, 0.08, 0.02, 0.68, 0.17)
"""Share of the work: scoring, durations, comparing criteria, planning, and writing."""
WORK_OF_SEARCH = (0.01, 0.02, 0.01, 0.90, 0.06)  # the same where the shortest day is searched for


@workflow
def run(request: requests.Run, *, progress: Progress = silent) -> Outcome:
    """The main job: score, durations, plan, verification, route files and report, into `out` or runs/<scenario>.

    A draft is the first plan that the whole job tries, or a day with fewer manoeuvres searched for, without drawn
    trials and bounds. It is written into `out` or runs/<scenario>-draft, without anything that could be sailed.

    Raises:
        InputError: a draft would stand beside files of a trial that may be sailed.
    """
    case = loaded(request, progress)
    if request.draft:
        case = replace(case, plan=replace(case.plan, draft=True))
        out = results_folder(request, f"{case.name}-draft")
        check_no_trial(out)
        request = request.but(out=out)
    with drafted(request, case):
        check_plannable(case)
        with shared(request):
            return _run(request, case, progress)


def _run(request: requests.Run, case: Scenario, progress: Progress) -> Outcome:
    seed = request.seed
    work = WORK if case.design.accuracy is None else WORK_OF_SEARCH
    scoring, designing, comparing, planning, writing = in_phases(progress, *work)
    information, growth = ready(case, seed=seed, progress=scoring)
    design = designed(case, information, seed=seed, progress=designing)
    comparing("comparing criteria", 0.0)
    compared = compared_criteria(case, design)
    day = planned_day(case, information, design, seed=seed, progress=planning)
    writing("writing routes, run cards and report", 0.0)
    route = None if day.plan.draft else built_route(case, day.plan)
    content = report_content(case, day.information, day.design, day.plan, repeating(request))
    content = replace(content, compared=compared, route=route, day=day.shortest)
    files = {**trial_files(case, growth, content, route, progress=writing), **day_files(case, day)}
    document = growth_document(growth, case) + day_document(day) + plan_document(case, day.plan)
    return written(request, case, files, document, progress)
