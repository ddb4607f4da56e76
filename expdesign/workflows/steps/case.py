"""Reading a scenario, and writing the results of a command on it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from expdesign.export import (
    write_files,
)
from expdesign.progress import Progress
from expdesign.scenario import Scenario, load_scenario
from expdesign.workflows.outcome import Outcome, TextTable


def loaded(scenario: Path, progress: Progress) -> Scenario:
    """A scenario file."""
    progress("reading the scenario", 0.0)
    return load_scenario(scenario)


def written(
    case: Scenario,
    out: Path | None,
    files: Mapping[str, str | bytes],
    summary: Mapping[str, object],
    progress: Progress,
    tables: tuple[TextTable, ...] = (),
) -> Outcome:
    """Write files into `out` or runs/<scenario>, and report them."""
    paths = write_files(out or Path("runs") / case.name, files)
    progress("done", 1.0)
    return Outcome(files=paths, summary={"scenario": case.name, **summary}, tables=tables)
