"""The chart: land, allowed water, the track by kind of leg, runs numbered in order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely

from expdesign.conventions import to_n_frame
from expdesign.export.pages.figures import (
    BLACK,
    FORBIDDEN,
    GREEN,
    GREY,
    LAND,
    PRIMITIVE,
    PURPLE,
    REPOSITION,
    WATER,
    new_figure,
    svg,
)
from expdesign.export.report.content import ReportContent, primitive_runs
from expdesign.export.report.figures.footprints import footprints
from expdesign.export.report.figures.labels import place_labels
from expdesign.export.report.figures.position_axes import draw_position_ticks, draw_scale_and_north
from expdesign.export.tuning import TUNING
from expdesign.plan.values import Plan
from expdesign.sea_area import SeaArea, as_multipolygon, eroded
from expdesign.values import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch, PathPatch

WIDTH_IN = 8.0
KINDS = {"reposition": (REPOSITION, 1.3), "primitive": (PRIMITIVE, 2.4)}
Box = tuple[float, float, float, float]


def chart(content: ReportContent) -> str:
    """The whole trial on the chart, as SVG."""
    plan = content.plan
    box = view(content)
    west, south, east, north = box
    map_width_in = WIDTH_IN - 1.0
    height_in = map_width_in * (north - south) / (east - west)
    figure = new_figure(WIDTH_IN, height_in + 1.5)
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    draw_sea(axes, plan.area, box, content.clearance_m)
    for covered in footprints(content):
        axes.add_patch(_patch(covered, facecolor=PRIMITIVE, alpha=0.18, edgecolor="none"))
    _draw_track(axes, plan, content.vessel.hull_b, least_length_m=0.022 * (east - west))
    _draw_ends(axes, content)
    _draw_runs(axes, plan, metres_per_inch=(east - west) / map_width_in)
    draw_position_ticks(axes, plan.area.frame, box)
    draw_scale_and_north(axes, box)
    figure.legend(handles=_legend(content), loc="outside lower center", ncols=3, fontsize=9)
    label = f"Chart of the trial in {plan.area.name}: track, {len(primitive_runs(plan))} numbered runs, start and goal"
    return svg(figure, key="chart", label=label)


def view(content: ReportContent) -> Box:
    """West, south, east, north [m] of the part of the sea to show: the track with room around it."""
    places = np.vstack([content.plan.trajectory.pose[:, :2], content.start[:2], content.goal[:2]])
    (south, west), (north, east) = places.min(axis=0), places.max(axis=0)
    margin = max(0.12 * max(north - south, east - west), 3 * content.vessel.length_m)
    width, height = east - west + 2 * margin, north - south + 2 * margin
    width, height = max(width, 0.75 * height), max(height, 0.5 * width)
    middle_east, middle_north = (west + east) / 2, (south + north) / 2
    return (
        middle_east - width / 2, middle_north - height / 2, middle_east + width / 2, middle_north + height / 2,
    )  # fmt: skip


def draw_sea(axes: Axes, area: SeaArea, box: Box, clearance_m: float) -> None:
    """Forbidden as background, allowed water, land, and how near the hull may come."""
    axes.set_facecolor(FORBIDDEN)
    around = shapely.box(*box).buffer(3 * clearance_m + 1.0, join_style="mitre")
    detail = (box[2] - box[0]) / 2000
    near = as_multipolygon(shapely.intersection(area.water, around))
    axes.add_patch(_patch(shapely.simplify(near, detail), facecolor=WATER, edgecolor="#7aa6c2", linewidth=0.5))
    for number, (_, polygons) in enumerate(area.depths):
        deep = as_multipolygon(shapely.simplify(shapely.intersection(polygons, around), detail))
        axes.add_patch(_patch(deep, facecolor=depth_colour(number, len(area.depths)), edgecolor="none", alpha=0.6))
    land = as_multipolygon(shapely.simplify(shapely.intersection(area.land, around), detail))
    axes.add_patch(_patch(land, facecolor=LAND, edgecolor="#8a7440", linewidth=0.5))
    if clearance_m > 0:
        safe = as_multipolygon(shapely.simplify(eroded(near, clearance_m), detail))
        axes.add_patch(_patch(safe, facecolor="none", edgecolor=GREY, linewidth=0.7, linestyle=(0, (2, 2))))


def shown_depths(count: int) -> set[int]:
    """Numbers of the depths in the legend: few of them, the shallowest and the deepest among them."""
    return set(np.linspace(0, count - 1, min(count, TUNING.legend_depths)).round().astype(int).tolist())


def depth_colour(number: int, count: int) -> str:
    """Shallow to deep: from the blue of charts to white, as on paper charts."""
    share = number / max(count - 1, 1)
    return "#" + "".join(f"{round(low + share * (255 - low)):02x}" for low in (0xB7, 0xD7, 0xEE))


def _patch(geometry: shapely.Geometry, **style: object) -> PathPatch:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    rings = [ring for polygon in as_multipolygon(geometry).geoms for ring in (polygon.exterior, *polygon.interiors)]
    outlines = [Outline(np.asarray(ring.coords)[:, :2], closed=True) for ring in rings]
    return PathPatch(Outline.make_compound_path(*outlines) if outlines else Outline(np.zeros((0, 2))), **style)


def _draw_track(axes: Axes, plan: Plan, hull_b: Array, *, least_length_m: float) -> None:
    pose = plan.trajectory.pose
    for leg in sorted(plan.legs, key=lambda leg: leg.kind == "primitive"):
        colour, width = KINDS[leg.kind]
        north, east = pose[leg.first : leg.last + 1, :2].T
        axes.plot(east, north, color=colour, linewidth=width, solid_capstyle="round")
    for sample in _heading_marks(pose):
        outline = to_n_frame(_with_bow(hull_b, least_length_m), pose[sample])
        axes.fill(outline[:, 1], outline[:, 0], facecolor="white", edgecolor=BLACK, linewidth=0.7, zorder=3)


def _with_bow(hull_b: Array, least_length_m: float) -> Array:
    """(5, 2) the hull with a bow, drawn larger where it would be too small to see."""
    x, y = hull_b.max(axis=0) * max(1.0, least_length_m / np.ptp(hull_b[:, 0]))
    return np.array([[x, 0], [0.4 * x, y], [-x, y], [-x, -y], [0.4 * x, -y]])


def _heading_marks(pose: Array, count: int = 14) -> list[int]:
    """Samples spread evenly over the distance sailed."""
    sailed = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pose[:, :2], axis=0).T))])
    places = np.linspace(0.0, sailed[-1], count + 2)[1:-1]
    return [int(sample) for sample in np.searchsorted(sailed, places)]


def _draw_ends(axes: Axes, content: ReportContent) -> None:
    axes.plot(content.start[1], content.start[0], "o", color=GREEN, markersize=9, markeredgecolor="white", zorder=5)
    axes.plot(content.goal[1], content.goal[0], "*", color=PURPLE, markersize=15, markeredgecolor="white", zorder=5)
    check = content.plan.verification
    sample = round(check.clearance_time_s / content.plan.trajectory.sample_time_s)
    place = content.plan.trajectory.pose[min(max(sample, 0), len(content.plan.trajectory) - 1)]
    axes.plot(place[1], place[0], "x", color=BLACK, markersize=9, markeredgewidth=2, zorder=5)


def _draw_runs(axes: Axes, plan: Plan, *, metres_per_inch: float) -> None:
    pose, runs = plan.trajectory.pose, primitive_runs(plan)
    middles = np.array([pose[(plan.legs[run.leg].first + plan.legs[run.leg].last) // 2, 1::-1] for run in runs])
    bounds = (axes.get_xlim(), axes.get_ylim())
    places = place_labels(middles, pose[:, 1::-1], size=0.22 * metres_per_inch, bounds=bounds)
    for run, anchor, place in zip(runs, middles, places, strict=True):
        axes.plot(*zip(anchor, place, strict=True), color=PRIMITIVE, linewidth=0.7, zorder=4)
        axes.text(
            place[0], place[1], str(run.number), ha="center", va="center", fontsize=9, fontweight="bold", zorder=6,
            bbox={"boxstyle": "circle,pad=0.2", "facecolor": "white", "edgecolor": PRIMITIVE, "linewidth": 1.2},
        )  # fmt: skip


def _legend(content: ReportContent) -> Sequence[Line2D | Patch]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    reposition, primitive = KINDS["reposition"], KINDS["primitive"]
    clearance = f"{content.clearance_m:g} m from forbidden water"
    covered = f"hull area with {100 * content.confidence:g} % probability"
    depths = content.plan.area.depths
    shown = (
        Patch(facecolor=depth_colour(number, len(depths)), edgecolor="#7aa6c2", alpha=0.6, label=f"{depth:g} m or more")
        for number, (depth, _) in enumerate(depths)
        if number in shown_depths(len(depths))
    )
    return (
        Line2D([], [], color=primitive[0], linewidth=primitive[1], label="informative run, numbered"),
        Patch(facecolor=PRIMITIVE, alpha=0.18, label=covered),
        Line2D([], [], color=reposition[0], linewidth=reposition[1], label="repositioning"),
        Line2D([], [], color=BLACK, marker="x", linestyle="", markeredgewidth=2, label="least clearance"),
        Line2D([], [], color=GREEN, marker="o", linestyle="", markersize=9, label="start"),
        Line2D([], [], color=PURPLE, marker="*", linestyle="", markersize=13, label="goal"),
        Line2D([], [], color=GREY, linewidth=0.8, linestyle=(0, (2, 2)), label=clearance),
        Patch(facecolor=WATER, edgecolor="#7aa6c2", label="allowed water, within the safety contour"),
        Patch(facecolor=LAND, edgecolor="#8a7440", label="land"),
        Patch(facecolor=FORBIDDEN, edgecolor=GREY, label="forbidden or uncharted"),
        *shown,
    )
