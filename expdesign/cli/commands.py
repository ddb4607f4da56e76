"""All commands, and what a finished one prints: for people, or as JSON.

A workflow is loaded only when its command runs. `explain` and `web` have no request: they write no results.
"""

from __future__ import annotations

import importlib.util
import inspect
import json as json_text
import os
import secrets
import warnings
import webbrowser
from collections.abc import Mapping
from dataclasses import MISSING, asdict
from pathlib import Path
from types import GenericAlias
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_origin

import typer
from rich.console import Console
from rich.markdown import Markdown
from rich.table import Table as Columns

from expdesign.cli.app import NO_ANSWER, Json, Quiet, app, shown_progress, tell_gaps
from expdesign.errors import InputError, NotDrawn
from expdesign.interruptions import interruptions_wait
from expdesign.requests import COMMANDS, Command
from expdesign.requests.options import Argument, Asked

if TYPE_CHECKING:
    from expdesign.export.document import Table
    from expdesign.workflows import Outcome
    from expdesign.workflows.commands.explain import Explained, Section, Topic


def as_json(command: str, outcome: Outcome) -> str:
    """One JSON object: `command`, `files` written, and the document's `summary`, `verdict`, `findings` and `notes`."""
    from expdesign.export.files.text import ready

    document = outcome.document
    content = {
        "command": command,
        "files": [str(path) for path in outcome.files],
        "summary": document.summary,
        **({} if document.mark is None else {"verdict": document.mark.text}),
        "findings": list(document.findings),
        "notes": list(document.all_notes),
    }
    return json_text.dumps(ready(content), indent=2, ensure_ascii=False, allow_nan=False)


def unverified(summary: Mapping[str, object]) -> str:
    """Why a plan that was asked for whole is written but not verified; "" for all other results."""
    whole = summary.get("verified") is False and not summary.get("draft")
    return f"the plan is written but not verified: {summary.get('verdict')}" if whole else ""


def print_summary(outcome: Outcome) -> None:
    """Facts, tables, findings and notes of the document, then the files and the page to open."""
    from expdesign.export.document import fact_rows, listings

    document = outcome.document
    console = Console(highlight=False, markup=False, soft_wrap=True)
    if document.title:
        console.print(f"{document.kind}: {document.title}", style="bold")
    if document.mark is not None:
        console.print(document.mark.text, style="bold")
    table = Columns(show_header=False, box=None, padding=(0, 3, 0, 0))
    for row in fact_rows(document.facts):
        table.add_row(*row)
    if table.row_count:
        console.print(table)
        console.print()
    for one in document.tables:
        _print_table(console, one)
    for title, lines in listings(document):
        console.print(title, style="bold")
        console.print(*lines, sep="\n")
        console.print()
    for line in (*document.findings, *[""] * bool(document.findings)):
        console.print(line)
    if document.all_notes:
        console.print("Notes", style="bold")
        for note in document.all_notes:
            console.print(f"- {note}")
        console.print()
    for folder, names in _by_folder(outcome.files).items():
        console.print(f"Written to {folder}: {', '.join(names)}")
    for page in (path for path in outcome.files if path.suffix == ".html"):
        console.print(f"Open {page} in a browser.")


def _print_table(console: Console, table: Table) -> None:
    """Title, header and rows, each line as long as it needs to be."""
    rows = [[cell.replace("\n", ", ") for cell in row] for row in (table.header, *table.rows)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    console.print(table.title, style="bold")
    for index, row in enumerate(rows):
        line = "   ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        console.print(line, style="" if index else "underline")
    console.print()


def _by_folder(files: tuple[Path, ...]) -> dict[str, list[str]]:
    folders: dict[str, list[str]] = {}
    for path in files:
        folders.setdefault(f"{path.parent}{os.sep}", []).append(path.name)
    return folders


NEEDED = ("nicegui", "tomlkit")  # packages of the extra `web`


def web(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Scenarios and results; nothing else is touched.")
    ] = Path(),
    port: Annotated[
        int, typer.Option("--port", metavar="N", min=0, max=65535, help="Of the address; 0 for any.")
    ] = 8120,
    host: Annotated[
        str,
        typer.Option(
            "--host", metavar="ADDRESS", help="Address to be bound to. Other than this machine needs a token."
        ),
    ] = "127.0.0.1",
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only print the address.")] = False,
) -> None:
    """Open a page on a folder of scenarios: draw the area, choose manoeuvres, plan, play, import and diagnose.

    The page runs the commands of this program and shows each of them; files stay the truth. It can be opened on this
    machine only, unless --host says otherwise; then the address that is printed holds a token. Ctrl-C ends it.

    Example: expdesign web mytrial
    """
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"the page needs {' and '.join(missing)}: pip install 'expdesign[web]'")
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder, expected one with scenarios, or an empty one")
    from expdesign.web.server import LOOPBACK, serve

    token = None if host in LOOPBACK else secrets.token_urlsafe(24)

    def ready(address: str) -> None:
        typer.echo(f"Open {address} in a browser. Ctrl-C ends it.")
        if not no_browser:
            webbrowser.open(address)

    serve(folder, host=host, port=port, token=token, ready=ready)


