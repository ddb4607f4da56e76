"""Reading a scenario, and writing the results of a command on it, or the draft that a refused plan leaves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from expdesign import requests
from expdesign.errors import FileError, NoPlan
from expdesign.export.document import Document
from expdesign.export.folder import Content, write_files
from expdesign.progress import Progress
from expdesign.requests import repeating
from expdesign.scenario import Scenario, load_scenario
from expdesign.vessel import NOT_ACTING_BACK
from expdesign.workflows.outcome import Outcome, finished, results_folder
from expdesign.workflows.steps.measured import measured

DRAFT = ("refused.json", "refused.html")  # names of the files of a draft; no results have them
PLAN = "plan.json"  # name of a file that every plan has
ScenarioRequest = (
    requests.Run
    | requests.Plan
    | requests.Score
    | requests.Durations
    | requests.Foresee
    | requests.Replan
    | requests.RollPlan
    | requests.Validate
)
"""Of commands that write results of a scenario."""


def loaded(request: ScenarioRequest, progress: Progress) -> Scenario:
    """The scenario that is asked for, whose results can be written; with a vessel file in place of the one it names."""
    progress("reading the scenario", 0.0)
    case = load_scenario(request.scenario, vessel=getattr(request, "vessel", None))
    results_folder(request, case.name)
    return case


def _noted(case: Scenario, document: Document) -> Document:
    """The document with what is to be heard about the scenario, its vessel, its chart and the data before the trial."""
    roll = () if case.vessel.pendulum is None or "heel_max_deg" in document.facts else (NOT_ACTING_BACK,)
    before = measured(case.design.prior_data, case.vessel).doubts if case.design.prior_data else ()
    remarks = tuple(text for text in case.remarks if text not in document.findings)
    name = {"scenario": case.name}
    named = replace(document, facts=document.facts if document.title else {**name, **document.facts})
    return named + Document(values=name, notes=(*roll, *before, *case.area.notes, *remarks))


def written(
    request: ScenarioRequest,
    case: Scenario,
    files: Mapping[str, Content],
    document: Document,
    progress: Progress,
    *,
    page: str = "",
) -> Outcome:
    """Write files into the folder asked for, or runs/<scenario>, and say what is to be heard of the scenario.

    A plan takes an earlier draft away.
    """
    folder = results_folder(request, case.name)
    outcome = finished(request, folder, files, _noted(case, document), progress, page=page)
    if left := _undeleted(folder) if PLAN in files else ():
        note = f"The earlier draft cannot be deleted and is of no use: {', '.join(left)}."
        return replace(outcome, document=outcome.document + Document(notes=(note,)))
    return outcome


def _undeleted(folder: Path) -> tuple[str, ...]:
    """The files of an earlier draft in a folder that cannot be deleted; the others are."""
    left = []
    for name in DRAFT:
        try:
            (folder / name).unlink(missing_ok=True)
        except OSError as error:
            left.append(f"{folder / name} ({error.strerror})")
    return tuple(left)


@contextmanager
def drafted(request: ScenarioRequest, case: Scenario) -> Iterator[None]:
    """Leave a draft where the block refuses a plan; the refusal names it.

    Results of an earlier attempt stay there, and the draft says that they are none of this one. Other refusals have
    nothing to show on a chart.
    """
    folder = results_folder(request, case.name)
    try:
        yield
    except NoPlan as error:
        with suppress(FileError):  # the refusal matters more
            path = write_files(folder, _files(case, folder, error, repeating(request)))[-1]
            error.remedies += (f"the draft is {path}",)
        raise


def _files(case: Scenario, folder: Path, error: NoPlan, command: str) -> dict[str, Content]:
    from expdesign.export.pages import document_html
    from expdesign.export.refused_page import Refusal, refused_document, refused_json

    there = sorted(path.name for path in folder.iterdir() if path.is_file()) if folder.is_dir() else []
    refusal = Refusal(
        scenario=case.name,
        vessel=case.vessel,
        area=case.area,
        start=case.start,
        goal=case.goal,
        clearance_m=case.plan.clearance_m,
        error=error,
        earlier=tuple(name for name in there if name not in DRAFT and not name.startswith(".")),
        command=command,
    )
    return {"refused.json": refused_json(refusal), "refused.html": partial(document_html, refused_document(refusal))}
