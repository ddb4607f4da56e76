"""Commands on a plan that is written: `expdesign export`, `check-route` and `trial-result`."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import datetime

from pydantic import RootModel

from expdesign import requests
from expdesign.errors import FileError, InputError
from expdesign.export.document import Document
from expdesign.export.files import strict_json
from expdesign.export.files.text import read_json
from expdesign.export.folder import Content, write_files
from expdesign.export.formats import find_format, route_files
from expdesign.export.formats.check import check_route_file
from expdesign.export.result_page import Estimated, Indices, PlanResult, ResultContent, result_document
from expdesign.export.routes import ROUTE_NAME, build_bridge_route, build_route, read_plan
from expdesign.progress import Progress, silent
from expdesign.workflows.outcome import Outcome, finished, results_folder, workflow


@workflow
def export(request: requests.Export, *, progress: Progress = silent) -> Outcome:
    """Route files of a plan made before, into `out` or beside it; with times where a departure is given.

    The route and its files are called `name`, or "route". The route has few legs, or follows the track in every turn
    where `fine` or a tolerance is given.
    """
    for known in request.formats:
        find_format(known)
    called = _name(request.name)
    folder = results_folder(request, request.plan.parent)
    progress("reading the plan", 0.1)
    track, starts = read_plan(request.plan), _departure(request.departure)
    if request.fine or request.tolerance_m is not None:
        route = build_route(track, departure=starts, tolerance_m=request.tolerance_m)
    else:
        route = build_bridge_route(track, departure=starts)
    route = replace(route, name=called)
    files = write_files(folder, route_files(route, tuple(dict.fromkeys(request.formats))))
    summary = {
        "waypoints": len(route.waypoints),
        "length_m": route.length_m,
        "cross_track_distance_m": route.xtd_m,
        "track_within_m": route.fit.largest_m,
        "legs_in_allowed_water": route.fit.in_water,
    }
    return Outcome(files=files, document=Document(facts=summary))


def _name(text: str | None) -> str:
    if text is None:
        return ROUTE_NAME
    if not re.fullmatch(r"[0-9A-Za-z][0-9A-Za-z._-]{0,62}", text):
        raise InputError(f"--name is {text!r}, expected up to 63 letters, digits, dots, dashes and underscores")
    return text


def _departure(text: str | None) -> datetime | None:
    if text is None:
        return None
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise InputError(f"--departure is {text!r}, expected a time such as 2026-05-01T08:00:00Z") from None


@workflow
def check_routes(request: requests.CheckRoute, *, progress: Progress = silent) -> Outcome:
    """Whether RTZ and GPX files are fit to be loaded.

    Raises:
        FileError: the first problem of the first file that has one, and how many more there are, in its notes.
    """
    for number, path in enumerate(request.files):
        progress(f"checking {path.name}", number / len(request.files))
        problems = check_route_file(path)
        if problems:
            more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
            first = FileError(path, "", problems[0] + more)
            for problem in problems[1 : MOST_NOTES + 1]:
                first.add_note(f"{path}: {problem}")
            raise first
    return Outcome(files=(), document=Document(facts={"files": len(request.files), "problems": 0}))


MOST_NOTES = 20  # further problems of a file that are told, each in a line


Estimates = RootModel[dict[str, Estimated]]


@workflow
def trial_result(request: requests.TrialResult, *, progress: Progress = silent) -> Outcome:
    """The result of a planned trial, from the files of `run`, `estimate` and `indices`, beside the plan.

    Raises:
        InputError: a file is wrong, or they are not of the same ship.
    """
    folder = results_folder(request, request.plan.parent)
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
    return finished(request, folder, files, document, progress, page="result.html")
