"""Files that are given as input: what may be read to its end."""

from __future__ import annotations

import stat
from pathlib import Path

from expdesign.errors import FileError


def check_ends(path: Path, expected: str) -> None:
    """Raise for a device or a pipe, which may have no end; what can be read twice has one.

    Args:
        path: to be read; one that does not exist, or is a folder, is left to the reader.
        expected: the kind of file, for the message, e.g. "a TOML file".

    Raises:
        FileError: it is a device, a pipe or a socket.
    """
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        kind = "a pipe" if stat.S_ISFIFO(mode) else "a socket" if stat.S_ISSOCK(mode) else "a device"
        raise FileError(path, "", f"is {kind}, expected {expected}")
