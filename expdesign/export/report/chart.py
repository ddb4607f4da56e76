"""The chart: land, water with its safety contour, the track by kind of leg, runs numbered in order."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import shapely

from expdesign.conventions import to_n_frame
from expdesign.errors import NoPlan
from expdesign.export import words
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
    page_figure,
    short,
    svg,
)
from expdesign.export.report.content import ReportContent, primitive_runs
from expdesign.indices import DEPTH_BY_DRAUGHT
from expdesign.plan.runs import dispersion_m
from expdesign.plan.values import Plan
from expdesign.sea_area import LocalFrame, SeaArea, as_multipolygon, eroded
from expdesign.values import Array
from expdesign.vessel import Vessel
from expdesign.vessel.vessel import covering_discs, hull_polygons

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch

LETTER_IN = 0.075  # mean width of the letters of a zone's name
UNCHARTED_SHARE = 1e-6  # share of the allowed water that may be outside the charted depths that bound it
FOOTPRINT_SEED = 0  # random seed of the footprint figure; the planner uses other random numbers
FOOTPRINT_PIECES = 40  # places of the hull along a run that its drawn footprint is made of
STEPS = (1.0, 2.0, 5.0, 10.0)


def nice_step(span: float, most: int) -> float:
    """The smallest of 1, 2, 5 x 10^n that cuts the span into no more than `most` pieces."""
    power = 10.0 ** math.floor(math.log10(span / most))
    return next(step * power for step in STEPS if span / (step * power) <= most)


def draw_position_ticks(
    axes: Axes, frame: LocalFrame, box: tuple[float, float, float, float], *, most_lon: int = 5
) -> None:
    """Ticks at round minutes: latitude on the left edge, longitude on the lower edge, as many there as have room."""
    west, south, east, north = box
    (lat_low, lon_low), (lat_high, _) = frame.to_degrees(np.array([[south, west], [north, west]])).tolist()
    lon_high = frame.to_degrees(np.array([south, east])).tolist()[1]
    lats, lat_decimals = _round_minutes(lat_low, lat_high, 6)
    lons, lon_decimals = _round_minutes(lon_low, lon_high + 360.0 * (lon_high < lon_low), most_lon)
    ticks_north = [float(frame.to_metres(np.array([lat, lon_low]))[0]) for lat in lats]
    ticks_east = [float(frame.to_metres(np.array([lat_low, lon]))[1]) for lon in lons]
    axes.set_yticks(ticks_north, [words.latitude(lat, lat_decimals) for lat in lats], fontsize=9)
    axes.set_xticks(ticks_east, [words.longitude(lon, lon_decimals) for lon in lons], fontsize=9)
    for spine in axes.spines.values():
        spine.set_visible(True)


def _round_minutes(low_deg: float, high_deg: float, most: int) -> tuple[list[float], int]:
    """Values [deg] at round minutes within the range, and the decimals that the minutes need."""
    step = nice_step((high_deg - low_deg) * 60, most)
    counts = range(math.ceil(low_deg * 60 / step), math.floor(high_deg * 60 / step) + 1)
    return [count * step / 60 for count in counts], max(0, -math.floor(math.log10(step) + 1e-9))


def draw_scale_and_north(axes: Axes, box: tuple[float, float, float, float]) -> None:
    """A bar of round length in the lower left corner and an arrow to north in the upper right one."""
    west, south, east, north = box
    length = nice_step(east - west, 6)
    x, y = west + 0.03 * (east - west), south + 0.04 * (north - south)
    halo = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}
    axes.plot([x, x + length], [y, y], color=BLACK, linewidth=3, solid_capstyle="butt", zorder=7)
    axes.annotate(words.distance(length), (x, y), (0, 7), textcoords="offset points", fontsize=9, zorder=7, bbox=halo)
    axes.annotate(
        "N", (0.965, 0.985), (0.965, 0.90), xycoords="axes fraction", ha="center", va="top", fontsize=11,
        fontweight="bold", zorder=7, arrowprops={"arrowstyle": "-|>", "color": BLACK, "linewidth": 1.8}, bbox=halo,
    )  # fmt: skip


Range = tuple[float, float]


def place_labels(anchors: Array, track: Array, *, size: float, bounds: tuple[Range, Range]) -> Array:
    """A place near each anchor that keeps off the track, the frame and the labels placed before.

    Args:
        anchors: (n, 2) x, y to be labelled, in order.
        track: (k, 2) what labels should not cover.
        size: diameter of a label, in the unit of the coordinates.
        bounds: x range and y range.

    Returns:
        (n, 2) label centres.
    """
    angles = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    offsets = np.concatenate([ring * size * reach for reach in (1.1, 1.7, 2.6, 3.6)])
    (low_x, high_x), (low_y, high_y) = bounds
    placed: list[Array] = []
    for anchor in anchors:
        centres = anchor + offsets
        near_track = np.hypot(*(centres[:, None, :] - track).transpose(2, 0, 1)) < 0.75 * size
        cost = np.hypot(*offsets.T) / size + 4.0 * near_track.any(axis=1)
        for other in placed:
            cost += 12.0 * (np.hypot(*(centres - other).T) < 1.15 * size)
        outside = (centres < [low_x + size / 2, low_y + size / 2]) | (centres > [high_x - size / 2, high_y - size / 2])
        placed.append(centres[int(np.argmin(cost + 50.0 * outside.any(axis=1)))])
    return np.array(placed).reshape(-1, 2)


def footprints(content: ReportContent) -> list[shapely.Geometry]:
    """The area (east, north) that the hull covers in each run with the plan's confidence; none where not computable."""
    plan, vessel = content.plan, content.vessel
    centres, _ = covering_discs(vessel.length_m, vessel.beam_m)
    primitives = {item.primitive.name: item.primitive for item in content.information}
    radii: dict[str, Array | None] = {}
    found = []
    for leg in plan.legs:
        if leg.kind != "primitive" or leg.name not in primitives:
            continue
        if leg.name not in radii:
            try:
                radii[leg.name] = dispersion_m(
                    vessel,
                    primitives[leg.name],
                    content.environment,
                    centres_m=centres,
                    confidence=content.confidence,
                    rng=np.random.default_rng(FOOTPRINT_SEED),
                )
            except NoPlan:
                radii[leg.name] = None
        radius = radii[leg.name]
        if radius is not None:
            found.append(_covered(plan.trajectory.pose[leg.first : leg.last + 1], radius, vessel.hull_b))
    return found