def explain(
    subject: Annotated[
        str, typer.Argument(metavar="TOPIC or NAME", help="A topic, a key such as design.total_s, or a family.")
    ] = "",
    json: Json = False,
) -> None:
    """Explain the keys of files and all names that can be chosen. Without a topic: list the topics.

    Example: expdesign explain scenario
    """
    with interruptions_wait():
        from expdesign.workflows import explain as explained

        topic = explained(subject)
    if json:
        typer.echo(json_text.dumps(asdict(topic), indent=2, ensure_ascii=False))
        return
    console = Console(highlight=False, markup=False)
    if console.is_terminal:
        _show(console, topic)
    else:
        typer.echo("\n".join(_lines(topic)))


def _show(console: Console, topic: Topic) -> None:
    """Tables as wide as the terminal."""
    console.print(topic.title, style="bold")
    if topic.text:
        console.print(topic.text if topic.sections else Markdown(topic.text))
    for section in topic.sections:
        console.print()
        if section.title:
            console.print(section.title, style="bold")
        console.print(_table(section))


def _table(section: Section) -> Columns:
    columns = [name for name in ("default", "allowed") if any(getattr(item, name) for item in section.entries)]
    table = Columns(box=None, padding=(0, 2, 0, 0), header_style="underline")
    table.add_column("name", no_wrap=True)
    for name in ("meaning", *columns):
        table.add_column(name, overflow="fold")
    for entry in section.entries:
        table.add_row(entry.name, entry.meaning, *(getattr(entry, name) for name in columns))
    return table


def _lines(topic: Topic) -> list[str]:
    """One line for each entry, for pipes."""
    lines = [topic.title, *([topic.text] if topic.text else [])]
    for section in topic.sections:
        lines += ["", *([section.title] if section.title else []), *map(_line, section.entries)]
    return lines


def _line(entry: Explained) -> str:
    stated = entry.default in ("", "required", "optional")
    default = entry.default if stated else f"default {entry.default}"
    notes = "; ".join(note for note in (default, entry.allowed) if note)
    return f"{entry.name}: {entry.meaning}" + (f" ({notes})" if notes else "")


def run_command(command: Command, options: Mapping[str, object], *, quiet: bool, json: bool) -> None:
    """Run a command, show its progress, and print what came of it."""
    with interruptions_wait():
        from expdesign.workflows import carry_out

        request = command.request(**options)
    with shown_progress(quiet=quiet) as progress, warnings.catch_warnings():
        warnings.simplefilter("ignore", NotDrawn)  # told below
        outcome = carry_out(request, progress=progress, tell=_untold if quiet or json else _tell)
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


def register(command: Command) -> None:
    """Make a command of its request, with --quiet and --json besides."""
    entries = command.request.asked()

    def run(*, quiet: bool, json: bool, **options: object) -> None:
        run_command(command, options, quiet=quiet, json=json)

    kind = inspect.Parameter.KEYWORD_ONLY
    parameters = [
        inspect.Parameter(
            one.name,
            kind,
            default=inspect.Parameter.empty if one.default is MISSING else one.default if one.default != () else None,
            annotation=_typed(one),
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


def _typed(one: Asked) -> Any:
    """The annotation of a parameter as typer reads it; choices are checked by the request, in its words."""
    kind, typed, required = str | None if one.choices else one.kind, one.typed, one.default is MISSING
    if get_origin(kind) is tuple:
        listed = GenericAlias(list, get_args(kind)[:1])
        kind = listed if required else listed | None
    if isinstance(typed, Argument):
        return Annotated[kind, typer.Argument(metavar=typed.metavar, help=typed.help)]
    flags = (one.flag, typed.short) if typed.short else (one.flag,)
    allowed = f" Allowed: {typed.range}." if typed.range else ""
    return Annotated[kind, typer.Option(*flags, metavar=typed.metavar, help=typed.help + allowed, parser=typed.parser)]


for each in COMMANDS:
    register(each)
app.command("explain")(explain)
app.command("web")(web)
