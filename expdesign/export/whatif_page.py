"""The page that compares variants."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from expdesign.export.document import Document, Figure, Listing, Section, Table, section
from expdesign.export.pages.figures import (
    LINES,
    REPOSITION,
    VERMILION,
    light_grid,
    new_figure,
    page_figure,
    plain,
    round_ticks,
    svg,
)
from expdesign.export.whatif_content import DAY, Case, WhatIfContent, explanations
from expdesign.export.words import counted


@page_figure
def time_figure(content: WhatIfContent) -> str:
    """Informative time, with the repositioning where planned, and the time for the accuracy of the scenario."""
    cases = [case for case in content.cases if not case.problem]
    figure = new_figure(6.4, 1.3 + 0.42 * len(cases))
    axes = figure.subplots()
    rows = np.arange(len(cases))
    axes.barh(rows, [case.informative_s / 60 for case in cases], height=0.55, color=VERMILION, alpha=0.75, label="runs")
    if content.planned:
        moving = [float(str(case.plan.get("repositioning_s", 0.0))) / 60 for case in cases]
        begin = [case.informative_s / 60 for case in cases]
        axes.barh(rows, moving, left=begin, height=0.55, color=REPOSITION, alpha=0.6, label="repositioning")
    same_s = [against.same_accuracy_s if (against := content.against(case)) else None for case in cases]
    same_min = [np.nan if time_s is None else time_s / 60 for time_s in same_s]
    axes.plot(same_min, rows, "D", color="white", markeredgecolor="black", label="for the same accuracy")
    axes.set_yticks(rows, [plain(case.name) for case in cases])
    axes.invert_yaxis()
    axes.set_xlabel("time [min]")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=9)
    light_grid(axes, "x")
    return svg(figure, key="times", label="Time of each variant, and time for the accuracy of the scenario")


@page_figure
def day_figure(content: WhatIfContent) -> str:
    """Length of the day against the information of its whole track, a point a case."""
    known = [(case, against.track) for case in content.cases if (against := content.against(case)) and against.track]
    figure = new_figure(6.4, 3.6)
    axes = figure.subplots()
    for (case, share), colour in zip(known, LINES * 9, strict=False):
        planned, median, most = (float(str(case.plan[key])) / 60 for key in DAY)
        axes.plot([planned, most], [share, share], "-", color=colour, linewidth=1.2)
        axes.plot(median, share, "|", color=colour, markersize=9)
        axes.plot(planned, share, "o", color=colour, label=plain(case.name))
    axes.set_xlabel("day [min]")
    axes.set_ylabel("information / that of the scenario")
    axes.set_ylim(0.0, 1.08 * max(share for _, share in known))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=9)
    light_grid(axes)
    return svg(figure, key="days", label="Length of the day against the information of its whole track, for each case")


@page_figure
def curve_figure(content: WhatIfContent) -> str:
    """Standard deviation against informative time, a line a case; what is planned is marked."""
    figure = new_figure(6.4, 3.6)
    axes = figure.subplots()
    for case, colour in zip(content.cases, LINES * 9, strict=False):
        if not (curve := content.curve(case)):
            continue
        times, ratios = np.transpose(curve)
        axes.plot(times / 60, ratios, "-", color=colour, linewidth=1.2, label=plain(case.name))
        stands = times == case.informative_s
        axes.plot(times[stands] / 60, ratios[stands], "o", color=colour)
    axes.set_xscale("log")
    round_ticks(axes)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("time of all runs [min]")
    axes.set_ylabel("relative standard deviation")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=9)
    light_grid(axes)
    return svg(figure, key="curves", label="Standard deviation of the estimates against the time of all runs")


@page_figure
def ratio_figure(content: WhatIfContent) -> str:
    """Standard deviations over those of the scenario, for each parameter."""
    compared = [(case, against) for case in content.cases[1:] if (against := content.against(case))]
    names = content.cases[0].parameters
    figure = new_figure(6.4, 1.3 + 0.26 * len(names))
    axes = figure.subplots()
    axes.axvline(1.0, color="black", linewidth=1.0, label=plain(content.cases[0].name))
    for (case, against), colour in zip(compared, LINES[1:] + LINES * 9, strict=False):
        rows = [names.index(name) for name in against.common]
        axes.plot(against.ratios, rows, "o", color=colour, markersize=5, label=plain(case.name))
    axes.set_yticks(range(len(names)), [plain(name) for name in names])
    axes.invert_yaxis()
    axes.set_xscale("log")
    round_ticks(axes)
    axes.set_xlabel("expected standard deviation / that of the scenario")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=9)
    light_grid(axes, "x")
    return svg(figure, key="ratios", label="Expected standard deviation of each parameter over that of the scenario")


@page_figure
def runs_figure(content: WhatIfContent) -> str:
    """Whole runs of each primitive in every case."""
    cases = [case for case in content.cases if not case.problem]
    names = list(dict.fromkeys(name for case in cases for name in case.runs))
    table = np.array([[case.runs.get(name, 0) for name in names] for case in cases])
    figure = new_figure(6.4, 1.6 + 0.3 * len(names))
    axes = figure.subplots()
    axes.imshow(
        np.where(table > 0, table, np.nan).T, cmap="Blues", vmin=0, vmax=1.6 * max(1, table.max()), aspect="auto"
    )
    for (column, row), count in np.ndenumerate(table):
        axes.text(column, row, str(count) if count else "\N{MIDDLE DOT}", ha="center", va="center", fontsize=9)
    axes.set_xticks(range(len(cases)), [plain(case.name) for case in cases], rotation=20, ha="right")
    axes.set_yticks(range(len(names)), [plain(name) for name in names])
    return svg(figure, key="runs", label="Whole runs of each primitive in every case")


DAY_COLUMNS = ("day [min]", "median [min]", "95 % [min]")


def whatif_document(content: WhatIfContent) -> Document:
    """The variants for people."""
    first, others = content.cases[0], len(content.cases) - 1
    rows = [table_row(content, case) for case in content.cases]
    told = explanations(content)
    differences = [(name, sentence) for name, sentences in told for sentence in sentences]
    changes = {case.name: case.changes for case in content.cases}
    compared = [content.against(case) for case in content.cases]
    return Document(
        kind="What if",
        title=first.name,
        name=f"What if: {first.name}",
        about=f"The scenario and {counted(others, 'variant')}, compared",
        values=whatif_values(content),
        sections=(
            section(
                "Side by side",
                Table(header=table_header(content), rows=rows, texts=2),
                COMPARED,
                Figure(
                    draw=partial(time_figure, content),
                    caption="Bars: designed time. Diamonds: time for the accuracy of the scenario. A diamond left of "
                    "the scenario\u2019s own is better.",
                ),
            ),
            *([_days(content)] if any(against and against.track for against in compared) else []),
            *([_curves(content)] if any(map(content.curve, content.cases)) else []),
            *(section(name, *([Listing(changes[name])] if changes[name] else []), *lines) for name, lines in told),
            section("Differences", Table(header=("Case", "What differs"), rows=differences, on="terminal")),
            *([_ratios(content)] if any(compared[1:]) else []),
            section(
                "Runs",
                Figure(draw=partial(runs_figure, content), caption="Number of whole runs of each manoeuvre."),
            ),
            section(
                "Assumptions",
                "The standard deviations are those of instrumental-variable estimates from the runs alone, or from "
                "whole days where legs count, to first order in the sensor noise, with the nominal model of each case. "
                "Prior knowledge is not included.",
            ),
        ),
    )


def whatif_values(content: WhatIfContent) -> dict[str, object]:
    """Numbers of every case, for JSON."""
    differences = dict(explanations(content))
    return {
        "cases": {
            case.name: {
                "problem": case.problem or None,
                "informative_s": case.informative_s,
                "accuracy": None if (against := content.against(case)) is None else against.accuracy,
                "same_accuracy_s": None if against is None else against.same_accuracy_s,
                "differences": list(differences.get(case.name, ())),
            }
            for case in content.cases
        }
    }


def _days(content: WhatIfContent) -> Section:
    caption = (
        "Points: the day as planned, and the information of its whole track, legs included, compared with the "
        "scenario\u2019s. Lines: to the 95th percentile of the simulated trials, with a mark at the median."
    )
    return section("The day and what it tells", Figure(draw=partial(day_figure, content), caption=caption))


def _curves(content: WhatIfContent) -> Section:
    caption = (
        "Expected standard deviation (geometric mean over parameters) of the optimal whole runs in shorter and longer "
        "times, divided by that of the scenario; points are the cases as they stand. Legs are not counted."
    )
    return section("Accuracy against time", Figure(draw=partial(curve_figure, content), caption=caption))


def _ratios(content: WhatIfContent) -> Section:
    caption = (
        "Expected standard deviation divided by that of the scenario, from the runs, or from whole days where legs "
        "count. Values below 1 are more accurate."
    )
    return section("Accuracy of each parameter", Figure(draw=partial(ratio_figure, content), caption=caption))


COMPARED = (
    "\u201cInformation\u201d compares the variant with the scenario, for the parameters that both estimate. 2 \u00d7 "
    "means half the variance. It is the determinant of the information matrix, to the power 1/p for p parameters. "
    "\u201cSame accuracy\u201d is the informative time in which the runs of the variant, in the same proportions, are "
    "as accurate as the scenario. Where a case asks for an accuracy in the shortest day, legs count, and "
    "whole days are compared."
)


def table_header(content: WhatIfContent) -> tuple[str, ...]:
    """Names of the columns of `table_row`; of the day where one was planned."""
    days, clearance = (DAY_COLUMNS, ("clearance [m]",)) if content.planned else ((), ())
    runs = ("time of runs [min]", "information", "same accuracy [min]", "short of optimum")
    return ("Case", "criterion", "runs", *days, *runs, *clearance)


def table_row(content: WhatIfContent, case: Case) -> tuple[str, ...]:
    """One case as a row; dashes where it has no result."""
    if case.problem:
        return (case.name, *("-",) * (len(table_header(content)) - 1))
    against = content.against(case)
    return (
        case.name,
        case.criterion,
        str(sum(case.runs.values())),
        *(_minutes(case.plan.get(key)) for key in DAY if content.planned),
        f"{case.informative_s / 60:.1f}",
        "-" if against is None else f"{against.accuracy:.2f} \N{MULTIPLICATION SIGN}",
        "-" if against is None else _minutes(against.same_accuracy_s),
        _short(case.gap_relative),
        *((_metres(case.plan),) if content.planned else ()),
    )


def _short(gap: float) -> str:
    """A proven distance from the optimum, with no more digits than anyone can use."""
    return "below 0.01 %" if gap < 1e-4 else f"{100 * gap:.2g} %"


def _minutes(value: object) -> str:
    return f"{value / 60:.1f}" if isinstance(value, float) and math.isfinite(value) else "-"


def _metres(plan: object) -> str:
    value = plan.get("least_clearance_m") if isinstance(plan, dict) else None
    return f"{value:.1f}" if isinstance(value, float) else "-"
