"""`expdesign score`: the information of every manoeuvre of a scenario."""

from __future__ import annotations

from expdesign import requests
from expdesign.dictionary.build import deviating
from expdesign.progress import Progress, silent, within
from expdesign.workflows.outcome import Outcome, document_of, workflow
from expdesign.workflows.steps.case import loaded, noted, written
from expdesign.workflows.steps.scored import (
    actuation_remarks,
    parameters_of,
    ranking,
    score_files,
    scored,
    speed_remarks,
)


@workflow
def score(request: requests.Score, *, progress: Progress = silent) -> Outcome:
    """Information of every primitive of a scenario's dictionary; `vessel` stands in for the vessel file it names."""
    case = loaded(request.scenario, progress, vessel=request.vessel)
    information = scored(case, progress=within(progress, 0.05, 0.95))
    summary: dict[str, object] = {
        "primitives": len(information),
        "parameters": len(parameters_of(case)),
        "meet_excitation_condition": sum(item.excitation_condition for item in information),
        "informative_alone": sum(item.log_det_alone is not None for item in information),
        "most_beside_the_others": ranking(case, information).rows[0][1],
        "stray_from_their_wish": [item.name for item in deviating([item.primitive for item in information])],
    }
    told = actuation_remarks(case.vessel, [item.primitive.commands for item in information], "candidate")
    told += speed_remarks(case.vessel, [item.primitive.trajectory for item in information], "candidate")
    if case.remarks or told:
        summary["remarks"] = [*case.remarks, *told]
    document = document_of(summary, (ranking(case, information),))
    return written(request, case, score_files(case, information), noted(case, document), progress)
