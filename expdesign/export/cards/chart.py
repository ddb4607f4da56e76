"""The small chart of one run: the way in, the run, the hull where it starts and ends, and the water around."""

from __future__ import annotations

import numpy as np

from expdesign.conventions import to_n_frame
from expdesign.export.report.content import ReportContent
from expdesign.export.report.figures.chart import draw_sea
from expdesign.export.report.figures.position_axes import draw_position_ticks, draw_scale_and_north
from expdesign.export.report.figures.style import BLACK, GREEN, PRIMITIVE, REPOSITION, new_figure, svg
from expdesign.plan.values import Leg

WIDTH_IN, HEIGHT_IN = 3.6, 3.6


def run_chart(content: ReportContent, leg: Leg, *, number: int) -> str:
    """As SVG."""
    plan, pose = content.plan, content.plan.trajectory.pose
    places = pose[leg.first : leg.last + 1, 1::-1]
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    half = max(float(np.ptp(places, axis=0).max()) * 0.75, 3 * content.vessel.length_m, 4 * content.clearance_m)
    box = (*(middle - half), *(middle + half))
    figure = new_figure(WIDTH_IN, HEIGHT_IN)
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_xlim(box[0], box[2])
    axes.set_ylim(box[1], box[3])
    draw_sea(axes, plan.area, box, content.clearance_m)
    lead = pose[max(leg.first - (leg.last - leg.first), 0) : leg.first + 1]
    axes.plot(lead[:, 1], lead[:, 0], color=REPOSITION, linewidth=1.2)
    axes.plot(places[:, 0], places[:, 1], color=PRIMITIVE, linewidth=2.2)
    for sample, colour in ((leg.first, GREEN), ((leg.first + leg.last) // 2, "white"), (leg.last, "white")):
        hull = to_n_frame(content.vessel.hull_b, pose[sample])
        axes.fill(hull[:, 1], hull[:, 0], facecolor=colour, edgecolor=BLACK, linewidth=0.8, zorder=4)
    draw_position_ticks(axes, plan.area.frame, box, most_lon=2)
    draw_scale_and_north(axes, box)
    return svg(figure, key=f"card-{number}", label=f"Chart of run {number}, {leg.name}")
