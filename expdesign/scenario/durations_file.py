"""Numbers of runs from a durations.json made before, or edited by hand."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from expdesign.errors import FileError, nearest
from expdesign.input_files import check_ends

EXPECTED = "a durations.json as expdesign durations and expdesign run write it"


def load_repeats(path: Path | str, *, names: Sequence[str]) -> tuple[int, ...]:
    """Whole runs of each named primitive; those the file leaves out are not run.

    Raises:
        FileError: the file is missing or not of that kind, or names an unknown primitive.
    """
    check_ends(Path(path), EXPECTED)
    try:
        entries = json.loads(Path(path).read_text(encoding="utf-8"))["primitives"]
        repeats = {entry["name"]: entry["repeats"] for entry in entries}
    except OSError as error:
        raise FileError(path, "", f"cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise FileError(path, "primitives", f"expected {EXPECTED}: a list of {{name, repeats, ...}}") from None
    if len(repeats) < len(entries):
        raise FileError(path, "primitives", "names a primitive twice")
    for name, count in repeats.items():
        if name not in names:
            near = nearest(str(name), names)
            hint = f", did you mean {near!r}?" if near else f"; it has {', '.join(names)}"
            raise FileError(path, "primitives.name", f"{name!r} is not in the scenario's dictionary{hint}")
        if not isinstance(count, int) or isinstance(count, bool) or count < 0:
            raise FileError(path, f"primitives.{name}.repeats", f"is {count!r}, expected a whole number of 0 or more")
    if not sum(repeats.values()):
        raise FileError(path, "primitives", "has no run, expected at least one repeat")
    return tuple(repeats.get(name, 0) for name in names)