def _covered(pose: Array, radius: Array, hull_b: Array) -> shapely.Geometry:
    count = min(len(pose), len(radius))
    chosen = np.unique(np.linspace(0, count - 1, FOOTPRINT_PIECES).round().astype(int))
    grown = shapely.buffer(hull_polygons(pose[chosen], hull_b), radius[chosen], quad_segs=4)
    spans = [shapely.union_all(pair).convex_hull for pair in pairwise(grown)]
    return shapely.union_all(spans)


WIDTH_IN, LABELS_IN = 6.4, 0.9  # of a chart, and of it for the labels of latitudes
KINDS = {"reposition": (REPOSITION, 1.3), "primitive": (PRIMITIVE, 2.4)}
SHALLOW, DEEP, SAFETY = "#a9cfe8", "#ffffff", "#3f4a55"
"""Water within the safety contour, water deep enough for trials in deep water, and the contour itself."""
Box = tuple[float, float, float, float]


@page_figure
def chart(content: ReportContent) -> str:
    """The whole trial on the chart, as SVG."""
    plan = content.plan
    west, _, east, _ = box = view(content)
    figure, axes = sea_figure(plan.area, box, WIDTH_IN, clearance_m=content.clearance_m, vessel=content.vessel)
    for covered in footprints(content):
        axes.add_patch(_patch(covered, facecolor=PRIMITIVE, alpha=0.18, edgecolor="none"))
    _draw_track(axes, plan, content.vessel.hull_b, least_length_m=0.022 * (east - west))
    _draw_ends(axes, content)
    _draw_runs(axes, plan, metres_per_inch=(east - west) / (WIDTH_IN - LABELS_IN))
    draw_position_ticks(axes, plan.area.frame, box)
    draw_scale_and_north(axes, box)
    label = f"Chart of the trial in {plan.area.name}: track, {len(primitive_runs(plan))} numbered runs, start and goal"
    return svg(figure, key="chart", label=label, titles=_titles(content))


