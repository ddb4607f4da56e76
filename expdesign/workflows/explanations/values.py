"""An explanation: a topic with sections of named entries."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Explained:
    """One thing that may be written.

    Attributes:
        name: as it is written; keys are dotted.
        meaning: what it is, with its unit.
        default: what stands in for it; "required", "optional", or "".
        allowed: the values it may have, or "".
    """

    name: str
    meaning: str
    default: str = ""
    allowed: str = ""


@dataclass(frozen=True, kw_only=True)
class Section:
    """Entries that belong together.

    Attributes:
        name: one word that asks for it.
        title: what it is.
        entries: what it explains.
    """

    name: str
    title: str
    entries: tuple[Explained, ...]


@dataclass(frozen=True, kw_only=True)
class Topic:
    """Output of one call of `expdesign explain`.

    Attributes:
        name: the word that asks for it.
        title: one line.
        text: a few sentences, or "".
        sections: what it explains.
    """

    name: str
    title: str
    text: str = ""
    sections: tuple[Section, ...]
