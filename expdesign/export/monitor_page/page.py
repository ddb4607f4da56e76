"""The page of a watch over a ship in operation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.export.monitor_page.budget import budget_figure, budget_header, budget_tables
from expdesign.export.monitor_page.content import MonitorContent, monitor_header, monitor_tables, sentences
from expdesign.export.pages import page_template
from expdesign.export.pages.figures import (
    BLUE,
    GREY,
    LINES,
    VERMILION,
    light_grid,
    new_figure,
    page_figure,
    plain,
    report_style,
    svg,
)
from expdesign.export.words import HOUR, SINCE_1970_S, hours, when
from expdesign.values import Array

SHOWN = 5
"""Largest number of estimates that are drawn."""


@page_figure
def statistic_figure(content: MonitorContent) -> str:
    """The largest sum in every piece of the data, the threshold and the alarms."""
    figure = new_figure(6.8, 2.8)
    axes = figure.subplots()
    begin_s, label = _axis(content)
    time = _hours([moment.time_s for moment in content.moments], begin_s)
    axes.step(time, [moment.statistic for moment in content.moments], where="pre", color=BLUE, label="statistic")
    axes.axhline(content.limit, color=GREY, linestyle="--", linewidth=0.9, label="threshold")
    for number, alarm in enumerate(content.found):
        axes.axvline((alarm.time_s - begin_s) / HOUR, color=VERMILION, linewidth=1.2, label=None if number else "alarm")
    axes.set_ylim(0, None)
    axes.set_xlabel(label)
    axes.set_ylabel("log-likelihood ratio")
    axes.legend(loc="upper left", fontsize=9)
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
    for number, colour in zip(_shown(content), LINES, strict=False):
        value = np.array([moment.value[number] for moment in content.moments])
        half = 1.96 * np.array([moment.std[number] for moment in content.moments])
        axes.plot(time, value, color=colour, label=plain(content.changes[number].words))
        axes.fill_between(time, value - half, value + half, color=colour, alpha=0.15, linewidth=0)
    axes.axhline(0.0, color="black", linewidth=0.8)
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


def monitor_html(content: MonitorContent) -> str:
    """One HTML page without any outside reference."""
    with report_style():
        figures = {"statistic": statistic_figure(content), "estimate": estimate_figure(content)}
        figures["budget"] = budget_figure(content)
    return page_template("expdesign.export.monitor_page", "monitor.html").render(
        content=content,
        sentences=sentences(content),
        judged=hours(content.state.judged_s),
        left_out=hours(content.state.left_out_s),
        header=tuple(name[0].upper() + name[1:] for name in monitor_header(content)),
        rows=monitor_tables(content),
        budget_header=tuple(name.capitalize() for name in budget_header()),
        budget_rows=budget_tables(content),
        figures=figures,
    )
