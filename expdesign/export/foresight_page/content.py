"""Power, confusions and added runs as JSON and as rows for people."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from expdesign.export import words
from expdesign.export.files import finite, strict_json
from expdesign.foresight import TOLD_APART, AddedRuns, Foreseen, Foresight

NONE = "\N{EN DASH}"
HALF = 0.5
MOST_LISTED = 5
"""Largest number of causes in a sentence."""
HEADER = (
    "cause",
    "least visible as",
    "a size that matters",
    "power",
    "found",
    "named",
    "90 % from",
    "90 % with",
    "not told from",
)
"""Columns of the table for people."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ForesightContent:
    """The values that page and file show.

    Attributes:
        scenario: its name.
        vessel: its name.
        source: the trial, in words.
        found: what is foreseen.
        command, version: to reproduce it.
    """

    scenario: str
    vessel: str
    source: str
    found: Foresight
    command: str
    version: str


def foresight_rows(found: Foresight) -> tuple[tuple[str, ...], ...]:
    """One row for the least visible effect of every cause, in the order of `HEADER`."""
    return tuple(effect_row(item) for item in found.weakest)


def effect_row(item: Foreseen) -> tuple[str, ...]:
    """One effect, in the order of `HEADER`."""
    others = ", ".join(other.cause for other in item.mistaken_for[:2])
    more = len(item.mistaken_for) - 2
    return (
        item.cause,
        item.name,
        size_text(item.name, item.change, item.unit),
        words.percent(item.power) if item.sized else NONE,
        words.percent(item.found) if item.sized else NONE,
        words.percent(item.named) if item.sized else NONE,
        size_text(item.name, item.least_change, item.unit),
        remedy(item),
        (others + (f" and {more} more" if more > 0 else "")) if item.power >= TOLD_APART and others else NONE,
    )


def remedy(item: Foreseen) -> str:
    """What brings an effect to the wanted power, in words."""
    if not item.needs_runs:
        return NONE
    if item.added is not None:
        return runs_text(item.added)
    return "no data: within stated std" if item.within_std else "none of this dictionary"


def runs_text(added: AddedRuns) -> str:
    """Runs and their time."""
    runs = ", ".join(f"{count} \N{MULTIPLICATION SIGN} {name}" for name, count in added.runs)
    return f"{runs} ({words.duration(added.time_s)})"


def conclusions(found: Foresight) -> tuple[str, ...]:
    """What follows for the trial, in sentences."""
    return tuple(_sentences(found))


def _sentences(found: Foresight) -> Iterator[str]:
    least = [item for item in found.weakest if item.sized]
    seen = [item for item in least if item.found >= found.wanted_power]
    yield (
        f"A diagnosis of this trial would find {len(seen)} of {len(least)} causes with a probability of at least "
        f"{100 * found.wanted_power:g} %, wherever they act and at the smallest size that matters."
    )
    missed = sorted((item for item in least if item.found < found.wanted_power), key=lambda item: item.found)
    likely = [item for item in missed if item.found >= HALF]
    for text, items in (("It would probably miss", missed[: len(missed) - len(likely)]), ("It may miss", likely)):
        if items:
            listed = ", ".join(
                f"{item.cause} as {item.name} ({words.percent(item.found)})" for item in items[:MOST_LISTED]
            )
            rest = f" and {len(items) - MOST_LISTED} more" if len(items) > MOST_LISTED else ""
            yield f"{text} {listed}{rest}."
    within = list(dict.fromkeys(item.cause for item in found.effects if item.needs_runs and item.within_std))
    if within:
        yield (
            f"No data would show {', '.join(within)} at that size in every case: that is within the standard "
            "deviations in the vessel file."
        )
    pairs = dict.fromkeys((f"{item.cause} as {item.name}", other.cause) for item, other in found.not_told_apart)
    if pairs:
        listed = ", ".join(f"{one} from {other}" for one, other in pairs)
        yield f"Their tests would notice, but not distinguish: {listed}."
    if found.together is not None:
        more = runs_text(found.together)
        yield f"With {more} more, its tests would also accept what runs of this dictionary can show."
    if found.unseen:
        yield "Not seen at all: " + ", ".join(f"{cause} ({why})" for cause, why in found.unseen) + "."


def size_text(name: str, change: float, unit: str) -> str:
    """A size with its unit; factors as per cent, angles in degrees."""
    if not math.isfinite(change):
        return NONE
    if unit == "" and ("factor" in name or "growth" in name):
        return f"{words.significant(100 * abs(change), 2)} %"
    if unit == "rad":
        return f"{words.significant(math.degrees(abs(change)), 2)} deg"
    return f"{words.significant(abs(change), 2)} {unit}".rstrip()


def foresight_json(content: ForesightContent) -> str:
    """`foresee.json`."""
    found = content.found
    return strict_json(
        {
            "scenario": content.scenario,
            "vessel": content.vessel,
            "trial": content.source,
            "duration_s": found.duration_s,
            "wanted_power": found.wanted_power,
            "random_current_mps": found.random_current_mps,
            "effects": [effect_entry(item) for item in found.effects],
            "missed": list(found.missed),
            "conclusions": list(conclusions(found)),
            "not_told_apart": [
                {"cause": item.cause, "effect": item.name, "from": other.cause, "cosine": other.cosine,
                 "noncentrality_left": other.noncentrality, "told_apart": other.told_apart}
                for item, other in found.not_told_apart
            ],
            "together": _added(found.together),
            "beyond_the_dictionary": [
                {"cause": item.cause, "effect": item.name, "best_power": item.best_power, "within_std": item.within_std}
                for item in found.beyond
            ],
            "not_seen": [{"cause": cause, "why": why} for cause, why in found.unseen],
        }
    )  # fmt: skip


def effect_entry(item: Foreseen) -> dict[str, object]:
    """One effect."""
    return {
        "cause": item.cause,
        "effect": item.name,
        "size": finite(item.change),
        "unit": item.unit,
        "rule": item.rule,
        "noncentrality": finite(item.noncentrality),
        "freedom": item.freedom,
        "level": item.level,
        "power": finite(item.power),
        "found": finite(item.found),
        "named": finite(item.named),
        "size_for_wanted_power": finite(item.least_change),
        "mistaken_for": [
            {"cause": other.cause, "cosine": other.cosine, "told_apart": other.told_apart}
            for other in item.mistaken_for
        ],
        "added_runs": _added(item.added),
        "best_power": finite(item.best_power),
    }


def _added(runs: AddedRuns | None) -> dict[str, object] | None:
    return None if runs is None else {"runs": dict(runs.runs), "time_s": runs.time_s}