def _titles(content: ReportContent) -> dict[str, str]:
    """Artist of the chart -> what it is."""
    plan, numbers = content.plan, {run.leg: run.number for run in primitive_runs(content.plan)}
    times = [(leg.last - leg.first) * plan.commands.sample_time_s for leg in plan.legs]
    named = {
        index: (f"run {numbers[index]}: {content.shown(leg.name)}" if index in numbers else
                f"repositioning to {content.shown(leg.name)}")
        for index, leg in enumerate(plan.legs)
    }  # fmt: skip
    legs = {f"leg-{index}": f"{text}, {words.duration(times[index])}" for index, text in named.items()}
    check = plan.verification
    nearest = f"least clearance: {words.distance(check.clearance_min_m)} at {words.clock(check.clearance_time_s)}"
    runs = {f"run-{number}": legs[f"leg-{index}"] for index, number in numbers.items()}
    return {**legs, **runs, "start": "start", "goal": "goal", "nearest": nearest}


def sea_figure(area: SeaArea, box: Box, width_in: float, *, clearance_m: float, vessel: Vessel) -> tuple[Figure, Axes]:
    """A figure of part of the sea, with room for the labels of positions."""
    west, south, east, north = box
    height_in = (width_in - LABELS_IN) * (north - south) / (east - west) + 0.4
    figure = new_figure(width_in, height_in, layout="compressed")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    draw_sea(axes, area, box, clearance_m=clearance_m, draught_m=vessel.draught_m)
    return figure, axes


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


def draw_sea(axes: Axes, area: SeaArea, box: Box, *, clearance_m: float, draught_m: float) -> None:
    """Forbidden as background, water in the shades of an electronic chart, land, and how near the hull may come.

    Water shallower than the safety contour is blue, deeper water pale, and from the depth of `deep_from` on white. The
    safety contour is the bold line; there is none where depth is not charted.

    Source: IHO S-52 (2014), presentation of depth areas and the safety contour.
    """
    axes.set_facecolor(FORBIDDEN)
    around = shapely.box(*box).buffer(3 * clearance_m + 1.0, join_style="mitre")
    detail = (box[2] - box[0]) / 2000
    near = as_multipolygon(shapely.simplify(shapely.intersection(area.water, around), detail))
    axes.add_patch(_patch(near, facecolor=WATER, edgecolor="#7aa6c2", linewidth=0.5))
    for shade, polygons in _depth_shades(area, draught_m, around):
        axes.add_patch(_patch(shapely.simplify(polygons, detail), facecolor=shade, edgecolor="none"))
    contour = safety_contour(area)
    if contour is not None:
        line = shapely.simplify(_at_least(area, contour, around), detail)
        axes.add_patch(_patch(line, facecolor="none", edgecolor=SAFETY, linewidth=1.6))
    land = as_multipolygon(shapely.simplify(shapely.intersection(area.land, around), detail))
    axes.add_patch(_patch(land, facecolor=LAND, edgecolor="#8a7440", linewidth=0.5))
    for name, zone in area.named:
        _name_zone(axes, name, shapely.intersection(zone, shapely.box(*box)))
    if clearance_m > 0:
        safe = as_multipolygon(shapely.simplify(eroded(near, clearance_m), detail))
        axes.add_patch(_patch(safe, facecolor="none", edgecolor=GREY, linewidth=0.7, linestyle=(0, (2, 2))))


