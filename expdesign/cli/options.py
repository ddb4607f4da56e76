"""Arguments and options that several commands share, and checks of them before they are parsed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path
from typing import Annotated

import typer

from expdesign.errors import InputError

# Arguments before they are parsed, and checks that no file reader can make.


def repeat_option(arguments: Sequence[str], option: str, *, files: bool = False) -> list[str]:
    """Spell out a list of values: `--format rtz gpx` becomes `--format rtz --format gpx`.

    A list ends at the next option and, unless it lists files, at anything that looks like a file, i.e. has a slash or
    an ending that is no number: rtz-1.0 is a value.
    """
    spelled, rest = [], list(arguments)
    while rest:
        spelled.append(rest.pop(0))
        if spelled[-1] == option and rest:
            first, *more = rest
            values = [first, *takewhile(_looks_like_file_or_value if files else _looks_like_value, more)]
            spelled += [values[0], *(part for value in values[1:] for part in (option, value))]
            rest = rest[len(values) :]
    return spelled


def parse_seed(text: str) -> int:
    """The seed of all random numbers.

    Raises:
        InputError: not a whole number of 0 or more.
    """
    return _count("--seed", text)


def parse_jobs(text: str) -> int:
    """The number of processes, 0 for one per core.

    Raises:
        InputError: not a whole number of 0 or more.
    """
    return _count("--jobs", text)


def check_out(out: Path | None) -> Path | None:
    """The folder for results, before hours are spent on something that cannot be written there.

    Raises:
        InputError: it is a file, lies below a file, or may not be written to.
    """
    if out is None:
        return None
    there = next(path for path in (out, *out.absolute().parents) if path.exists() or path.is_symlink())
    if there.is_symlink() and not there.exists():
        raise InputError(f"--out {out}: {there} is a link to {there.readlink()}, which does not exist")
    if not there.is_dir():
        raise InputError(f"--out {out}: {there} is a file, expected a folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(f"--out {out}: no permission to write in {there}")
    return out


def _count(option: str, text: str) -> int:
    if not str(text).isdecimal():
        raise InputError(f"{option} is {text}, expected a whole number of 0 or more")
    return int(text)


def _looks_like_value(text: str) -> bool:
    _, dot, ending = text.rpartition(".")
    return not text.startswith("-") and "/" not in text and (not dot or ending.isdecimal())


def _looks_like_file_or_value(text: str) -> bool:
    return not text.startswith("-")


# Arguments and options that several commands share.


def out_option(default: str) -> object:
    """`--out`, checked; `default` says where results go without it."""
    return typer.Option(
        "--out", "-o", metavar="FOLDER", callback=check_out, help=f"Folder for the results. Default: {default}."
    )


Out = Annotated[Path | None, out_option("runs/<name of the scenario>")]
OutBesidePlan = Annotated[Path | None, out_option("the folder of the plan")]
OutByData = Annotated[Path | None, out_option("runs/<first data file>")]
OutByLog = Annotated[Path | None, out_option("runs/<first log>-runs")]
OutByVessel = Annotated[Path | None, out_option("runs/<vessel>-indices")]
OutByCard = Annotated[Path | None, out_option("runs/<card>-nominal")]
OutInclined = Annotated[Path | None, out_option("runs/<vessel>-incline")]
OutWhatIf = Annotated[Path | None, out_option("runs/<scenario>-whatif")]

ScenarioFile = Annotated[
    Path,
    typer.Argument(
        metavar="SCENARIO.toml", help="Names vessel, dictionary and area; see expdesign explain scenario for its keys."
    ),
]
OtherVessel = Annotated[
    Path | None,
    typer.Option(
        "--vessel",
        metavar="VESSEL.toml",
        help="In place of the vessel file that the scenario names, e.g. vessel-steps.toml or vessel-estimated.toml.",
    ),
]
PlanFile = Annotated[
    Path,
    typer.Argument(metavar="PLAN.json", help="A plan made before; its track.csv and commands.csv must lie beside it."),
]
DataFiles = Annotated[
    list[Path],
    typer.Argument(
        metavar="DATA.csv ...", help="Measured runs, or folders of them; see expdesign explain data for their columns."
    ),
]
Seed = Annotated[
    int,
    typer.Option("--seed", parser=parse_seed, metavar="N", help="Seed of all random numbers; same seed, same result."),
]
MOST_TRIALS = 100_000
"""Simulated trials of a design, or of a manoeuvre, at most."""
MOST_VOYAGES = 1000
"""Simulated voyages of each change in operation, at most."""
Jobs = Annotated[
    int, typer.Option("--jobs", parser=parse_jobs, metavar="N", help="Number of processes; 0 for one per core.")
]
Scheduler = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="ADDRESS", help="Dask scheduler to compute on instead, e.g. tcp://host:8786."),
]
NoCache = Annotated[
    bool,
    typer.Option(
        "--no-cache",
        help="Neither read nor keep results of earlier commands, as with EXPDESIGN_CACHE=off. That variable may also "
        "name the folder for them. Default: ~/.cache/expdesign, at most 256 MiB.",
    ),
]
Resume = Annotated[
    bool,
    typer.Option(
        "--resume",
        help="Go on from the state that an earlier watch left in the same folder, however it ended. Rows that it had "
        "read are skipped: give the same file, grown or not, the next one, or the stream from before its end.",
    ),
]
Fixed = Annotated[
    list[str] | None,
    typer.Option("--fixed", metavar="NAME ...", help="Parameters kept at the vessel file's values."),
]
Velocity = Annotated[
    str,
    typer.Option(
        metavar="HOW",
        help="Source of u, v, r: measured; difference or smoothed, both from the pose; auto: measured where there are "
        "such columns, else difference.",
    ),
]
Mean = Annotated[
    str,
    typer.Option(
        metavar="HOW",
        help="Mean subtracted from the instruments, against constant disturbances: complete, batch or none. Use none "
        "where an input never changes.",
    ),
]
Throttle = Annotated[
    list[str] | None,
    typer.Option(
        "--throttle",
        metavar="NAME ...",
        help="Signals whose mean drives the vessel, e.g. n1. Default: all n, else tau_x.",
    ),
]
Rudder = Annotated[
    list[str] | None,
    typer.Option(
        "--rudder",
        metavar="NAME ...",
        help="Signals whose mean turns it. Default: all rudder, else all a, else tau_psi, else half the difference "
        "of the first and the last n.",
    ),
]
