"""Arguments before they are parsed, and checks that no file reader can make."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path

from expdesign.errors import InputError


def repeat_option(arguments: Sequence[str], option: str, *, files: bool = False) -> list[str]:
    """Spell out a list of values: `--format rtz gpx` becomes `--format rtz --format gpx`.

    A list ends at the next option and, unless it lists files, at anything that looks like a file, i.e. has a slash or
    an ending that is no number: rtz-1.0 is a value.
    """
    spelled, rest = [], list(arguments)
    while rest:
        spelled.append(rest.pop(0))
        if spelled[-1] == option and rest:
            first, *more = rest
            values = [first, *takewhile(_looks_like_file_or_value if files else _looks_like_value, more)]
            spelled += [values[0], *(part for value in values[1:] for part in (option, value))]
            rest = rest[len(values) :]
    return spelled


def parse_seed(text: str) -> int:
    """The seed of all random numbers.

    Raises:
        InputError: not a whole number of 0 or more.
    """
    return _count("--seed", text)


def parse_jobs(text: str) -> int:
    """The number of processes, 0 for one per core.

    Raises:
        InputError: not a whole number of 0 or more.
    """
    return _count("--jobs", text)


def check_out(out: Path | None) -> Path | None:
    """The folder for results, before hours are spent on something that cannot be written there.

    Raises:
        InputError: it is a file, lies below a file, or may not be written to.
    """
    if out is None:
        return None
    there = next(path for path in (out, *out.absolute().parents) if path.exists() or path.is_symlink())
    if there.is_symlink() and not there.exists():
        raise InputError(f"--out {out}: {there} is a link to {there.readlink()}, which does not exist")
    if not there.is_dir():
        raise InputError(f"--out {out}: {there} is a file, expected a folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(f"--out {out}: no permission to write in {there}")
    return out


def _count(option: str, text: str) -> int:
    if not str(text).isdecimal():
        raise InputError(f"{option} is {text}, expected a whole number of 0 or more")
    return int(text)


def _looks_like_value(text: str) -> bool:
    _, dot, ending = text.rpartition(".")
    return not text.startswith("-") and "/" not in text and (not dot or ending.isdecimal())


def _looks_like_file_or_value(text: str) -> bool:
    return not text.startswith("-")
