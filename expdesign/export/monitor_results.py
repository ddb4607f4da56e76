"""What a watch over a ship in operation found, as a table and as JSON."""

from __future__ import annotations

import numpy as np

from expdesign.export.files import entry, finite, strict_json
from expdesign.export.monitor_content import MonitorContent, alike, delay_s, pushed, size_in_words
from expdesign.export.monitor_verdict import sentences
from expdesign.export.roll_changes import watch_entry
from expdesign.export.words import HOUR, hours, when
from expdesign.monitoring import AS_LIKELY, Alarm, Call


def monitor_header(content: MonitorContent) -> tuple[str, ...]:
    """Header of `monitor_rows`."""
    since_s = float(content.state.whole.since_s[0])
    anew = any(alarm.since_s < since_s for alarm in content.alarms)
    beside = ", beside what was found" * bool(content.found)
    since = f"since {when(since_s)}{beside}" if anew else "since the watch began"
    return ("Change", "Size watched for", "Alarm after", since[:1].upper() + since[1:], "Not distinguishable from")


def monitor_rows(content: MonitorContent) -> list[tuple[str, ...]]:
    """A row for each change, under `monitor_header`."""
    last = content.moments[-1] if content.moments else None
    rows: list[tuple[str, ...]] = []
    for number, change in enumerate(content.changes):
        if not change.watched:
            continue
        watched = bool(content.calibration.watched[number])
        since = "\N{EN DASH}"
        if last is not None and np.isfinite(last.std[number]) and last.std[number] < 1e3:
            since = change.in_words(last.value[number] * change.size, last.std[number] * change.size)
        rows.append(
            (
                change.words,
                change.in_words(change.size).lstrip("+-"),
                hours(60.0 * np.ceil(delay_s(content, number) / 60.0))
                if watched
                else "not watched: the reference has too little information",
                since,
                ", ".join(alike(content, number)) if watched else "",
            )
        )
    return rows


def monitor_json(content: MonitorContent, budget: list[dict[str, object]]) -> str:
    """Everything, with units in the names; `budget` has the entries of `budget_entries`."""
    c, state = content.calibration, content.state
    return strict_json(
        {
            "verdict": sentences(content),
            "vessel": content.vessel,
            "judged_h": state.judged_s / HOUR,
            "not_judged_h": state.left_out_s / HOUR,
            "not_judged_for": {"depth_h": state.shoal_s / HOUR, "wind_h": state.wind_s / HOUR},
            "rows_without_numbers": content.left_out_rows,
            "rows_not_read": content.unread_rows,
            "threshold": content.limit,
            "false_alarm_days": content.false_alarm_days,
            "reference": {
                "until_s": content.reference_s,
                "stretches": c.stretches,
                "noise_std": [finite(value) for value in c.std.tolist()],
            },
            "alarms": [_alarm_entry(content, alarm) for alarm in content.found],
            "withdrawn": [
                {**_alarm_entry(content, raised), "withdrawn_s": last.judged_s} for raised, last in content.withdrawn
            ],
            "port_calls": [_call_entry(content, call) for call in content.calls],
            "changes": [
                {
                    "effect": change.effect,
                    "watched": bool(c.watched[number]),
                    "size": change.size,
                    "expected_delay_s": finite(delay_s(content, number)),
                    "in_reference": float(c.baseline[number] * change.size),
                    "not_distinguishable_from": alike(content, number),
                }
                for number, change in enumerate(content.changes)
            ],
            "budget": budget,
            "threshold_passed_without_alarm": {
                "brief": state.brief,
                "weather": state.by_weather,
                "undecided_s": state.undecided_s,
            },
            "history": [{"time_s": m.time_s, "statistic": m.statistic} for m in content.moments],
            "notes": content.notes,
            **watch_entry(content.roll, false_alarm_days=content.false_alarm_days),
        }
    )


def _call_entry(content: MonitorContent, call: Call) -> dict[str, object]:
    return {
        "from_s": call.time_s - call.stay_s,
        "until_s": call.time_s,
        "load": {
            change.effect: {"value": float(value * change.size), "std": float(std * change.size)}
            for change, value, std in zip(content.changes, call.value, call.std, strict=True)
            if change.load
        },
    }


def _load_entry(content: MonitorContent, alarm: Alarm) -> dict[str, object] | None:
    if alarm.loaded is None:
        return None
    gain, value, std = alarm.loaded
    size = content.changes[int(np.argmax(content.calibration.heavier))].size
    return {"value": value * size, "std": std * size, "likelier": gain > AS_LIKELY}


def _alarm_entry(content: MonitorContent, alarm: Alarm) -> dict[str, object]:
    change = content.changes[alarm.change]
    return {
        **entry(alarm, "time_s", "since_s", "statistic", "settled"),
        "effect": change.effect,
        "value": alarm.value * change.size,
        "std": alarm.std * change.size,
        "in_words": f"{change.words} by {size_in_words(content, alarm)}",
        "as_likely": [content.changes[number].effect for number in alarm.as_likely],
        "as_likely_load": _load_entry(content, alarm),
        "as_likely_pushes": pushed(content, alarm),
        "likelier_pushes": pushed(content, alarm, beyond=AS_LIKELY),
    }
