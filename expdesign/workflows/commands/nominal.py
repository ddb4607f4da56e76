"""`expdesign nominal`: from particulars and trial values of a pilot card to a vessel file."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from expdesign import __version__, requests
from expdesign.export import Content, write_files
from expdesign.export.nominal_page import NominalContent, nominal_document, nominal_json, nominal_toml
from expdesign.export.pages import document_html
from expdesign.particulars import nominal as fitted
from expdesign.progress import Progress, silent
from expdesign.requests import command_text
from expdesign.scenario import load_card
from expdesign.workflows.outcome import Outcome


def nominal(card: Path, out: Path | None, *, seed: int = 0, progress: Progress = silent) -> Outcome:
    """<name>.toml, nominal.json and nominal.html in `out` or runs/<card>-nominal.

    Args:
        card: file; see expdesign explain card.
        out: folder, or None.
        seed: of the ships that are drawn for intervals.
        progress: of the command.

    Raises:
        FileError: something in the card is wrong.
    """
    progress("reading the card", 0.0)
    found = fitted(load_card(card), seed=seed, progress=progress)
    content = NominalContent(
        nominal=found, command=command_text(requests.Nominal(card=card, seed=seed)),
        version=__version__,
    )  # fmt: skip
    document = nominal_document(content)
    files: dict[str, Content] = {
        "vessel.toml": nominal_toml(content),
        "nominal.json": nominal_json(content),
        "nominal.html": partial(document_html, document),
    }
    written = write_files(out or Path("runs") / f"{card.stem}-nominal", files)
    progress("done", 1.0)
    return Outcome(files=written, document=document)