def _name_zone(axes: Axes, name: str, seen: shapely.Geometry) -> None:
    """The name of a zone in the middle of what is seen of it, or beside a small one, towards the chart's middle."""
    if seen.is_empty:
        return
    text, place, (west, east) = short(name), seen.representative_point(), axes.get_xlim()
    least, most = seen.bounds[0], seen.bounds[2]
    if most - least > LETTER_IN / (WIDTH_IN - LABELS_IN) * len(text) * (east - west):
        x, side = (least + most) / 2 if seen.contains(shapely.Point((least + most) / 2, place.y)) else place.x, "center"
    else:
        x, side = (least, "right") if place.x > (west + east) / 2 else (most, "left")
    axes.text(x, place.y, text, ha=side, va="center", fontsize=8, style="italic", color=SAFETY, zorder=4)


def _depth_shades(
    area: SeaArea, draught_m: float, around: shapely.Geometry
) -> Iterator[tuple[str, shapely.MultiPolygon]]:
    """(shade, water of it) from shallow to deep; later ones cover earlier ones."""
    if not area.depths:
        return
    contour = safety_contour(area)
    yield SHALLOW, _at_least(area, -math.inf, around)
    if contour is not None:
        yield WATER, _at_least(area, contour, around)
    deep = deep_from(area, draught_m)
    if deep is not None:
        yield DEEP, _at_least(area, deep, around)


def _at_least(area: SeaArea, depth_m: float, around: shapely.Geometry) -> shapely.MultiPolygon:
    near = [shapely.intersection(polygons, around) for depth, polygons in area.depths if depth >= depth_m]
    return as_multipolygon(shapely.union_all(near))


def safety_contour(area: SeaArea) -> float | None:
    """The charted depth that bounds the allowed water [m]; None where depth does not bound it."""
    left: shapely.Geometry = area.water
    for depth, polygons in reversed(area.depths):
        left = left.difference(polygons)
        if left.area <= UNCHARTED_SHARE * area.water.area:
            return float(depth)
    return None


def deep_from(area: SeaArea, draught_m: float) -> float | None:
    """The least charted depth that counts as deep water for manoeuvring trials [m]; None where there is none."""
    contour = safety_contour(area)
    deep = [depth for depth, _ in area.depths if depth >= DEPTH_BY_DRAUGHT * draught_m]
    return min(deep) if deep and contour is not None and min(deep) > contour else None


def _patch(geometry: shapely.Geometry, **style: object) -> PathPatch:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    rings = [ring for polygon in as_multipolygon(geometry).geoms for ring in (polygon.exterior, *polygon.interiors)]
    outlines = [Outline(np.asarray(ring.coords)[:, :2], closed=True) for ring in rings]
    return PathPatch(Outline.make_compound_path(*outlines) if outlines else Outline(np.zeros((0, 2))), **style)


def _draw_track(axes: Axes, plan: Plan, hull_b: Array, *, least_length_m: float) -> None:
    pose = plan.trajectory.pose
    for index, leg in sorted(enumerate(plan.legs), key=lambda item: item[1].kind == "primitive"):
        colour, width = KINDS[leg.kind]
        north, east = pose[leg.first : leg.last + 1, :2].T
        axes.plot(east, north, color=colour, linewidth=width, solid_capstyle="round", gid=f"leg-{index}")
    for sample in _heading_marks(pose):
        outline = to_n_frame(_with_bow(hull_b, least_length_m), pose[sample])
        axes.fill(outline[:, 1], outline[:, 0], facecolor="white", edgecolor=BLACK, linewidth=0.7, zorder=3)


def _with_bow(hull_b: Array, least_length_m: float) -> Array:
    """(5, 2) the hull with a bow, drawn larger where it would be too small to see."""
    x, y = hull_b.max(axis=0) * max(1.0, least_length_m / np.ptp(hull_b[:, 0]))
    return np.array([[x, 0], [0.4 * x, y], [-x, y], [-x, -y], [0.4 * x, -y]])


MARKS = 14  # of headings along a track


def _heading_marks(pose: Array) -> list[int]:
    """Samples spread evenly over the distance sailed."""
    sailed = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pose[:, :2], axis=0).T))])
    places = np.linspace(0.0, sailed[-1], MARKS + 2)[1:-1]
    return [int(sample) for sample in np.searchsorted(sailed, places)]


