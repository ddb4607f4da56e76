"""What accuracy costs: the days planned, by their length and the information of their tracks."""

from __future__ import annotations

import numpy as np

from expdesign.export.pages.figures import BLACK, BLUE, GREY, VERMILION, light_grid, new_figure, svg
from expdesign.shortest_day import ShortestDay


def pareto_figure(day: ShortestDay) -> str:
    """Every day planned as a point, the estimated shortest days as a line, and the bound."""
    figure = new_figure(6.4, 3.6)
    axes = figure.subplots()
    minutes, shares = day.curve.T[0] / 60, 100 * day.curve.T[1]
    axes.plot(minutes, shares, "-", color=BLUE, linewidth=1.4, label="shortest, estimated")
    tried = np.array([(item.day_s / 60, 100 * item.information) for item in day.tried])
    axes.plot(*tried.T, "o", color=VERMILION, markersize=5, label="planned")
    for number, point in enumerate(tried, start=1):
        axes.annotate(str(number), point, (5, 4), textcoords="offset points", fontsize=9)
    chosen_s = day.plan.day.planned_s
    axes.plot(chosen_s / 60, 100 * day.information, "o", color="none", markeredgecolor=BLACK, markersize=12)
    asked = 100.0 if day.most_s is None else None
    if asked is not None:
        axes.axhline(asked, color=BLACK, linewidth=0.9, linestyle=":", label="asked for")
    else:
        axes.axvline((day.most_s or np.nan) / 60, color=BLACK, linewidth=0.9, linestyle=":", label="asked for")
    low, high = axes.get_xlim()
    if day.bound is not None and day.bound.day_s > 0:
        low = min(low, day.bound.day_s / 60 - 0.04 * (high - low))
        axes.axvspan(low, day.bound.day_s / 60, color=GREY, alpha=0.25, linewidth=0)
    axes.set_xlim(low, high)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("day as planned [min]")
    axes.set_ylabel("information [% of what is needed]" if day.most_s is None else "information [% of total_s]")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=9)
    light_grid(axes)
    return svg(figure, key="pareto", label="Length of the day against the information of its whole track")
