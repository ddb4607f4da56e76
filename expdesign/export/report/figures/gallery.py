"""One picture for each primitive: where it takes the ship and how the velocities go."""

from __future__ import annotations

import numpy as np

from expdesign.conventions import to_n_frame
from expdesign.dictionary.primitive import Primitive
from expdesign.dictionary.wishes import wished_motion
from expdesign.export.report.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    PRIMITIVE,
    light_grid,
    new_figure,
    svg,
)
from expdesign.values import Array

HULLS = 5
LEAST_SPAN = {"u [m/s]": 0.1, "v [m/s]": 0.1, "r [\N{DEGREE SIGN}/s]": 0.1}
"""Axes show at least this much, so that rounding errors do not look like motion."""


def primitive_figure(primitive: Primitive, hull_b: Array, *, number: int) -> str:
    """Path with hull outlines on the left; u, v and r over time on the right, dashed what the family wished for."""
    figure = new_figure(5.2, 3.3)
    left, right = figure.subfigures(1, 2, width_ratios=(1, 1.15), squeeze=False)[0]
    path = left.subplots()
    pose = primitive.trajectory.pose
    path.plot(pose[:, 1], pose[:, 0], color=PRIMITIVE, linewidth=1.6)
    for sample in np.linspace(0, len(pose) - 1, HULLS).round().astype(int):
        corners = to_n_frame(hull_b, pose[sample])
        path.fill(corners[:, 1], corners[:, 0], facecolor="none", edgecolor=GREY, linewidth=0.8)
    path.plot(pose[0, 1], pose[0, 0], "o", color=GREEN, markersize=6)
    path.set_aspect("equal", adjustable="datalim")
    path.set_xlabel("starboard [m]")
    path.set_ylabel("ahead [m]")
    path.locator_params(nbins=4)
    light_grid(path)
    time_s = primitive.trajectory.time_s
    velocity = primitive.trajectory.velocity * (1.0, 1.0, np.degrees(1.0))
    wished = wished_motion(primitive)
    shown = velocity if wished is None else wished * (1.0, 1.0, np.degrees(1.0))
    rows = right.subplots(3, 1, sharex=True)
    for axes, values, wish, (name, span) in zip(rows, velocity.T, shown.T, LEAST_SPAN.items(), strict=True):
        axes.axhline(0.0, color=BLACK, linewidth=0.5)
        if wished is not None:
            axes.plot(time_s, wish, color=GREY, linewidth=1.0, linestyle="--")
        axes.plot(time_s, values, color=BLUE, linewidth=1.4)
        axes.set_ylabel(name)
        low, high = min(values.min(), wish.min(), 0.0), max(values.max(), wish.max(), 0.0)
        slack = max(span - (high - low), 0.0) / 2 + 0.06 * (high - low)
        axes.set_ylim(low - slack, high + slack)
        axes.locator_params(axis="y", nbins=4)
        light_grid(axes)
    rows[-1].set_xlabel("time [s]")
    figure.draw_without_rendering()  # equal aspect widens the limits, and with them the labels to make room for
    return svg(figure, key=f"primitive-{number}", label=f"Path and velocities of primitive {primitive.name}")
