"""`expdesign check-route`: route files of any origin checked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from expdesign.errors import FileError
from expdesign.export.formats.check import check_route_file
from expdesign.progress import Progress, silent
from expdesign.workflows.outcome import Outcome


def check_routes(files: Sequence[Path], *, progress: Progress = silent) -> Outcome:
    """Whether RTZ and GPX files are fit to be loaded.

    Raises:
        FileError: the first problem of the first file that has one, and how many more there are.
    """
    for number, path in enumerate(files):
        progress(f"checking {path.name}", number / len(files))
        problems = check_route_file(path)
        if problems:
            more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
            raise FileError(path, "", problems[0] + more)
    return Outcome(files=(), summary={"files": len(files), "problems": 0})
