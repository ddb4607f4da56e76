"""`expdesign trial-result`: what a trial promised, and what came out, on one page."""

from __future__ import annotations

from pydantic import RootModel

from expdesign import requests
from expdesign.errors import FileError, InputError
from expdesign.export import Content
from expdesign.export.files import strict_json
from expdesign.export.files.text import read_json
from expdesign.export.result_page import Estimated, Indices, PlanResult, ResultContent, result_document
from expdesign.progress import Progress, silent
from expdesign.workflows.outcome import Outcome, finished, workflow

Estimates = RootModel[dict[str, Estimated]]


@workflow
def trial_result(request: requests.TrialResult, *, progress: Progress = silent) -> Outcome:
    """The result of a planned trial, from the files of `run`, `estimate` and `indices`, beside the plan.

    Raises:
        InputError: a file is wrong, or they are not of the same ship.
    """
    planned = read_json(request.plan, PlanResult, "a plan.json as expdesign run writes it")
    if planned.draft:
        raise FileError(request.plan, "draft", "is true: a draft is not sailed, expected the plan that was")
    tried = read_json(request.estimate, Estimates, "an estimate.json as expdesign estimate writes it").root
    best = next((one for one in tried.values() if one.in_vessel_file), None)
    if best is None or not set(best.parameters) & set(planned.parameters):
        raise FileError(request.estimate, "", f"estimates no parameter of the plan, {', '.join(planned.parameters)}")
    judged = (
        None
        if request.indices is None
        else read_json(request.indices, Indices, "an indices.json as expdesign indices writes it")
    )
    if judged is not None and judged.vessel != planned.vessel.name:
        raise InputError(f"{request.indices}: is of {judged.vessel}, the plan {request.plan} of {planned.vessel.name}")
    content = ResultContent(
        plan=planned,
        estimate=best,
        indices=judged,
    )
    document = result_document(content)
    files: dict[str, Content] = {
        "result.json": strict_json({"ship": planned.vessel.name, "trial": planned.scenario, **document.summary}),
    }
    return finished(request, request.plan.parent, files, document, progress, page="result.html")
