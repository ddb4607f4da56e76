"""The program: its options, its progress, and what it says of pages that could not be drawn."""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from expdesign import __version__
from expdesign.progress import Progress, silent

BUG = 1  # exit status of a defect of this program
NO_ANSWER = 3  # exit status where the input is fine but has no answer
PLAIN_STEP = 0.1  # least share of the work between two plain lines about the same activity
LEAST_SHARE = 0.1  # share of the work from which the time left is estimated
STANDING_S = 10.0  # least time in which the time left must have fallen


@contextmanager
def shown_progress(*, quiet: bool) -> Iterator[Progress]:
    """Where one command reports its progress."""
    console = Console(stderr=True)
    if quiet:
        yield silent
    elif console.is_interactive:
        activity, left_column = (
            TextColumn(text, markup=False) for text in ("{task.description}", "{task.fields[left]}")
        )
        known = (activity, BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), left_column)
        with Bar(*known, console=console, transient=True) as bar:
            left = _TimeLeft()
            task = bar.add_task("starting", total=1.0, left=left)
            yield lambda activity, share: bar.update(task, description=activity, completed=left.at(share))
    else:
        yield _plain_lines(console)


class _TimeLeft:
    """The time left if the rest goes on as the work so far, in words.

    It runs down until more is done. It is not known where the work says so, once it has run out, and where it has
    fallen by less than half of the time that has passed: the work grows as it goes.
    """

    def __init__(self) -> None:
        self._began_s, self._share, self._known = time.monotonic(), 0.0, True
        self._foreseen: list[tuple[float, float]] = []  # when it was foreseen, and the end

    def at(self, share: float) -> float:
        """Note the share done, nan where it is not known; the largest so far."""
        now_s, self._known = time.monotonic(), not math.isnan(share) and (self._known or share > self._share)
        if share > self._share:
            self._share = share
            if share >= LEAST_SHARE:
                self._foreseen.append((now_s, self._began_s + (now_s - self._began_s) / share))
        return self._share

    def __str__(self) -> str:
        """Nothing before a part of the work is done, and where less than a second is left."""
        if self._share >= 1.0 or (self._known and not self._foreseen):
            return ""
        now_s = time.monotonic()
        left_s = self._foreseen[-1][1] - now_s if self._known else -math.inf
        if left_s < 0.0 or self._stands(now_s, left_s):
            return "time left not known"
        if left_s < 1.0:
            return ""
        return f"about {left_s:.0f} s left" if left_s < 99.5 else f"about {left_s / 60.0:.0f} min left"

    def _stands(self, now_s: float, left_s: float) -> bool:
        """Whether what was foreseen as long ago as is left now, or at first, has come nearer by less than half."""
        before_s = now_s - max(left_s, STANDING_S)
        then_s, end_s = self._foreseen[max(bisect_right(self._foreseen, (before_s, math.inf)) - 1, 0)]
        passed_s = now_s - then_s
        return passed_s >= STANDING_S and left_s > end_s - then_s - passed_s / 2.0


def _plain_lines(console: Console) -> Progress:
    last: tuple[str, float] | None = None
    left = _TimeLeft()

    def report(activity: str, share: float) -> None:
        nonlocal last
        share = left.at(share)
        if last is None or activity != last[0] or share >= last[1] + PLAIN_STEP:
            last = (activity, share)
            line = ", ".join(part for part in (activity, str(left)) if part)
            console.print(f"[{share:4.0%}] {line}", markup=False, highlight=False, soft_wrap=True)

    return report


app = typer.Typer(
    add_completion=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit status: 0 done; 2 the input is wrong; 3 the input is fine but has no answer; 130 interrupted.",
)

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print no progress and no summary, only errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print the summary as JSON, and nothing else, on stdout.")]


def tell_gaps(files: Sequence[Path]) -> None:
    """Say which pages or figures could not be drawn, and end with the status of a defect if any."""
    from expdesign.export.folder import gaps

    found = gaps(files)
    for line in found:
        typer.echo(f"expdesign: error: {line}", err=True)
    if found:
        raise typer.Exit(BUG)


def _show_version(asked: bool) -> None:
    if asked:
        typer.echo(f"expdesign {__version__}")
        raise typer.Exit


@app.callback()
def expdesign(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_show_version, help="Print the version and stop.")
    ] = False,
) -> None:
    """Plan full-scale manoeuvring trials of ships, and learn a ship's model from their data.

    run does everything from one scenario file: it simulates the manoeuvres,
    decides how long to run each, plans one trajectory from start to goal in
    allowed water, verifies it, and writes route files and a report. The other
    commands are its steps, and what follows when data have been measured.

    Begin with: expdesign new mytrial

    then: expdesign run mytrial/scenario.toml

    What may stand in a file: expdesign explain
    """
