"""What a watch over a ship in operation would find, before it begins: JSON and a document."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from expdesign.export import words
from expdesign.export.document import Document, Table, section
from expdesign.export.files import strict_json
from expdesign.export.foresight_page import NONE
from expdesign.foresight import Detectability, OperationForesight, interval

OPERATION_HEADER = ("Change", "By", "Found", "95 %", "Median delay", "Named rightly", "Or as likely", "Else taken for")
"""Columns of the table for people."""
FINDS = 0.5
"""Share of voyages from which a change counts as found."""


@dataclass(frozen=True, kw_only=True)
class OperationContent:
    """The values that page and file show."""

    # scenario, vessel: their names
    scenario: str
    vessel: str
    found: OperationForesight  # what is foreseen


def operation_rows(found: OperationForesight) -> tuple[tuple[str, ...], ...]:
    """One row for each change and size, in the order of `OPERATION_HEADER`."""
    return tuple(_row(item) for item in found.rows)


def _row(item: Detectability) -> tuple[str, ...]:
    low, high = interval(item.found, item.voyages)
    return (
        item.change,
        f"{100.0 * item.size:g}{words.NB}%",
        f"{item.found} of {item.voyages}",
        f"{100 * low:.0f} to {100 * high:.0f} %",
        words.duration(item.delay_s) if math.isfinite(item.delay_s) else "more than a voyage",
        f"{item.named} of {item.found}",
        f"{item.likely} of {item.found}",
        ", ".join(f"{name} ({count})" for name, count in item.taken_for) or NONE,
    )


def operation_sentences(found: OperationForesight) -> tuple[str, ...]:
    """What follows, in sentences."""
    return tuple(_sentences_operation(found))


def _sentences_operation(found: OperationForesight) -> Iterator[str]:
    low, high = interval(found.false_alarms, found.nominal)
    yield (
        f"Of {words.counted(found.nominal, 'voyage')} of {words.duration(found.voyage_s)} without a change, "
        f"{found.false_alarms or 'none'} raised an alarm (95 % interval of the share: {100 * low:.0f} to "
        f"{100 * high:.0f} %). The threshold allows one in {words.counted(found.false_alarm_days, 'day')} at most."
    )
    for change in dict.fromkeys(item.change for item in found.rows):
        own = sorted((item for item in found.rows if item.change == change), key=lambda item: item.size)
        first = next((item for item in own if item.found >= FINDS * item.voyages), None)
        if first is None:
            yield f"{_named(own[-1])} is found in {own[-1].found} of {own[-1].voyages} voyages only."
            continue
        yield (
            f"{_named(first)} is found in {first.found} of {first.voyages} voyages, after "
            f"{words.duration(first.delay_s)} in half of them."
        )
    for item in found.rows:
        if item.taken_for and item.found - item.named > FINDS * item.found:
            name, count = item.taken_for[0]
            wrong, told = item.found - item.named, item.likely - item.named
            yield (
                f"{_named(item)} is mostly taken for another change: in {wrong} of "
                f"{words.counted(item.found, 'alarm')}, most often for {name} ({count}). Of these, {told or 'none'} "
                "say that the right one explains the data as well."
            )
    if found.not_watched:
        yield f"These sensors and voyages give no information about {', '.join(found.not_watched)}."


def _named(item: Detectability) -> str:
    return f"{item.change.capitalize()} by {100.0 * item.size:g} %"


def operation_json(content: OperationContent) -> str:
    """The content as JSON; a delay of null is longer than a voyage."""
    found = content.found
    rows = []
    for item in found.rows:
        table = {**asdict(item), "delay_s": item.delay_s if math.isfinite(item.delay_s) else None}
        table["found_interval"] = interval(item.found, item.voyages)
        rows.append(table)
    return strict_json(
        {
            "vessel": content.vessel,
            "sentences": operation_sentences(found),
            "voyage_s": found.voyage_s,
            "reference_s": found.reference_s,
            "voyages_without_change": found.nominal,
            "false_alarms": found.false_alarms,
            "false_alarm_days": found.false_alarm_days,
            "changes": rows,
            "watched": found.watched,
            "not_watched": found.not_watched,
        }
    )


def operation_document(content: OperationContent) -> Document:
    """What a watch would find, for people."""
    found = content.found
    return Document(
        kind="A watch before it begins",
        title=content.vessel,
        name=f"What a watch over {content.vessel} would find",
        about=f"Simulated voyages of {words.duration(found.voyage_s)}, in the weather of {content.scenario}.",
        findings=operation_sentences(found),
        facts={"voyages_without_change": found.nominal, "false_alarms": found.false_alarms},
        sections=(
            section(
                "Changes",
                Table(header=OPERATION_HEADER, rows=operation_rows(found), texts=2),
                "Found: voyages that raise an alarm, with the exact 95 % interval of their share. Median delay: from "
                "the beginning of the voyage, when the change is there already. Named rightly: the alarm names the "
                "change, or one of its parts, at the end of the voyage. As likely: the right one is among the changes "
                "that the alarm says explain the data as well.",
            ),
            section(
                "Method",
                "Voyages of the vessel file are simulated with its sensors: speeds held for minutes, turns now and "
                "then, in weather drawn from the forecast for each. The watch of expdesign monitor learns noise and "
                f"unmeasured forces from {words.duration(found.reference_s)} of them. More mass is more inertia in "
                "surge and sway; more resistance or damping is more of every such term of an equation; thrust is the "
                "force of all actuators. Traffic, loading, fouling over time and shallow water are not simulated.",
            ),
        ),
    )
