"""Progress on stderr: a moving bar on a terminal, plain lines in a log, nothing when asked to be quiet."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from expdesign.progress import Progress, silent

PLAIN_STEP = 0.1
"""Least share of the work between two plain lines about the same activity."""
LEAST_SHARE = 0.1
"""Share of the work from which the time left is estimated."""


@contextmanager
def shown_progress(*, quiet: bool) -> Iterator[Progress]:
    """Where one command reports its progress."""
    console = Console(stderr=True)
    if quiet:
        yield silent
    elif console.is_interactive:
        known = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
        with Bar(*known, TextColumn("{task.fields[left]}"), console=console, transient=True) as bar:
            task, left = bar.add_task("starting", total=1.0, left=""), _TimeLeft()
            yield lambda activity, share: bar.update(task, description=activity, completed=share, left=left.at(share))
    else:
        yield _plain_lines(console)


class _TimeLeft:
    """The time left if the rest goes on as the work so far."""

    def __init__(self) -> None:
        self._began = time.monotonic()

    def at(self, share: float) -> str:
        """The time left in words, once a part of the work is done; "" where it is less than a second."""
        left_s = (time.monotonic() - self._began) * (1.0 - share) / max(share, LEAST_SHARE)
        if share < LEAST_SHARE or left_s < 1.0:
            return ""
        return f"about {left_s:.0f} s left" if left_s < 99.5 else f"about {left_s / 60.0:.0f} min left"


def _plain_lines(console: Console) -> Progress:
    last: tuple[str, float] | None = None
    left = _TimeLeft()

    def report(activity: str, share: float) -> None:
        nonlocal last
        if last is None or activity != last[0] or share >= last[1] + PLAIN_STEP:
            last = (activity, share)
            line = ", ".join(part for part in (activity, left.at(share)) if part)
            console.print(f"[{share:4.0%}] {line}", markup=False, highlight=False, soft_wrap=True)

    return report
