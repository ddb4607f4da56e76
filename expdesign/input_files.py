"""Files that are given as input: what may be read to its end, and how one that cannot be read is told."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import contextmanager
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


@contextmanager
def readable(path: Path, expected: str) -> Iterator[None]:
    """Errors of reading a file in the block as one line.

    Raises:
        FileError: it has no end, as `check_ends`; is missing, a folder, or cannot be read.
    """
    check_ends(path, expected)
    try:
        yield
        return
    except FileNotFoundError:
        problem = f"does not exist, expected {expected}"
    except IsADirectoryError:
        problem = f"is a directory, expected {expected}"
    except (OSError, ValueError) as error:  # of a name with a zero in it, for example
        problem = f"cannot be read: {getattr(error, 'strerror', None) or error}"
    raise FileError(path, "", problem)


def read_text(path: Path, expected: str) -> str:
    """The text of a file.

    Raises:
        FileError: as `readable`, or it is not UTF-8.
    """
    with readable(path, expected):
        content = path.read_bytes()
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        problem = f"is not UTF-8 text (byte 0x{error.object[error.start]:02x} at offset {error.start})"
    raise FileError(path, "", problem)
