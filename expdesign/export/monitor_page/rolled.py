"""A watch over roll as sentences and JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from expdesign.export.files import finite
from expdesign.export.roll_words import change_words, stability_words
from expdesign.export.words import HOUR, counted, hours, when
from expdesign.monitoring import RollEvent, RollWatch

SHOWN = 5


def roll_sentences(watch: RollWatch | None, *, false_alarm_days: float) -> tuple[str, ...]:
    """The verdict on roll; nothing for a vessel file without [roll]."""
    return () if watch is None else tuple(_sentences_roll(watch, false_alarm_days))


def _sentences_roll(watch: RollWatch, days: float) -> Iterator[str]:
    if not watch.judged_s:
        why = f": {watch.reason}" if watch.reason else ""
        yield f"Roll, [roll] of the vessel file, was not judged{why}."
        return
    if not watch.alarms:
        same = "No alarm of roll" if watch.events else "She rolls as in the reference,"
        yield (
            f"{same} in {hours(watch.judged_s)} that were judged, with at most one false alarm of any kind in "
            f"{counted(days, 'day')} on average."
        )
    yield from (_event(event) for event in watch.events[-SHOWN:])
    if watch.left_out_s > watch.judged_s:
        yield f"{hours(watch.left_out_s)} give no information about roll; the last reason: {watch.reason}."


def _event(event: RollEvent) -> str:
    call = ", after a port call, which raises no alarm" if event.after_call else ""
    text = f"She rolls otherwise since a time between {when(event.since_s)} and {when(event.time_s)}{call}: "
    if not event.causes:
        return text + "no cause that is watched for explains it; expdesign roll estimates all."
    text += change_words(event.causes, event.sizes, event.stds, load=event.load, values=event.values) + ". "
    text += stability_words(*event.righting_nm, mass_kg=event.mass_kg, load=event.load)
    if event.others:
        text += f" Explained about as well by: {'; '.join(' and '.join(one) for one in event.others)}."
    return text if event.settled else text + " The size is not yet settled."


def roll_entry(watch: RollWatch | None, *, false_alarm_days: float) -> dict[str, Any]:
    """The entry of roll in monitor.json; nothing for a vessel file without [roll]."""
    if watch is None:
        return {}
    entry = {
        "verdict": list(roll_sentences(watch, false_alarm_days=false_alarm_days)),
        "judged_h": watch.judged_s / HOUR,
        "not_judged_h": watch.left_out_s / HOUR,
        "changes": [_entry(event) for event in watch.events],
    }
    return {"roll": entry}


def _entry(event: RollEvent) -> dict[str, Any]:
    sizes = zip(event.causes, event.sizes, event.stds, strict=True)
    return {
        "since_s": event.since_s,
        "time_s": event.time_s,
        "alarm": not event.after_call,
        "settled": event.settled,
        "p_value": event.p_value,
        "causes": {cause: {"size": size, "std": std} for cause, size, std in sizes},
        "load": None if event.load is None else {"mass_kg": event.load[0], "height_m": event.load[1]},
        "righting_nm": [finite(value) for value in event.righting_nm],
        "as_likely": [list(causes) for causes in event.others],
    }
