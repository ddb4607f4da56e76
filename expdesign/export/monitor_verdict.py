"""The verdict of a watch over a ship in operation, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from expdesign.export.monitor_content import (
    MonitorContent,
    carries_another,
    delay_s,
    pushed,
    said_of_reference,
    size_in_words,
)
from expdesign.export.roll_changes import watch_sentences
from expdesign.export.words import counted, hours, percent, times, told_apart, when
from expdesign.monitoring import AS_LIKELY, Alarm, Call
from expdesign.vessel.quantities import GYRO

SHOWN_CALLS = 5  # largest number of port calls that are listed, the latest
MUCH_LEFT_OUT, HALF = 0.05, 0.5
MOST_NAMES = 3  # largest number of changes that a sentence names


def sentences(content: MonitorContent) -> tuple[str, ...]:
    """The verdict."""
    return (*_sentences(content), *watch_sentences(content.roll, false_alarm_days=content.false_alarm_days))


def _sentences(content: MonitorContent) -> Iterator[str]:
    state, found = content.state, content.found
    rate = f"with at most one false alarm in {counted(content.false_alarm_days, 'day')} on average"
    whole_s = max(state.judged_s + state.left_out_s, 1e-300)
    reasons = {_shoal(content): state.shoal_s, _windy(content): state.wind_s}
    told = [text for text, left_out_s in reasons.items() if left_out_s]
    rest_s = state.left_out_s - sum(reasons.values())
    first = state.left_out_s > HALF * whole_s and rest_s < HALF * state.left_out_s
    if first:
        yield from told
    elif state.left_out_s > HALF * whole_s:
        unknown = "" if found else " Whether it is the same ship is not known: try expdesign diagnose."
        yield (
            f"Most of the data, {percent(state.left_out_s / whole_s)}, differ from the reference in a way that no "
            f"change explains that is watched for.{unknown}"
        )
    elif not found:
        yield _no_alarm(content, rate)
    for alarm in found:
        yield _alarm(content, alarm)
    for raised, last in content.withdrawn:
        yield _withdrawn(content, raised, last)
    if found:
        yield f"Alarms are raised {rate}. For the cause, give the rows since then to expdesign diagnose."
    if any(_may_be_wind(content, alarm) for alarm in found):
        yield (
            "That rate is for weather as in the reference: a wind that rises far beyond it may look the same, as the "
            "rudder answers its push. Compare with the log, or record wind_speed_mps and wind_angle_rad in reference "
            "and data."
        )
    yield from _passed(content)
    yield from _beyond(content)
    if not first:
        yield from told
    if MUCH_LEFT_OUT < rest_s / whole_s <= HALF:
        yield (
            f"{percent(rest_s / whole_s)} of the data were not judged: their error is beyond what the reference "
            "shows and looks like no change that is watched for. Weather, waves or a sensor may be others."
        )
    for call in content.calls[-SHOWN_CALLS:]:
        yield _call(content, call)
    if content.unread_rows:
        yield f"{counted(content.unread_rows, 'row')} could not be read and so not be judged: see the notes."
    yield from _baseline(content)


def _no_alarm(content: MonitorContent, rate: str) -> str:
    """What no alarm means: nothing yet where a sum is undecided, or where the data are too short for any change."""
    state, watched = content.state, np.flatnonzero(content.calibration.watched).tolist()
    largest = max((moment.statistic for moment in content.moments), default=0.0)
    statistic, limit = told_apart(largest, content.limit)
    stands = " that stands" * bool(content.withdrawn)
    no_alarm = f"No alarm{stands} in {hours(state.judged_s)}{' in surge, sway and yaw' * (content.roll is not None)}"
    # with an alarm that was withdrawn, the statistic of which is told there
    numbers = f"The largest statistic is {statistic}, the threshold {limit}." if not stands else ""
    if state.undecided_s:
        return (
            f"{no_alarm}, but the data end before it is known: a sum has been above the threshold of {limit} for "
            f"{hours(state.undecided_s)}, too short to tell a change of the ship from weather beyond the reference."
        )
    soonest_s = min(delay_s(content, number) for number in watched)
    if state.judged_s < soonest_s:
        return (
            f"{no_alarm}, which is too short to notice a change of a size that is watched for: the first would take "
            f"{hours(soonest_s)}. {numbers}".rstrip()
        )
    otherwise = any(carries_another(call).any() for call in content.calls) or (content.roll and content.roll.events)
    same = "" if otherwise else ": the ship is the one of the reference"
    return f"{no_alarm}{same}, {rate}. {numbers}".rstrip()


def _withdrawn(content: MonitorContent, raised: Alarm, last: Alarm) -> str:
    """An alarm of something that passed."""
    statistic, limit = told_apart(raised.statistic, content.limit)
    return (
        f"An alarm at {when(raised.time_s)}, of {content.changes[raised.change].words} by "
        f"{size_in_words(content, raised)} since {when(raised.since_s)}, with the statistic {statistic} above the "
        f"threshold {limit}, was withdrawn at {when(last.judged_s)}: the data since then do not "
        "bear it out. What was seen has passed, as weather does."
    )


def _passed(content: MonitorContent) -> Iterator[str]:
    """How often a sum was above the threshold without an alarm."""
    state = content.state
    reasons = [
        f"{times(state.brief)} by a sum that fell again before a change of the ship could be told from weather",
        f"{times(state.by_weather)} by one that weather unlike the reference explains",
    ]
    told = [text for text, count in zip(reasons, (state.brief, state.by_weather), strict=True) if count]
    if told:
        yield f"The threshold was passed without an alarm: {', '.join(told)}."


def _shoal(content: MonitorContent) -> str:
    """Water shallower than in the reference, where another drag and inertia are no change of the ship."""
    state, limit = content.state, content.calibration.shoal_limit
    return (
        f"{hours(state.shoal_s)} were not judged: the measured depth_m is less than in the reference, draught over "
        f"depth up to {state.shoalest:.2f} beyond {limit:.2f}. Drag and inertia grow in shallow water, which the model "
        "does not know: give it terms that read the depth, or a reference in such water."
    )


def _windy(content: MonitorContent) -> str:
    """A measured wind of which the reference does not tell what it does."""
    state, known = content.state, content.calibration
    return (
        f"{hours(state.wind_s)} were not judged: there the measured wind was stronger than in the reference, or came "
        "from where none came in it, so that what it does to the ship was known less than half as well as anywhere in "
        f"the reference. The air passed the ship at up to {state.windiest_mps:.3g} m/s, in the reference at up "
        f"to {known.wind_mps:.3g} (means of stretches)."
    )


def _beyond(content: MonitorContent) -> Iterator[str]:
    """Changes that were not judged for a while, as the weather that looks like them was beyond the reference."""
    state, watched = content.state, content.calibration.watched
    share = state.beyond_of_s / max(state.judged_s, 1e-300)
    out = np.flatnonzero(watched & (share > MUCH_LEFT_OUT)).tolist()
    if out and not content.found:
        names = few([content.changes[number].words for number in out])
        yield (
            f"In up to {percent(float(share[out].max()))} of the judged time the weather was beyond the reference for "
            f"{names}: there only the others were judged fully."
        )


def _call(content: MonitorContent, call: Call) -> str:
    clear = carries_another(call)
    text = f"A port call until {when(call.time_s)} took {hours(call.stay_s)}. "
    if not clear.any():
        return text + "The ship carries the same load afterwards, as far as the data show."
    clearest = np.argsort(-np.abs(call.value) / np.maximum(call.std, 1e-300))
    parts = [
        f"{change.words} {change.in_words(call.value[i] * change.size, call.std[i] * change.size)}"
        for i, change in ((i, content.changes[i]) for i in clearest.tolist())
        if clear[i]
    ]
    return f"{text}She carries another load afterwards, as far as the data show, which raises no alarm: {few(parts)}."


def few(names: Sequence[str]) -> str:
    """Names in words, of many the first and how many more there are."""
    if len(names) <= MOST_NAMES:
        return ", ".join(names)
    return f"{', '.join(names[:MOST_NAMES])} and {len(names) - MOST_NAMES} more"


def _load_in_words(content: MonitorContent, value: float, std: float) -> str:
    """Another load, of a size with its standard error."""
    change = content.changes[int(np.argmax(content.calibration.heavier))]
    return f"another load, mass and inertia by {change.in_words(value * change.size, std * change.size)}"


def _alarm(content: MonitorContent, alarm: Alarm) -> str:
    change = content.changes[alarm.change]
    statistic, limit = told_apart(alarm.statistic, content.limit)
    whose = "a sensor" if change.effect == GYRO else "the ship"
    own, who = f"{change.words} by {size_in_words(content, alarm)}", f"{whose} has changed"
    push = f"a steady push in {' or '.join(pushed(content, alarm))} by wind or current"
    gains = {own: 0.0}  # possible cause -> its log-likelihood over that of the change
    if alarm.loaded:
        gain, value, std = alarm.loaded
        gains[_load_in_words(content, value, std)] = gain
    if alarm.pushes:
        gains[push] = max(gain for _, gain in alarm.pushes)
    if max(gains.values()) > AS_LIKELY:
        gains = dict(sorted(gains.items(), key=lambda one: -one[1]))
    first, *others = gains
    if _may_be_wind(content, alarm):
        who += ", or the wind, which is not measured"
    if alarm.pushes:
        who = f"the weather or {whose} has changed" if first == push else f"{whose} or the weather has changed"
    causes = first
    for other in others:
        alike = gains[other] > gains[first] - AS_LIKELY
        causes += f", or {other}, which explains the data as well" * alike
        causes += f", or, explaining the data less well, {other}" * (not alike)
    text = (
        f"Since {when(alarm.since_s)} {who}: {causes}. The alarm came at {when(alarm.time_s)}, with the statistic "
        f"{statistic} above the threshold {limit}."
    )
    if alarm.as_likely and first == own:
        names = few([content.changes[number].words for number in alarm.as_likely])
        text += f" The data are explained as well by: {names}."
    by_load = max(alarm.loaded[0], 0.0) if alarm.loaded else 0.0
    if alarm.unexplained - by_load > content.limit:
        more, load = ("another load", "") if by_load > AS_LIKELY else ("this one change", "another load, ")
        text += (
            f" More than {more} is needed to explain them: one cause may change several parameters at once, as "
            f"{load}shallow water and weather beyond the reference do."
        )
    if not alarm.settled:
        text += " The size is not yet settled."
    return text


def _may_be_wind(content: MonitorContent, alarm: Alarm) -> bool:
    """Whether a wind that nobody measures could do what the change of the ship does; a gyro's errors it cannot do."""
    return not content.wind and content.changes[alarm.change].effect != GYRO


def _baseline(content: MonitorContent) -> Iterator[str]:
    c = content.calibration
    off = [(i, content.changes[i]) for i in np.flatnonzero(said_of_reference(c)).tolist()]
    if off:
        std = c.baseline_std
        off.sort(key=lambda one: -abs(c.baseline[one[0]]) / std[one[0]])
        parts = [
            f"{change.words} {change.in_words(c.baseline[i] * change.size, std[i] * change.size)}" for i, change in off
        ]
        at_once = (
            ""
            if len(off) <= MOST_NAMES
            else (
                " So many at once have one cause rather than many: another load than the file's, shallow water, or an "
                "input that is measured wrongly; expdesign diagnose tells them apart."
            )
        )
        yield (
            f"Already in the reference the ship differs from its file: {few(parts)}. Changes are counted from "
            f"there.{at_once}"
        )
