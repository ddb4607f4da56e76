"""What a diagnosis, or a watch in operation, would find, before it begins: JSON and documents."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial

import numpy as np

from expdesign.export import words
from expdesign.export.document import Document, Figure, Table, filled, section
from expdesign.export.files import entry, finite, strict_json
from expdesign.export.pages.figures import BLUE, GREY, VERMILION, light_grid, new_figure, page_figure, plain, svg
from expdesign.foresight import TOLD_APART, AddedRuns, Detectability, Foreseen, Foresight, OperationForesight, interval

NONE = "\N{EN DASH}"
HALF = 0.5
MOST_LISTED = 5  # largest number of causes in a sentence
HEADER = (
    "Cause",
    "Least visible as",
    "A size that matters",
    "Power",
    "Found",
    "Named",
    "90 % from",
    "90 % with",
    "Not told from",
)
"""Columns of the table for people."""


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


def conclusions(found: Foresight) -> Iterator[str]:
    """What follows for the trial, in sentences."""
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


def foresight_json(found: Foresight, *, scenario: str, vessel: str, source: str) -> str:
    """`foresee.json`, with the names of scenario and vessel, and what is diagnosed in words."""
    return strict_json(
        {
            "scenario": scenario,
            "vessel": vessel,
            "trial": source,
            **entry(found, "duration_s", "wanted_power", "random_current_mps"),
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
        **entry(item, "cause", "unit", "rule", "noncentrality", "freedom", "level", "power", "found", "named"),
        "effect": item.name,
        "size": finite(item.change),
        "size_for_wanted_power": finite(item.least_change),
        "mistaken_for": [entry(other, "cause", "cosine", "told_apart") for other in item.mistaken_for],
        "added_runs": _added(item.added),
        "best_power": finite(item.best_power),
    }


def _added(runs: AddedRuns | None) -> dict[str, object] | None:
    return None if runs is None else {"runs": dict(runs.runs), "time_s": runs.time_s}


@page_figure
def power_figure(found: Foresight) -> str:
    """Probability that the test accepts each cause, that held-out runs show it too, and that it is named first."""
    items = [item for item in found.weakest if item.sized]
    figure = new_figure(6.8, 1.1 + 0.26 * len(items))
    axes = figure.subplots()
    rows = np.arange(len(items))
    axes.barh(
        rows, [100 * item.power for item in items], height=0.6, color=BLUE, alpha=0.35, label="accepted by its test"
    )
    axes.barh(rows, [100 * item.found for item in items], height=0.3, color=BLUE, label="found")
    axes.plot([100 * item.named for item in items], rows, "D", color=VERMILION, markersize=5, label="found and first")
    axes.axvline(100 * found.wanted_power, color=GREY, linewidth=0.9, linestyle="--")
    axes.set_yticks(rows, [plain(_name(item)) for item in items])
    axes.invert_yaxis()
    axes.set_xlim(0, 101)
    axes.set_xlabel("probability [%]")
    axes.legend(loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=3, fontsize=9)
    light_grid(axes, "x")
    return svg(figure, key="power", label="Probability that a diagnosis finds each cause, and that it names it first")


def _name(item: Foreseen) -> str:
    return item.cause if item.cause.endswith(f":{item.name}") else f"{item.cause}: {item.name}"


PAIR_HEADER = ("Hidden", "also explained by", "cosine", "noncentrality left", "told apart")
EVERY_HEADER = (
    "Cause", "acts as", "size that matters", "power", "found", "because of", "noncentrality", "90 % from",
)  # fmt: skip


def foresight_document(found: Foresight, *, scenario: str, vessel: str, source: str) -> Document:
    """What a diagnosis would find, for people; the names are those of `foresight_json`."""
    more = f". All effects that can reach it need {runs_text(found.together)}" if found.together else ""
    return Document(
        kind="A diagnosis before sailing",
        title=scenario,
        name=f"What a diagnosis of {scenario} would find",
        about=f"{vessel}: {source}, {words.duration(found.duration_s)}.",
        findings=tuple(conclusions(found)),
        facts={"diagnosed_s": found.duration_s, "causes_tested": len(found.weakest)},
        values={
            "trial": source,
            "causes_missed": list(found.missed),
            "causes_not_seen": [cause for cause, _ in found.unseen],
            "not_told_apart": [
                f"{item.cause} ({item.name}) from {other.cause}" for item, other in found.not_told_apart
            ],
        },
        sections=filled(
            section(
                "Power",
                Figure(draw=partial(power_figure, found), caption=POWER),
                Table(header=HEADER, rows=[effect_row(item) for item in found.weakest], texts=2),
                "\u201c90 % from\u201d is the size that the test accepts with that probability; \u201c90 % with\u201d "
                f"are the runs of one manoeuvre that reach 90 % at the size that matters in the least time{more}.",
            ),
            section("Not told apart", Table(header=PAIR_HEADER, rows=_pairs(found), texts=2), APART),
            section(
                "Every effect",
                Table(header=EVERY_HEADER, rows=[_every(item) for item in found.effects], texts=2, on="page"),
            ),
            section("Method", METHOD),
        ),
    )


POWER = (
    "Probabilities for the effect of each cause with the least power, at the smallest size that matters. Pale bars: "
    "the test accepts it. Dark bars: a diagnosis finds it, which also asks for a better simulation or prediction of "
    "held-out runs. Diamonds: a diagnosis finds it, and it explains the data better than every other cause. The broken "
    "line is the wanted power."
)
APART = (
    "The cosine compares the effects of both causes on the measured signals, after those of all nuisance parameters "
    "are removed. The noncentrality left is that of the hidden cause where the other one is estimated too. Told apart: "
    "the share of trials in which the likelihood prefers the right cause by the margin that a diagnosis asks for, "
    "among those in which its test finds it."
)
METHOD = (
    "The trial is simulated with nothing hidden, with the sensors of the vessel file and the weather of the forecast, "
    "and its diagnosis is begun. The sensitivity of the simulated signals to each cause, beside uncertain parameters, "
    "initial states and a wandering current, gives the noncentrality of the cause's test; the level is that at which a "
    "diagnosis accepts a cause, its many tests counted. A size matters if it changes the advance, the tactical "
    "diameter or a first overshoot of the ship's own standard trials by 5 % (an overshoot by at least half a degree) "
    "or costs 5 points of fit in simulating them and a stop, whichever is less; a parameter, from three of its stated "
    "standard deviations on. Where standard trials show nothing of an effect, a default counts. The motion answers "
    "each effect linearly; sizes other than those that matter are in proportion. The true ship is taken to be the "
    "model in use, with parameters as wrong as the vessel file says. A diagnosis also asks that a cause improves the "
    "simulation of runs that it was not fitted to: with few runs it finds weak causes less often than "
    "its test accepts them."
)


def _every(item: Foreseen) -> tuple[str, ...]:
    cause, name, size, power, found, _, least, *_ = effect_row(item)
    return (
        cause,
        name,
        size,
        power,
        found,
        item.rule,
        words.significant(item.noncentrality) if item.sized else NONE,
        least,
    )


def _pairs(found: Foresight) -> list[tuple[str, ...]]:
    return [
        (
            f"{item.cause}: {item.name}",
            other.cause,
            words.number(other.cosine, 3),
            words.significant(other.noncentrality),
            words.percent(other.told_apart),
        )
        for item, other in found.not_told_apart
    ]


OPERATION_HEADER = ("Change", "By", "Found", "95 %", "Median delay", "Named rightly", "Or as likely", "Else taken for")
"""Columns of the table for people."""
FINDS = 0.5  # share of voyages from which a change counts as found


def operation_row(item: Detectability) -> tuple[str, ...]:
    """One change of one size, in the order of `OPERATION_HEADER`."""
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


def operation_sentences(found: OperationForesight) -> Iterator[str]:
    """What follows, in sentences."""
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


def operation_json(found: OperationForesight, *, vessel: str) -> str:
    """`operation.json`; a delay of null is longer than a voyage."""
    rows = []
    for item in found.rows:
        table = {**asdict(item), "delay_s": item.delay_s if math.isfinite(item.delay_s) else None}
        table["found_interval"] = interval(item.found, item.voyages)
        rows.append(table)
    return strict_json(
        {
            "vessel": vessel,
            "sentences": list(operation_sentences(found)),
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


def operation_document(found: OperationForesight, *, scenario: str, vessel: str) -> Document:
    """What a watch would find, for people."""
    return Document(
        kind="A watch before it begins",
        title=vessel,
        name=f"What a watch over {vessel} would find",
        about=f"Simulated voyages of {words.duration(found.voyage_s)}, in the weather of {scenario}.",
        findings=tuple(operation_sentences(found)),
        facts={"voyages_without_change": found.nominal, "false_alarms": found.false_alarms},
        sections=(
            section(
                "Changes",
                Table(header=OPERATION_HEADER, rows=[operation_row(item) for item in found.rows], texts=2),
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
