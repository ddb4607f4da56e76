"""Progress on stderr: a moving bar on a terminal, plain lines in a log, nothing when asked to be quiet."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from expdesign.progress import Progress, silent

PLAIN_STEP = 0.1
"""Least share of the work between two plain lines about the same activity."""


@contextmanager
def shown_progress(*, quiet: bool) -> Iterator[Progress]:
    """Where one command reports its progress."""
    console = Console(stderr=True)
    if quiet:
        yield silent
    elif console.is_interactive:
        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
        with Bar(*columns, console=console, transient=True) as bar:
            task = bar.add_task("starting", total=1.0)
            yield lambda activity, share: bar.update(task, description=activity, completed=share)
    else:
        yield _plain_lines(console)


def _plain_lines(console: Console) -> Progress:
    last: tuple[str, float] | None = None

    def report(activity: str, share: float) -> None:
        nonlocal last
        if last is None or activity != last[0] or share >= last[1] + PLAIN_STEP:
            last = (activity, share)
            console.print(f"[{share:4.0%}] {activity}", markup=False, highlight=False, soft_wrap=True)

    return report