def _draw_ends(axes: Axes, content: ReportContent) -> None:
    ends = ("start", content.start, "o", GREEN, 9), ("goal", content.goal, "*", PURPLE, 15)
    for gid, pose, sign, colour, size in ends:
        axes.plot(pose[1], pose[0], sign, color=colour, markersize=size, markeredgecolor="white", zorder=5, gid=gid)
    check = content.plan.verification
    sample = round(check.clearance_time_s / content.plan.trajectory.sample_time_s)
    place = content.plan.trajectory.pose[min(max(sample, 0), len(content.plan.trajectory) - 1)]
    axes.plot(place[1], place[0], "x", color=BLACK, markersize=9, markeredgewidth=2, zorder=5, gid="nearest")


def _draw_runs(axes: Axes, plan: Plan, *, metres_per_inch: float) -> None:
    pose, runs = plan.trajectory.pose, primitive_runs(plan)
    middles = np.array([pose[(plan.legs[run.leg].first + plan.legs[run.leg].last) // 2, 1::-1] for run in runs])
    bounds = (axes.get_xlim(), axes.get_ylim())
    places = place_labels(middles, pose[:, 1::-1], size=0.22 * metres_per_inch, bounds=bounds)
    for run, anchor, place in zip(runs, middles, places, strict=True):
        axes.plot(*zip(anchor, place, strict=True), color=PRIMITIVE, linewidth=0.7, zorder=4)
        axes.text(
            place[0], place[1], str(run.number), ha="center", va="center", fontsize=9, fontweight="bold", zorder=6,
            gid=f"run-{run.number}",
            bbox={"boxstyle": "circle,pad=0.2", "facecolor": "white", "edgecolor": PRIMITIVE, "linewidth": 1.2},
        )  # fmt: skip


def _entry(text: str, colour: str, sign: str = "") -> dict[str, str]:
    """One entry of the legend: a sign in a colour, or an area of it where there is no sign."""
    return {"text": text, "colour": colour, "sign": sign}


def chart_legend(content: ReportContent) -> list[dict[str, str]]:
    """The signs of the chart, for the text under it: only those that it shows."""
    area, box = content.plan.area, shapely.box(*view(content))
    contour, deep = safety_contour(area), deep_from(area, content.vessel.draught_m)
    entries = [
        _entry("run, numbered", PRIMITIVE, "\N{BOX DRAWINGS HEAVY HORIZONTAL}"),
        _entry("repositioning", REPOSITION, "\N{BOX DRAWINGS LIGHT HORIZONTAL}"),
        _entry(f"the hull stays here with {100 * content.confidence:g} % probability", "#f8ddd0"),
        _entry("start", GREEN, "\N{BLACK CIRCLE}"),
        _entry("goal", PURPLE, "\N{BLACK STAR}"),
        _entry("least clearance", BLACK, "\N{MULTIPLICATION X}"),
    ]
    if content.clearance_m > 0:
        text = f"{content.clearance_m:g} m from forbidden water"
        entries.append(_entry(text, GREY, "\N{BOX DRAWINGS LIGHT TRIPLE DASH HORIZONTAL}"))
    if contour is not None:
        text = f"safety contour, {contour:g} m"
        entries.append(_entry(text, SAFETY, "\N{BOX DRAWINGS HEAVY HORIZONTAL}"))
        entries.append(_entry(f"shallower than {contour:g} m", SHALLOW))
    safe = "allowed water" if contour is None else f"{contour:g} m or more"
    entries.append(_entry(safe if deep is None else f"{contour:g} to {deep:g} m", WATER))
    if deep is not None:
        entries.append(_entry(f"{deep:g} m or more: deep for trials", DEEP))
    if area.land.intersects(box):
        entries.append(_entry("land", LAND))
    if not shapely.union_all([area.water, area.land, *(each for _, each in area.depths)]).covers(box):
        entries.append(_entry("forbidden or uncharted", FORBIDDEN))
    return entries
