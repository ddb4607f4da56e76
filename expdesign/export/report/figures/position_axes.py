"""Latitude and longitude along the edges of the chart, a scale bar, and north."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from expdesign.export import words
from expdesign.export.pages.figures import BLACK
from expdesign.sea_area import LocalFrame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
