"""The page of a watch over a ship in operation."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from expdesign.export.document import Document, Figure, Table, section
from expdesign.export.files import finite
from expdesign.export.monitor_content import MonitorContent
from expdesign.export.monitor_results import monitor_header, monitor_rows
from expdesign.export.monitor_verdict import sentences
from expdesign.export.pages.figures import BLUE, GREY, LINES, VERMILION, light_grid, new_figure, page_figure, plain, svg
from expdesign.export.words import HOUR, SINCE_1970_S, hours, when
from expdesign.monitoring import KINDS, TOLD_APART, soonest
from expdesign.values import Array

# What each term of the model contributes in every kind of stretch, and how soon such stretches reveal a change.
#
# Source of the idea: a master's thesis on the estimation of a ship's yaw dynamics in operation, section on the
# influence of terms (absolute contributions beside each other, by manoeuvre).

EQUATIONS = ("surge", "sway", "yaw")
WHOLE = ("inertia:", "yaw:I_r")
"""Effects that stand for all terms of an equation; thrust stands for those of the actuators."""
SHOWN_SHARE = 0.02


def shares(content: MonitorContent) -> Array:
    """(k, m, 3) share of every term in the sum of sizes of all terms of an equation, by kind of stretch."""
    single = [not c.effect.startswith(WHOLE) and c.effect != "gain" for c in content.changes]
    sizes = content.state.budget.terms * np.array(single)[:, None]
    return np.asarray(sizes / np.maximum(sizes.sum(axis=1, keepdims=True), 1e-300))


def delays_s(content: MonitorContent) -> Array:
    """(k, m) time in stretches of one kind until a change of its size is expected to raise an alarm [s]."""
    c, budget = content.calibration, content.state.budget
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = budget.information / np.maximum(budget.stretches, 1.0)[:, None] / c.inflation
        return soonest(rate, content.limit) * c.stretch_s


@page_figure
def budget_figure(content: MonitorContent) -> str:
    """Bars of the shares, an axes for each equation that has terms."""
    share, stretches = shares(content), content.state.budget.stretches
    used = [place for place in range(len(EQUATIONS)) if share[..., place].any()]
    kinds = [kind for kind in range(len(KINDS)) if stretches[kind]]
    figure = new_figure(6.8, 0.9 + (0.45 + 0.28 * len(kinds)) * max(len(used), 1))
    for axes, place in zip(figure.subplots(max(len(used), 1), sharex=True, squeeze=False)[:, 0], used, strict=False):
        left = np.zeros(len(kinds))
        terms = [m for m in range(len(content.changes)) if share[kinds, m, place].max(initial=0.0) > SHOWN_SHARE]
        for number, term in enumerate(terms):
            width = share[kinds, term, place]
            name = plain(content.changes[term].words.removeprefix("parameter "))
            axes.barh(range(len(kinds)), width, left=left, color=LINES[number % len(LINES)], label=name, height=0.7)
            left = left + width
        axes.set_yticks(range(len(kinds)), [KINDS[kind] for kind in kinds], fontsize=8)
        axes.invert_yaxis()
        axes.set_xlim(0.0, 1.0)
        axes.set_title(EQUATIONS[place], fontsize=9, loc="left")
        axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
        light_grid(axes)
    figure.axes[-1].set_xlabel("share of the sizes of all terms")
    return svg(figure, key="budget", label="Share of every term in each equation, by kind of stretch")


def budget_rows(content: MonitorContent) -> list[tuple[str, ...]]:
    """A row for each change that is watched for: time to an alarm in stretches of each kind."""
    delays = delays_s(content)
    rows = [("in the data", *(hours(value) for value in content.state.budget.duration_s.tolist()))]
    for number, change in enumerate(content.changes):
        if content.calibration.watched[number]:
            rows.append((change.words, *(_after(value) for value in delays[:, number].tolist())))
    return rows


def _after(delay_s: float) -> str:
    if not np.isfinite(delay_s):
        return "never"
    return f"{delay_s / 60.0:.0f} min" if delay_s < HOUR else hours(delay_s)


def budget_entries(content: MonitorContent) -> list[dict[str, object]]:
    """The budget for a file, by kind of stretch; accelerations in m/s2 and rad/s2.

    Compared are stretches that are judged and those that are not for their weather.
    """
    budget, delays = content.state.budget, delays_s(content)
    mean = budget.terms / np.maximum(budget.stretches, 1.0)[:, None, None]
    return [
        {
            "kind": name,
            "compared_h": float(budget.duration_s[kind] / HOUR),
            "mean_accelerations": {
                change.effect: dict(zip(EQUATIONS, mean[kind, number].tolist(), strict=True))
                for number, change in enumerate(content.changes)
                if mean[kind, number].any()
            },
            "alarm_after_s": {
                change.effect: finite(float(delays[kind, number]))
                for number, change in enumerate(content.changes)
                if content.calibration.watched[number]
            },
        }
        for kind, name in enumerate(KINDS)
    ]


SHOWN = 5  # largest number of estimates that are drawn
MOST_LINEAR = 8.0  # statistic in thresholds, above which its scale is logarithmic


@page_figure
def statistic_figure(content: MonitorContent) -> str:
    """The largest sum in every piece of the data, the threshold and the alarms."""
    figure = new_figure(6.8, 2.8)
    axes = figure.subplots()
    begin_s, label = _axis(content)
    time = _hours([moment.time_s for moment in content.moments], begin_s)
    statistics = [moment.statistic for moment in content.moments]
    axes.step(time, statistics, ".-", where="pre", color=BLUE, label="statistic")
    axes.axhline(content.limit, color=GREY, linestyle="--", linewidth=0.9, label="threshold")
    for number, alarm in enumerate(content.found):
        axes.axvline((alarm.time_s - begin_s) / HOUR, color=VERMILION, linewidth=1.2, label=None if number else "alarm")
    for number, (alarm, last) in enumerate(content.withdrawn):
        ends, name = _hours([alarm.time_s, last.judged_s], begin_s).tolist(), None if number else "alarm, withdrawn"
        axes.axvspan(*ends, color=GREY, alpha=0.2, linewidth=0.0, label=name)
    if max(statistics, default=0.0) > MOST_LINEAR * content.limit:
        axes.set_yscale("symlog", linthresh=content.limit)  # linear up to the threshold
        axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylim(0, None)
    axes.set_xlabel(label)
    axes.set_ylabel("log-likelihood ratio")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, fontsize=9, frameon=False)  # beside the threshold
    light_grid(axes)
    return svg(figure, key="statistic", label="Statistic of the watch over time, with its threshold")


def _axis(content: MonitorContent) -> tuple[float, str]:
    """The time from which hours are counted [s], and what they are called."""
    first_s = content.moments[0].time_s if content.moments else 0.0
    return (first_s, f"time since {when(first_s)} [h]") if first_s >= SINCE_1970_S else (0.0, "time [h]")


def _hours(times_s: Sequence[float], begin_s: float) -> Array:
    return (np.array(times_s) - begin_s) / HOUR


@page_figure
def estimate_figure(content: MonitorContent) -> str:
    """The changes that are known best at the end, or that alarms name, over time with 95 % intervals."""
    figure = new_figure(6.8, 3.2)
    axes = figure.subplots()
    begin_s, label = _axis(content)
    time = _hours([moment.time_s for moment in content.moments], begin_s)
    reach = 1.0  # of the later half: intervals of the first moments are wide
    for number, colour in zip(_shown(content), LINES, strict=False):
        sign = np.sign(content.changes[number].unit[0])  # of a negative parameter, more is less in its unit
        value = sign * np.array([moment.value[number] for moment in content.moments])
        half = 1.96 * np.array([moment.std[number] for moment in content.moments])
        axes.plot(time, value, color=colour, label=plain(content.changes[number].words))
        axes.fill_between(time, value - half, value + half, color=colour, alpha=0.15, linewidth=0)
        late = (np.abs(value) + half)[len(time) // 2 :]
        reach = max(reach, float(late[np.isfinite(late)].max(initial=0.0)))
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set_ylim(-1.5 * reach, 1.5 * reach)
    axes.set_xlabel(label)
    axes.set_ylabel("change, in sizes watched for")
    axes.legend(loc="upper left", fontsize=8, ncols=2)
    light_grid(axes)
    return svg(figure, key="estimate", label="Estimated changes over time with 95 % intervals")


def _shown(content: MonitorContent) -> Sequence[int]:
    """Those named first, then those that are known best."""
    watched = np.flatnonzero(content.calibration.watched)
    best = watched[np.argsort(-content.calibration.rate[watched])].tolist()
    return list(dict.fromkeys([*(alarm.change for alarm in content.found), *best]))[:SHOWN]


WINDY = (
    "The wind is measured. What it does was learnt from the reference, so that it is no change of the ship. "
    "Stretches in a wind unlike the reference's are learnt from and not judged."
)


def monitor_document(content: MonitorContent) -> Document:
    """The watch for people."""
    state, kinds = content.state, (kind.capitalize() for kind in KINDS)
    alarms = len(content.found) + (0 if content.roll is None else len(content.roll.alarms))
    return Document(
        kind="Ship in operation",
        title=content.vessel,
        name=f"{content.vessel} in operation",
        about=f"Judged in stretches of {content.calibration.stretch_s:g} s: {hours(state.judged_s)} judged, and "
        f"{hours(state.left_out_s) if state.left_out_s else 'none'} left out as unlike the reference. Reference: "
        f"{content.calibration.stretches} stretches.",
        findings=sentences(content),
        facts={"judged_h": state.judged_s / HOUR, "alarms": alarms},
        sections=(
            section(
                "Statistic",
                Figure(
                    draw=partial(statistic_figure, content),
                    caption="Largest log-likelihood ratio of any change that is watched for, against no change. It "
                    "begins anew at zero whenever it falls below.",
                ),
                Figure(
                    draw=partial(estimate_figure, content),
                    caption="Each change, had it alone happened when the watch began, with 95 % intervals. The "
                    "estimates begin anew after a change has settled or an alarm was withdrawn.",
                ),
            ),
            section(
                "What is watched for",
                Table(header=monitor_header(content), rows=monitor_rows(content), texts=5),
                "\u201cAlarm after\u201d is the expected time from a change of this size to its alarm, in operation "
                f"like that of the reference, {hours(TOLD_APART[0] * content.calibration.stretch_s)} at least. The "
                "alarm waits longer while weather beyond the reference may explain the data as well. Changes that are "
                "not distinguishable raise the same alarm; a manoeuvre of another kind would distinguish them.",
                *(WINDY,) * content.wind,
            ),
            section(
                "Which manoeuvres reveal which change",
                Figure(
                    draw=partial(budget_figure, content),
                    caption="Share of each term of the model in its equation, by what the ship does: sizes of the "
                    "accelerations along the data that were compared with the model. A term that contributes little in "
                    "a manoeuvre is not determined by it.",
                ),
                Table(header=("Change", *kinds), rows=budget_rows(content), texts=5, on="page"),
                "Time that such stretches must last in all until a change of the size watched for is expected to raise "
                "its alarm. Where it is short, such manoeuvres are the ones to watch or to sail.",
            ),
        ),
        notes=content.notes,
        command=content.command,
    )
