"""`expdesign nominal`: from particulars and trial values of a pilot card to a vessel file."""

from __future__ import annotations

from expdesign import requests
from expdesign.export.folder import Content
from expdesign.export.nominal_page import nominal_document, nominal_json, nominal_toml
from expdesign.particulars import nominal as fitted
from expdesign.progress import Progress, silent
from expdesign.requests import repeating
from expdesign.scenario import load_card
from expdesign.workflows.outcome import Outcome, finished, results_folder, workflow


@workflow
def nominal(request: requests.Nominal, *, progress: Progress = silent) -> Outcome:
    """<name>.toml, nominal.json and nominal.html in `out` or runs/<card>-nominal.

    Raises:
        FileError: something in the card is wrong.
    """
    folder = results_folder(request, f"{request.card.stem}-nominal")
    progress("reading the card", 0.0)
    found = fitted(load_card(request.card), seed=request.seed, progress=progress)
    command = repeating(request)
    files: dict[str, Content] = {
        "vessel.toml": nominal_toml(found, command),
        "nominal.json": nominal_json(found, command),
    }
    return finished(request, folder, files, nominal_document(found), progress, page="nominal.html")
