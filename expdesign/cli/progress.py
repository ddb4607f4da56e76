"""Progress on stderr: a moving bar on a terminal, plain lines in a log, nothing when asked to be quiet."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

if TYPE_CHECKING:
    from expdesign.workflows import Progress

PLAIN_STEP = 0.1
"""Least share of the whole between two plain lines about the same thing."""


@contextmanager
def shown_progress(*, quiet: bool) -> Iterator[Progress]:
    """A receiver of (what is being done, fraction done of the whole, 0 to 1) for the length of one command."""
    console = Console(stderr=True)
    if quiet:
        yield lambda what, fraction: None
    elif console.is_interactive:
        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
        with Bar(*columns, console=console, transient=True) as bar:
            task = bar.add_task("starting", total=1.0)
            yield lambda what, fraction: bar.update(task, description=what, completed=fraction)
    else:
        yield _plain_lines(console)


def _plain_lines(console: Console) -> Progress:
    last: tuple[str, float] | None = None

    def tell(what: str, fraction: float) -> None:
        nonlocal last
        if last is None or what != last[0] or fraction >= last[1] + PLAIN_STEP:
            last = (what, fraction)
            console.print(f"[{fraction:4.0%}] {what}", markup=False, highlight=False, soft_wrap=True)

    return tell
