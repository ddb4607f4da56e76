"""`expdesign foresee`: what a diagnosis of a planned trial would find, before it is sailed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from expdesign import requests
from expdesign.errors import FileError, InputError
from expdesign.export.foresight_page import foresight_document, foresight_json, operation_document, operation_json
from expdesign.export.routes import read_plan
from expdesign.foresight import TrialRun, design_runs, foresee_operation
from expdesign.foresight import foresee as foresee_trial
from expdesign.information import PrimitiveInformation
from expdesign.progress import Progress, silent, within
from expdesign.scenario import Scenario
from expdesign.simulation import Environment
from expdesign.workflows.outcome import Outcome, shared, workflow
from expdesign.workflows.steps.case import loaded, written
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.scored import ready

OF_DESIGN = "the runs of the design, without the legs between them"
OF_ACCURACY = "the durations that state the accuracy, not the day: --plan foresees that"
OF_PLAN = "the planned trial, its legs counted"


@workflow
def foresee(request: requests.Foresee, *, progress: Progress = silent) -> Outcome:
    """The probability that a diagnosis of the trial would find each cause, into `out` or runs/<scenario>."""
    if request.operation is not None:
        if request.plan is not None:
            raise InputError("--plan and --operation are given, expected one of them")
        return _operation(request, request.operation, progress)
    case = loaded(request, progress)
    with shared(request, load=None):
        information, _ = ready(case, seed=request.seed, progress=within(progress, 0.02, 0.15))
        offers = [item.primitive for item in information]
        runs, weather = _trial(case, information, request.plan, request.seed, within(progress, 0.15, 0.2))
        found = foresee_trial(
            case.vessel,
            runs,
            weather,
            offers=offers,
            sizes=case.design.reveal_sizes,
            seed=request.seed,
            progress=within(progress, 0.2, 0.95),
        )
    source = OF_PLAN if request.plan else OF_ACCURACY if case.design.accuracy else OF_DESIGN
    names = {"scenario": case.name, "vessel": case.vessel.name, "source": source}
    progress("writing the page", 0.95)
    files = {"foresee.json": foresight_json(found, **names)}
    return written(request, case, files, foresight_document(found, **names), progress, page="foresee.html")


def _operation(request: requests.Foresee, voyages: int, progress: Progress) -> Outcome:
    """What a watch over the scenario's ship in its weather would find."""
    case = loaded(request, progress)
    with shared(request, load=None):
        found = foresee_operation(
            case.vessel, case.environment, voyages=voyages, seed=request.seed, progress=within(progress, 0.02, 0.97)
        )
    files = {"operation.json": operation_json(found, vessel=case.vessel.name)}
    document = operation_document(found, scenario=case.name, vessel=case.vessel.name)
    return written(request, case, files, document, progress, page="operation.html")


def _trial(
    case: Scenario, information: Sequence[PrimitiveInformation], plan: Path | None, seed: int, progress: Progress
) -> tuple[Sequence[TrialRun], Environment]:
    """The runs of the trial and the weather forecast for it."""
    if plan is None:
        design = designed(case, information, seed=seed, progress=progress)
        return design_runs([item.primitive for item in information], design.repeats), case.environment
    progress("reading the plan", 0.0)
    track, inputs = read_plan(plan), case.vessel.model.inputs
    if (track.commands.names, track.commands.sample_time_s) != (inputs, case.vessel.sample_time_s):
        raise FileError(
            plan,
            "",
            f"commands {', '.join(track.commands.names)} every {track.commands.sample_time_s:g} s, the scenario's "
            f"vessel takes {', '.join(inputs)} every {case.vessel.sample_time_s:g} s",
        )
    begin = track.trajectory
    run = TrialRun(name="plan", commands=track.commands, pose=begin.pose[0], velocity=begin.velocity[0])
    return (run,), track.environment
