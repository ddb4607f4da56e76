"""The chart of a card: approach, runs, hull at start and end, and the water around."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from expdesign.conventions import to_n_frame
from expdesign.export.pages.figures import BLACK, GREEN, PRIMITIVE, REPOSITION, new_figure, svg
from expdesign.export.report.content import ReportContent
from expdesign.export.report.figures.chart import draw_sea
from expdesign.export.report.figures.labels import place_labels
from expdesign.export.report.figures.position_axes import draw_position_ticks, draw_scale_and_north
from expdesign.plan.values import Leg
from expdesign.values import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH_IN, HEIGHT_IN = 3.6, 3.6


def run_chart(content: ReportContent, legs: Sequence[Leg], *, numbers: Sequence[int]) -> str:
    """Runs that share a sheet, as SVG; where there are several, each has its number."""
    plan, pose = content.plan, content.plan.trajectory.pose
    tracks = [pose[leg.first : leg.last + 1, 1::-1] for leg in legs]
    places = np.vstack(tracks)
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    half = max(float(np.ptp(places, axis=0).max()) * 0.75, 3 * content.vessel.length_m, 4 * content.clearance_m)
    box = (*(middle - half), *(middle + half))
    figure = new_figure(WIDTH_IN, HEIGHT_IN)
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_xlim(box[0], box[2])
    axes.set_ylim(box[1], box[3])
    draw_sea(axes, plan.area, box, clearance_m=content.clearance_m, draught_m=content.vessel.draught_m)
    for leg, track in zip(legs, tracks, strict=True):
        lead = pose[max(leg.first - (leg.last - leg.first), 0) : leg.first + 1]
        axes.plot(lead[:, 1], lead[:, 0], color=REPOSITION, linewidth=1.2)
        axes.plot(track[:, 0], track[:, 1], color=PRIMITIVE, linewidth=2.2)
        for sample, colour in ((leg.last, "white"), ((leg.first + leg.last) // 2, "white"), (leg.first, GREEN)):
            hull = to_n_frame(content.vessel.hull_b, pose[sample])
            axes.fill(hull[:, 1], hull[:, 0], facecolor=colour, edgecolor=BLACK, linewidth=0.8, zorder=4)
    if len(legs) > 1:
        _number(axes, np.array([track[0] for track in tracks]), places, numbers, size=0.16 * half)
    draw_position_ticks(axes, plan.area.frame, box, most_lon=2)
    draw_scale_and_north(axes, box)
    label = f"Chart of run {', '.join(map(str, numbers))}, {legs[0].name}"
    return svg(figure, key=f"card-{numbers[0]}", label=label)


def _number(axes: Axes, starts: Array, track: Array, numbers: Sequence[int], *, size: float) -> None:
    places = place_labels(starts, track, size=size, bounds=(axes.get_xlim(), axes.get_ylim()))
    for number, anchor, place in zip(numbers, starts, places, strict=True):
        axes.plot(*zip(anchor, place, strict=True), color=PRIMITIVE, linewidth=0.7, zorder=5)
        axes.text(
            place[0], place[1], str(number), ha="center", va="center", fontsize=9, fontweight="bold", zorder=6,
            bbox={"boxstyle": "circle,pad=0.2", "facecolor": "white", "edgecolor": PRIMITIVE, "linewidth": 1.2},
        )  # fmt: skip
