"""All commands: each request becomes a command of the same options, which hands them to its workflow.

A workflow is loaded only when its command runs.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Mapping
from dataclasses import MISSING
from types import GenericAlias
from typing import Annotated, Any, get_args, get_origin

import typer

from expdesign.cli.app import NO_ANSWER, Json, Quiet, app, shown_progress, tell_gaps
from expdesign.cli.explaining import explain
from expdesign.cli.pages import web
from expdesign.cli.summary import as_json, print_summary, unverified
from expdesign.errors import NotDrawn
from expdesign.interruptions import interruptions_wait
from expdesign.requests import COMMANDS, Command, asked
from expdesign.requests.options import Argument, Option


def carry_out(command: Command, options: Mapping[str, object], *, quiet: bool, json: bool) -> None:
    """Run a command, show its progress, and print what came of it."""
    with interruptions_wait():  # some solvers do not stand being interrupted while they load
        from expdesign import workflows

        work = getattr(workflows, command.workflow)
    lines = {"tell": _untold if quiet or json else _tell} if command.tells else {}
    with shown_progress(quiet=quiet) as progress, warnings.catch_warnings():
        warnings.simplefilter("ignore", NotDrawn)  # told below
        outcome = work(**options, progress=progress, **lines)
    if json:
        typer.echo(as_json(command.name, outcome))
    elif not quiet:
        print_summary(outcome)
    tell_gaps(outcome.files)
    if doubt := unverified(outcome.summary):
        typer.echo(f"expdesign: error: {doubt}", err=True)
        raise typer.Exit(NO_ANSWER)


def _tell(line: str) -> None:
    """Print a line at once, for whoever reads the output as it comes."""
    typer.echo(line)  # flushes


def _untold(line: str) -> None:
    """Say nothing."""


def given(options: Mapping[str, object]) -> dict[str, object]:
    """Options as a workflow takes them: lists as tuples, empty where none is given; --no-cache is no cache."""
    found = {name: tuple(value) if isinstance(value, list) else value for name, value in options.items()}
    if "no_cache" in found:
        found["cache"] = not found.pop("no_cache")
    return found


def register(command: Command) -> None:
    """Make a command of its request, with --quiet and --json besides."""
    entries = tuple(asked(command.request))
    lists = {one.name for one in entries if get_origin(one.kind) is tuple}

    def run(*, quiet: bool, json: bool, **options: object) -> None:
        named = {name: value or () if name in lists else value for name, value in options.items()}
        carry_out(command, given(named), quiet=quiet, json=json)

    kind = inspect.Parameter.KEYWORD_ONLY
    parameters = [
        inspect.Parameter(
            one.name,
            kind,
            default=inspect.Parameter.empty if one.default is MISSING else one.default if one.default != () else None,
            annotation=_typed(one.kind, one.flag, one.typed, required=one.default is MISSING),
        )
        for one in entries
    ]
    parameters += [
        inspect.Parameter(name, kind, default=False, annotation=hint)
        for name, hint in (("quiet", Quiet), ("json", Json))
    ]
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {part.name: part.annotation for part in parameters}
    run.__doc__ = command.request.__doc__
    app.command(command.name)(run)


def _typed(kind: Any, flag: str, typed: Option | Argument, *, required: bool) -> Any:
    """The annotation of a parameter as typer reads it."""
    if get_origin(kind) is tuple:
        listed = GenericAlias(list, get_args(kind)[:1])
        kind = listed if required else listed | None
    if isinstance(typed, Argument):
        return Annotated[kind, typer.Argument(metavar=typed.metavar, help=typed.help)]
    flags = (flag, typed.short) if typed.short else (flag,)
    return Annotated[
        kind,
        typer.Option(
            *flags, metavar=typed.metavar, help=typed.help, min=typed.min, max=typed.max, parser=typed.parser,
            callback=typed.callback,
        ),
    ]  # fmt: skip


for each in COMMANDS:
    register(each)
app.command("explain")(explain)
app.command("web")(web)
