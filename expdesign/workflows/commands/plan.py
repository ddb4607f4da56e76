"""`expdesign plan`: one verified trajectory."""

from __future__ import annotations

from expdesign import requests
from expdesign.durations import with_repeats
from expdesign.export.files import planned_accuracy
from expdesign.progress import Progress, silent, within
from expdesign.scenario import Scenario, load_repeats
from expdesign.workflows.outcome import Outcome, document_of, workflow
from expdesign.workflows.steps.case import drafted, loaded, noted, written
from expdesign.workflows.steps.day import Day, day_files, day_summary, day_tables, planned_day
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import check_plannable, plan_files, plan_summary, planned
from expdesign.workflows.steps.scored import ready
from expdesign.workflows.steps.workers import shared


@workflow
def plan(request: requests.Plan, *, progress: Progress = silent) -> Outcome:
    """One verified trajectory with the runs of a durations file, or of the optimal durations."""
    case = loaded(request.scenario, progress, vessel=request.vessel)
    check_plannable(case)
    with shared(request), drafted(request, case):
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
    document = document_of({**plan_summary(case, day.plan), **day_summary(day)}, day_tables(day))
    return written(request, case, files, noted(case, document), progress)
