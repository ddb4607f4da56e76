"""Exceptions, split by what the reader can do about them.

Every message is one line: the thing, the value found, and what would have been right. The command line turns
`InputError` into exit status 2 and `NoAnswer` into exit status 3.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path


class ExpdesignError(Exception):
    """Base of every error that the package raises on purpose."""


class InputError(ExpdesignError):
    """What was given is wrong; the message says which value, and what would be right."""


class NoAnswer(ExpdesignError):
    """The input is fine but has no answer; the message says what stands in the way."""


class FileError(InputError):
    """A file is missing, unreadable, or says something that is not allowed.

    Attributes:
        path: the file.
        key: dotted name of the entry inside the file, or "" for the file as a whole.
        problem: what is wrong and what would be right.
    """

    def __init__(self, path: Path | str, key: str, problem: str) -> None:
        self.path, self.key, self.problem = Path(path), key, problem
        super().__init__(f"{path}: {key}: {problem}" if key else f"{path}: {problem}")


class UnknownName(InputError):
    """A name that is not in the list it must come from; the nearest known one is offered."""

    def __init__(self, what: str, name: str, *, known: Iterable[str]) -> None:
        self.what, self.name, self.known = what, name, tuple(known)
        near = nearest(name, self.known)
        hint = f", did you mean {near!r}?" if near else ""
        super().__init__(f"unknown {what} {name!r}{hint} (known: {', '.join(self.known)})")


class ShapeError(InputError):
    """An array whose shape contradicts the value it is part of."""


class Diverged(NoAnswer):
    """A simulation left the range in which its numbers mean anything."""


class SpeedOutOfReach(InputError):
    """A steady speed is asked for that the engines do not give.

    Attributes:
        reached_mps: what they give.
    """

    def __init__(self, message: str, *, reached_mps: float) -> None:
        self.reached_mps = reached_mps
        super().__init__(message)


class Unreachable(NoAnswer):
    """A manoeuvre must begin with a motion that the vessel cannot hold; the message names it and what can be held."""


class NotInformative(NoAnswer):
    """The experiment cannot tell some parameters apart.

    Attributes:
        parameters: the names that nothing informs about.
    """

    def __init__(self, message: str, *, parameters: tuple[str, ...] = ()) -> None:
        self.parameters = parameters
        super().__init__(message)


class NoPlan(NoAnswer):
    """No trajectory satisfies the limits; the message names the place or the primitive in the way."""


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name closest to a mistyped one, or None."""
    found = get_close_matches(name, list(known), n=1, cutoff=0.5)
    return found[0] if found else None
