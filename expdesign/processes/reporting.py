"""Progress of tasks in other processes: each writes into a file how far it is, and the process that waits reads it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Lock, Thread

from expdesign.processes.sharing import shared_among
from expdesign.progress import Progress

LOOK_S = 0.2
"""Between two looks at the reports."""


@dataclass(frozen=True)
class Reporter:
    """Progress of one task; where its file is not there, as on another machine, nothing is reported."""

    path: Path

    def __call__(self, activity: str, share: float) -> None:
        """Write a line."""
        with suppress(OSError), self.path.open("r+", encoding="utf-8") as file:
            file.seek(0, 2)
            file.write(f"{float(share)!r} {activity}\n")

    def last(self) -> str:
        """The last line; nothing done at first."""
        *_, line = "0.0 ", *self.path.read_text("utf-8").splitlines()
        return line


class Together:
    """Progress of tasks begun in this order, of about the same length: `reporters` has one for each."""

    def __init__(self, progress: Progress, reporters: tuple[Reporter, ...], at_once: int) -> None:
        """Nothing is reported yet; so many tasks are worked on at once."""
        self.reporters, self._progress, self._at_once = reporters, progress, at_once
        self._known, self._looking = [reporter.last() for reporter in reporters], Lock()

    def look(self) -> None:
        """Report what is new."""
        with self._looking:
            for number, reporter in enumerate(self.reporters):
                if (new := reporter.last()) != self._known[number]:
                    self._known[number] = new
                    done = sum(float(line.partition(" ")[0]) for line in self._known)
                    self._progress(new.partition(" ")[2], _elapsed(done, len(self._known), self._at_once))

    def finished(self, number: int, activity: str) -> None:
        """Report at once that a task is finished."""
        self.reporters[number](activity, 1.0)
        self.look()


@contextmanager
def reported_together(progress: Progress, count: int) -> Iterator[Together]:
    """Progress of so many tasks, begun in this order, of about the same length: reported while this block lasts."""
    with TemporaryDirectory(prefix="expdesign-") as folder:
        reporters = tuple(Reporter(Path(folder) / str(number)) for number in range(count))
        for reporter in reporters:
            reporter.path.touch()
        together, ended = Together(progress, reporters, shared_among()), Event()
        listener = Thread(target=_listen, args=(together, ended), daemon=True)
        listener.start()
        try:
            yield together
        finally:
            ended.set()
            listener.join()
            together.look()


def _listen(together: Together, ended: Event) -> None:
    while not ended.wait(LOOK_S):
        together.look()


def _elapsed(done: float, count: int, at_once: int) -> float:
    """Share of the time gone when so much of equal tasks is done, so many at once: the last may be fewer."""
    rounds, rest = divmod(count, at_once)
    before = min(done / at_once, rounds)
    after = max(done - rounds * at_once, 0.0) / rest if rest else 0.0
    return (before + after) / (rounds + bool(rest))
