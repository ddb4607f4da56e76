"""A result as one document, of which page, terminal and JSON are three renderings.

A function of each kind of result says once what is found, what is noted, and in which tables and figures. Findings,
facts and notes are on the page (`expdesign.export.pages.document_html`), on the terminal and in the JSON of a command
(`expdesign.cli.commands`), wherever they stand in the document; paragraphs and figures are on the page alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from markupsafe import Markup

from expdesign.export.words import HOUR, hours

UNITS = {
    "s": "s",
    "m": "m",
    "mps": "m/s",
    "radps": "rad/s",
    "rad": "rad",
    "deg": "°",
    "kn": "kn",
    "rps": "1/s",
    "kg": "kg",
    "h": "h",
}
"""Last part of the name of a fact -> printed unit."""
UNKNOWN, NONE = "-", "none"  # of facts without a value, and of lists of nothing


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows of texts under a header. A cell of two lines has its explanation in the second."""

    header: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    title: str = ""  # where it stands by itself, as on a terminal; that of its section where empty
    texts: int = 1  # leading columns of words; numbers follow
    on: Literal["all", "page", "terminal"] = "all"  # a table that is wide or long has a shorter one for the terminal
    shaded: int | None = None  # column that is emphasised
    marked: frozenset[int] = frozenset()  # rows that are
    form: bool = False  # whether empty cells are to be filled in by hand


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure of the page, which is drawn when the page is written."""

    draw: Callable[[], str | Markup]
    caption: str | Markup = ""
    legend: Sequence[Mapping[str, str]] = ()  # sign, colour and text of what is drawn, below it
    above: bool = False  # whether the caption is a title above it


@dataclass(frozen=True)
class Gallery:
    """Figures beside each other, each with its caption above."""

    figures: tuple[Figure, ...]
    small: bool = False
    folded: str = ""  # what they are, where the reader opens them


@dataclass(frozen=True)
class Items:
    """A list of explanations."""

    texts: tuple[str | Markup, ...]
    ordered: bool = False
    folded: str = ""  # what they are, where the reader opens them


@dataclass(frozen=True)
class Terms:
    """Words and what they mean."""

    entries: tuple[tuple[str, str | Markup], ...]


def verdict(text: str, good: bool | None) -> Markup:
    """A cell of a table on a page that says in a word or two whether something is as it should be."""
    return Markup('<span class="mark {}">{}</span>').format({True: "yes", False: "no", None: "open"}[good], text)


@dataclass(frozen=True)
class Listing:
    """Lines as they are typed, on page and terminal."""

    lines: tuple[str, ...]


@dataclass(frozen=True)
class Note:
    """What the reader must hear: a doubt, a warning or advice."""

    text: str
    of: str = ""  # what it is about, where it stands under a heading that says so

    @property
    def alone(self) -> str:
        """The note where no heading stands above it."""
        return f"{self.of}: {self.text}" if self.of else self.text


Block = str | Markup | Table | Figure | Gallery | Items | Terms | Listing | Note
"""Of a section; a text is a paragraph that explains."""


@dataclass(frozen=True, kw_only=True)
class Section:
    """Blocks under a heading."""

    title: str
    blocks: tuple[Block, ...] = ()
    level: Literal[2, 3] = 2  # of the heading
    beside: bool = False  # whether it stands beside neighbours that do, too, on a wide page


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A verdict in a word or two; `good` is None where it is open."""

    text: str
    good: bool | None = None


@dataclass(frozen=True, kw_only=True)
class Document:
    """What a command has found."""

    kind: str = ""  # of result, above the title
    title: str = ""
    name: str = ""  # of the page among others; the title where empty
    about: str | Markup = ""  # ship, data and conditions, in a line
    mark: Mark | None = None
    findings: tuple[str, ...] = ()  # sentences, the most important first
    facts: Mapping[str, object] = field(default_factory=dict)  # key numbers ready for JSON, units in the names
    values: Mapping[str, object] = field(default_factory=dict)  # more of them, for JSON alone
    sections: tuple[Section, ...] = ()
    notes: tuple[str, ...] = ()  # on the data
    command: str = ""  # to reproduce it

    def __add__(self, other: Document) -> Document:
        """Both, one after the other; what is above the first's findings stays."""
        return replace(
            self,
            findings=(*self.findings, *other.findings),
            facts={**self.facts, **other.facts},
            values={**self.values, **other.values},
            sections=(*self.sections, *other.sections),
            notes=(*self.notes, *other.notes),
        )

    @property
    def summary(self) -> Mapping[str, object]:
        """Facts and values, ready for JSON."""
        return {**self.facts, **self.values}

    @property
    def all_notes(self) -> tuple[str, ...]:
        """Each note of the document once, those on the data last."""
        blocks = (block for section in self.sections for block in section.blocks)
        said = (block.alone for block in blocks if isinstance(block, Note))
        return tuple(dict.fromkeys((*said, *self.notes)))

    @property
    def tables(self) -> tuple[Table, ...]:
        """Tables for a terminal, each with a title."""
        return tuple(
            Table(title=block.title or section.title, header=block.header, rows=block.rows, texts=block.texts)
            for section in self.sections
            for block in section.blocks
            if isinstance(block, Table) and block.on != "page" and block.rows
        )


def listings(document: Document) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Every listing of a document under the title of its section."""
    for part in document.sections:
        yield from ((part.title, block.lines) for block in part.blocks if isinstance(block, Listing))


def section(title: str, *blocks: Block, level: Literal[2, 3] = 2, beside: bool = False) -> Section:
    """Blocks under a heading."""
    return Section(title=title, blocks=blocks, level=level, beside=beside)


def tabled(*tables: Table) -> tuple[Section, ...]:
    """A section of each table, under its title."""
    return tuple(Section(title=table.title, blocks=(table,)) for table in tables)


def filled(*sections: Section) -> tuple[Section, ...]:
    """The sections without those whose tables have no rows."""
    tables = ([block for block in part.blocks if isinstance(block, Table)] for part in sections)
    return tuple(part for part, own in zip(sections, tables, strict=True) if not own or any(one.rows for one in own))


def notes_of(texts: Sequence[str], *, of: str = "") -> tuple[Note, ...]:
    """A note of each text."""
    return tuple(Note(text, of) for text in texts)


def fact_rows(facts: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, str]]:
    """(label, value with unit) of every fact, nested ones after the name of their parent."""
    for key, value in facts.items():
        stem, _, suffix = key.rpartition("_")
        unit = UNITS.get(suffix, "") if stem else ""
        label = f"{prefix}{(stem if unit else key).replace('_', ' ')}"
        if isinstance(value, Mapping) and value:
            yield from fact_rows(value, f"{label}, ")
        elif unit == "h" and isinstance(value, float) and math.isfinite(value):
            yield label, hours(value * HOUR)
        else:
            text = fact_text(value)
            yield label, text if text in (UNKNOWN, NONE) else f"{text} {unit}".rstrip()


def fact_text(value: object) -> str:
    """A value of a fact; "-" where it is not known, "none" of things of which there are none."""
    if value is None:
        return UNKNOWN
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and not math.isfinite(value):
        return UNKNOWN
    if isinstance(value, (str, Mapping, list, tuple)) and not value:
        return NONE
    if isinstance(value, float):
        return f"{value:.0f}" if 1e4 <= abs(value) < 1e9 else f"{value:.5g}"
    if isinstance(value, Mapping):
        return " ".join(fact_text(part) for part in value.values())
    if isinstance(value, (list, tuple)):
        return ", ".join(fact_text(part) for part in value)
    return str(value)
