"""Exceptions, by what the user can do about them.

Every message is one line: the entry, its value, and the allowed values. The command line turns `InputError` into exit
status 2 and `NoAnswer` into exit status 3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any


class ExpdesignError(Exception):
    """Base of every error that the package raises on purpose; it comes from other processes as it was raised there."""

    def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...], dict[str, object]]:
        return _remade, (type(self), self.args), vars(self)


class InputError(ExpdesignError):
    """An input is wrong; the message states its value and the allowed values."""


class NoAnswer(ExpdesignError):
    """The input is correct but has no solution; the message states the obstacle."""


class FileError(InputError):
    """A file is missing or unreadable, or an entry in it is wrong.

    Attributes:
        path: the file.
        key: dotted name of the entry inside the file, or "" for the file as a whole.
        problem: the value found and the allowed values.
    """

    def __init__(self, path: Path | str, key: str, problem: str) -> None:
        self.path, self.key, self.problem = Path(path), key, problem
        super().__init__(f"{path}: {key}: {problem}" if key else f"{path}: {problem}")


class UnknownName(InputError):
    """An unknown name; the message offers the nearest known one."""

    def __init__(self, what: str, name: str, *, known: Iterable[str]) -> None:
        self.what, self.name, self.known = what, name, tuple(known)
        near = nearest(name, self.known)
        hint = f", did you mean {near!r}?" if near else ""
        super().__init__(f"unknown {what} {name!r}{hint} (known: {', '.join(self.known)})")


class ShapeError(InputError):
    """An array has a shape that contradicts the other fields of its value."""


class Diverged(NoAnswer):
    """A simulation diverged."""


class SpeedOutOfReach(InputError):
    """The engines cannot hold a requested steady speed.

    Attributes:
        reached_mps: the speed that they can hold.
    """

    def __init__(self, message: str, *, reached_mps: float) -> None:
        self.reached_mps = reached_mps
        super().__init__(message)


class Unreachable(NoAnswer):
    """The vessel cannot hold the entry state of a manoeuvre; the message states it and the limit."""


class NotInformative(NoAnswer):
    """Some parameters are not identifiable from the experiment.

    Attributes:
        parameters: their names.
        unseen: combinations of parameters that the data do not show at all, name -> share in the parameter's own unit.
        fix: those of the parameters that have to be known, for the data to show the others; () where nothing helps.
    """

    def __init__(
        self,
        message: str,
        *,
        parameters: tuple[str, ...] = (),
        unseen: tuple[Mapping[str, float], ...] = (),
        fix: tuple[str, ...] = (),
    ) -> None:
        self.parameters, self.unseen, self.fix = parameters, unseen, fix
        super().__init__(message)


class FloorOutOfReach(NoAnswer):
    """A least information that no durations reach; the message names it.

    Attributes:
        name: of the floor.
        share: of the information that is asked for, the most that durations reach.
    """

    def __init__(self, name: str, *, share: float) -> None:
        self.name, self.share = name, share
        super().__init__(f"{name}: durations within the other limits reach at most {share:.4g} of what is asked for")


class NoPlan(NoAnswer):
    """No trajectory satisfies the limits; the message names the place or the primitive, and what helps.

    Attributes:
        obstacle: what stands in the way.
        remedies: changes that were checked, or that none of those tried helps; one sentence each.
        what: kind of the obstacle: "room" for a run, "passage" between places, "berth" of start or goal, or "".
        which: the run, or "start" or "goal"; "" for neither.
        place: north and east of the obstacle [m], or None.
        tried: what was tried before, one line each.
        poses: (k, 3) north m, east m, heading rad of the track as far as it was planned, or None.
        within: the part of the sea area that was planned in, or None where planning did not begin.
        confidence: a lower one that the first plan, which was too risky, would have met; None without any.
        plan: the first plan that was too risky, while a remedy is looked for.
        spent_s: counted work of sailing runs and legs until one failed [s]; 0 where none were sailed.
    """

    def __init__(self, obstacle: str, *, what: str = "", which: str = "", place: Any = None, remedy: str = "") -> None:
        self.obstacle, self.what, self.which = obstacle, what, which
        self.place = None if place is None else (float(place[0]), float(place[1]))
        self.remedies: tuple[str, ...] = (remedy,) if remedy else ()
        self.tried: tuple[str, ...] = ()
        self.poses: Any = None
        self.within: Any = None
        self.confidence: float | None = None
        self.plan: Any = None
        self.spent_s = 0.0
        super().__init__(obstacle)

    def __str__(self) -> str:
        return "; ".join((self.obstacle, *self.remedies))


class NoRoom(NoPlan):
    """The water looked at has no path, or no place for a run; more of the chart may have one."""

    lacking: tuple[str, ...] = ()  # runs that have no place, where each was looked at by itself


class NotDrawn(UserWarning):
    """A page or a figure of one could not be drawn, a defect of ours. It says so in its place; all results are kept."""


def _remade(kind: type[ExpdesignError], arguments: tuple[object, ...]) -> ExpdesignError:
    """An error with a message that is already made."""
    return kind.__new__(kind, *arguments)


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name closest to a mistyped one, or None."""
    found = get_close_matches(name, list(known), n=1, cutoff=0.5)
    return found[0] if found else None
