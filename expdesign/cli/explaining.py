"""`expdesign explain`, on a terminal, in a pipe and as JSON."""

from __future__ import annotations

import json as json_text
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markdown import Markdown
from rich.table import Table

from expdesign.cli.app import Json
from expdesign.interruptions import interruptions_wait

if TYPE_CHECKING:
    from expdesign.workflows.commands.explain import Explained, Section, Topic


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


def _table(section: Section) -> Table:
    columns = [name for name in ("default", "allowed") if any(getattr(item, name) for item in section.entries)]
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="underline")
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
