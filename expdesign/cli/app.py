"""The program, the arguments that its commands share, and how a command is carried out.

The solvers behind the workflows take seconds to load; each command loads them when it runs, so that `--help` and
typing mistakes do not wait.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated

import typer

from expdesign import __version__
from expdesign.cli.arguments import parse_seed
from expdesign.cli.progress import shown_progress
from expdesign.cli.summary import as_json, print_summary
from expdesign.interruptions import interruptions_wait

if TYPE_CHECKING:
    from expdesign.workflows import Outcome, Progress

app = typer.Typer(
    add_completion=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit status: 0 done; 2 the input is wrong; 3 the input is fine but has no answer; 130 interrupted.",
)

ScenarioFile = Annotated[
    Path,
    typer.Argument(metavar="SCENARIO.toml", help="Vessel, manoeuvres, sea area, start, goal and wishes."),
]
PlanFile = Annotated[
    Path,
    typer.Argument(metavar="PLAN.json", help="A plan made before, with the track.csv and commands.csv beside it."),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="FOLDER", help="Where to write; runs/<name of the scenario> when not given."),
]
OutBeside = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="FOLDER", help="Where to write; the plan's folder when not given."),
]
Seed = Annotated[
    int,
    typer.Option("--seed", parser=parse_seed, metavar="N", help="Start of the random numbers: same seed, same result."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print no progress and no summary, only errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print the summary as JSON, and nothing else, on stdout.")]


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
    """Plan a trial that tells most about how a ship moves, in the water it may use.

    [bold]run[/bold] makes everything from one scenario file: what each manoeuvre tells,
    how long to run each, one trajectory from start to goal, verified by
    simulating it again, route files and a report. The other commands are its
    steps, one at a time.

    Begin with: expdesign run scenarios/helsinki.toml
    """


def carry_out(name: str, work: Callable[[ModuleType, Progress], Outcome], quiet: bool, json: bool) -> None:
    """Do the work of one command, given the workflows and whom to tell of progress, and say what came of it."""
    with interruptions_wait():
        from expdesign import workflows
    with shown_progress(quiet=quiet) as progress:
        outcome = work(workflows, progress)
    if json:
        typer.echo(as_json(name, outcome))
    elif not quiet:
        print_summary(outcome)
