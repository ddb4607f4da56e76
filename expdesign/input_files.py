"""Files that are given as input: what may be read to its end."""

from __future__ import annotations

import stat
from pathlib import Path

from expdesign.errors import FileError


def check_ends(path: Path, expected: str) -> None:
    """Raise for a device, which may have no end; files and pipes have one.

    Args:
        path: to be read; one that does not exist is left to the reader.
        expected: the kind of file, for the message, e.g. "a TOML file".

    Raises:
        FileError: it is a device.
    """
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return
    if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
        raise FileError(path, "", f"is a device, expected {expected}")
