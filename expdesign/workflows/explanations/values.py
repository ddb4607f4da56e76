"""An explanation: a topic with sections of named entries."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Explained:
    """One thing that may be written."""

    name: str  # as it is written; keys are dotted
    meaning: str  # what it is, with its unit
    default: str = ""  # what stands in for it; "required", "optional", or ""
    allowed: str = ""  # the values it may have, or ""


@dataclass(frozen=True, kw_only=True)
class Section:
    """Entries that belong together."""

    name: str  # one word that asks for it
    title: str  # what it is
    entries: tuple[Explained, ...]  # what it explains


@dataclass(frozen=True, kw_only=True)
class Topic:
    """Output of one call of `expdesign explain`."""

    name: str  # the word that asks for it
    title: str  # one line
    text: str = ""  # a few sentences, or ""
    sections: tuple[Section, ...]  # what it explains
