"""`expdesign nominal`: from particulars and trial values of a pilot card to a vessel file."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from expdesign import __version__
from expdesign.export import Content, write_files
from expdesign.export.nominal_page import (
    FACTOR_HEADER,
    TAKEN_HEADER,
    TRIAL_HEADER,
    NominalContent,
    factor_rows,
    nominal_html,
    nominal_json,
    nominal_toml,
    taken_rows,
    trial_rows,
)
from expdesign.particulars import nominal as fitted
from expdesign.progress import Progress, silent
from expdesign.scenario import load_card
from expdesign.workflows.outcome import Outcome, TextTable, command_text


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
        nominal=found, command=command_text("nominal", [card], {"--seed": seed}, usual={"--seed": 0}),
        version=__version__,
    )  # fmt: skip
    files: dict[str, Content] = {
        "vessel.toml": nominal_toml(content),
        "nominal.json": nominal_json(content),
        "nominal.html": partial(nominal_html, content),
    }
    written = write_files(out or Path("runs") / f"{card.stem}-nominal", files)
    progress("done", 1.0)
    tables = (
        ("Where the numbers come from", FACTOR_HEADER, factor_rows(content)),
        ("Thrusters that drive her", TAKEN_HEADER, taken_rows(content)),
        (f"Trials of {found.vessel.name}", TRIAL_HEADER, trial_rows(content)),
    )
    return Outcome(
        files=written,
        summary={
            "vessel": found.vessel.name,
            "parameters": len(found.vessel.model.names),
            "stated_values": sum(len(one.stated) for one in found.predicted),
            "contradictions": list(found.contradictions),
        },
        tables=tuple(TextTable(title=title, header=header, rows=tuple(rows)) for title, header, rows in tables),
        notes=content.notes,
    )
