"""The draft of a refused plan: what stands in the way, where, what helps; never a route."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
from markupsafe import Markup

from expdesign import __version__
from expdesign.errors import NoPlan
from expdesign.export.document import Document, Figure, Items, section
from expdesign.export.pages.figures import BLACK, GREEN, GREY, PURPLE, VERMILION, page_figure, svg
from expdesign.export.report.chart import draw_position_ticks, draw_scale_and_north, sea_figure
from expdesign.export.words import ship
from expdesign.sea_area import SeaArea
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel

DRAFT_POSES = 2000  # of the track of a refused plan at most

WIDTH_IN = 6.4


@sealed(start="3", goal="3")
class Refusal:
    """A refused plan."""

    scenario: str  # name
    # vessel, area: who and where
    vessel: Vessel
    area: SeaArea
    # start, goal: (3,) poses
    start: Array
    goal: Array
    clearance_m: float  # asked for [m]
    error: NoPlan  # the refusal
    earlier: tuple[str, ...] = ()  # names of results of an earlier attempt in the same folder
    command: str = ""  # how it came about

    @property
    def track(self) -> Array:
        """(k, 3) poses of the draft, thinned; none where nothing was planned."""
        poses = self.error.poses
        if poses is None:
            return np.zeros((0, 3))
        return np.asarray(poses)[:: max(1, -(-len(poses) // DRAFT_POSES))]

    @property
    def where(self) -> str:
        """The place of the obstacle, in degrees and in metres; "" where it has none."""
        if self.error.place is None:
            return ""
        north, east = self.error.place
        lat, lon = self.area.frame.to_degrees(np.array([north, east]))
        return f"{lat:.5f}, {lon:.5f} (north {north:.0f} m, east {east:.0f} m)"


def refused_json(refusal: Refusal) -> str:
    """The refusal for programs."""
    error, frame = refusal.error, refusal.area.frame
    place = None
    if error.place is not None:
        lat, lon = frame.to_degrees(np.array(error.place)).tolist()
        place = {"north_m": error.place[0], "east_m": error.place[1], "lat_deg": lat, "lon_deg": lon}
    content = {
        "refused": True,
        "verified": False,
        "scenario": refusal.scenario,
        "obstacle": error.obstacle,
        "place": place,
        "remedies": list(error.remedies),
        "tried": list(error.tried),
        "earlier_results_in_this_folder": list(refusal.earlier),
        "frame": {"projection": frame.definition},
        "draft_track": [
            {"north_m": round(north, 2), "east_m": round(east, 2), "heading_rad": round(heading, 4)}
            for north, east, heading in refusal.track.tolist()
        ],
        "command": refusal.command,
        "version": __version__,
    }
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def refused_document(refusal: Refusal) -> Document:
    """The refusal for people; the terminal has it as an error."""
    error = refusal.error
    place = [f"Place: {refusal.where}."] if refusal.where else []
    helps = (
        Items(tuple(_sentence(remedy) for remedy in error.remedies)) if error.remedies else "No remedy was looked for."
    )
    others = f"They are of an earlier attempt, not of this one: {', '.join(refusal.earlier)}."
    return Document(
        kind="Refused \u2014 there is no plan, and nothing here may be sailed",
        title=refusal.scenario,
        name=f"Refused: {refusal.scenario}",
        about=f"{ship(refusal.vessel)}, {refusal.area.name}",
        sections=(
            section(
                "What stands in the way",
                _sentence(error.obstacle),
                *place,
                Figure(draw=partial(_chart, refusal), legend=_legend(refusal)),
            ),
            section("What helps", helps),
            *([section("What was tried", Items(error.tried))] if error.tried else []),
            *([section("Other files in this folder", others)] if refusal.earlier else []),
        ),
        command=refusal.command,
    )


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


@page_figure
def _chart(refusal: Refusal) -> Markup:
    """Start, goal, the track as far as it was planned, and the obstacle."""
    box = _view(refusal)
    figure, axes = sea_figure(refusal.area, box, WIDTH_IN, clearance_m=refusal.clearance_m, vessel=refusal.vessel)
    axes.plot(refusal.track[:, 1], refusal.track[:, 0], color=GREY, linewidth=1.3, linestyle=(0, (4, 2)), zorder=3)
    for pose, sign, colour, size in ((refusal.start, "o", GREEN, 9), (refusal.goal, "*", PURPLE, 15)):
        axes.plot(pose[1], pose[0], sign, color=colour, markersize=size, markeredgecolor="white", zorder=5)
    if refusal.error.place is not None:
        place = refusal.error.place[::-1]
        axes.plot(*place, "o", color=VERMILION, markersize=24, markerfacecolor="none", markeredgewidth=2.4, zorder=6)
        axes.plot(*place, "x", color=VERMILION, markersize=10, markeredgewidth=2.4, zorder=6)
    axes.text(
        0.5, 0.5, "REFUSED", transform=axes.transAxes, ha="center", va="center", rotation=24, fontsize=54,
        fontweight="bold", color=BLACK, alpha=0.09, zorder=2,
    )  # fmt: skip
    draw_position_ticks(axes, refusal.area.frame, box)
    draw_scale_and_north(axes, box)
    return svg(figure, key="refused", label=f"Chart of {refusal.area.name}: start, goal, draft of a track, obstacle")


def _view(refusal: Refusal) -> tuple[float, float, float, float]:
    """West, south, east, north [m] of all that is drawn, with room around it."""
    places = [refusal.start[:2], refusal.goal[:2], *refusal.track[:, :2]]
    places += [] if refusal.error.place is None else [np.array(refusal.error.place)]
    (south, west), (north, east) = np.min(places, axis=0), np.max(places, axis=0)
    margin = max(0.15 * max(north - south, east - west), 6 * refusal.vessel.length_m)
    width, height = east - west + 2 * margin, north - south + 2 * margin
    width, height = max(width, 0.75 * height), max(height, 0.5 * width)
    middle = (west + east) / 2, (south + north) / 2
    return middle[0] - width / 2, middle[1] - height / 2, middle[0] + width / 2, middle[1] + height / 2


def _legend(refusal: Refusal) -> list[dict[str, str]]:
    entries = [
        {"text": "start", "colour": GREEN, "sign": "\N{BLACK CIRCLE}"},
        {"text": "goal", "colour": PURPLE, "sign": "\N{BLACK STAR}"},
    ]
    if refusal.error.place is not None:
        entries.append({"text": "what stands in the way", "colour": VERMILION, "sign": "\N{CIRCLED TIMES}"})
    if len(refusal.track):
        text = "draft of the track, not checked or too risky"
        entries.append({"text": text, "colour": GREY, "sign": "\N{BOX DRAWINGS LIGHT TRIPLE DASH HORIZONTAL}"})
    if refusal.clearance_m > 0:
        text = f"{refusal.clearance_m:g} m from forbidden water"
        entries.append({"text": text, "colour": GREY, "sign": "\N{BOX DRAWINGS LIGHT DOUBLE DASH HORIZONTAL}"})
    return entries
