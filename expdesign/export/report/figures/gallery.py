"""One figure for each primitive: its path and its velocities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from expdesign.conventions import to_n_frame
from expdesign.dictionary.desired import desired_motion
from expdesign.dictionary.primitive import Primitive
from expdesign.export.pages.figures import BLACK, BLUE, GREEN, GREY, PRIMITIVE, light_grid, new_figure, page_figure, svg
from expdesign.export.tuning import TUNING
from expdesign.values import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEAST_SPAN = {"u [m/s]": 0.2, "v [m/s]": 0.2, "r [\N{DEGREE SIGN}/s]": 0.2}
"""Axes show at least this much, so that rounding errors do not look like motion."""


SIZE_IN = (5.2, 3.3)
PATH_BOX = (0.125, 0.15, 0.335, 0.82)
"""Place of the path's axes: left, bottom, width, height, as shares of the figure."""
CURVE_BOXES = tuple((0.655, bottom, 0.33, 0.235) for bottom in (0.735, 0.4425, 0.15))


@page_figure
def primitive_figure(primitive: Primitive, hull_b: Array, *, number: int) -> str:
    """Path with hull outlines on the left; u, v and r over time on the right, dashed the desired velocities."""
    figure = new_figure(*SIZE_IN, arranged=False)  # fixed places: many small figures are drawn much sooner
    _draw_path(figure.add_axes(PATH_BOX), primitive.trajectory.pose, hull_b)
    time_s = primitive.trajectory.time_s
    velocity = primitive.trajectory.velocity * (1.0, 1.0, np.degrees(1.0))
    desired = desired_motion(primitive)
    shown = velocity if desired is None else desired * (1.0, 1.0, np.degrees(1.0))
    rows = [figure.add_axes(box) for box in CURVE_BOXES]
    for axes, values, aim, (name, span) in zip(rows, velocity.T, shown.T, LEAST_SPAN.items(), strict=True):
        axes.axhline(0.0, color=BLACK, linewidth=0.5)
        if desired is not None:
            axes.plot(time_s, aim, color=GREY, linewidth=1.0, linestyle="--")
        axes.plot(time_s, values, color=BLUE, linewidth=1.4)
        axes.set_ylabel(name)
        axes.yaxis.set_label_coords(-0.37, 0.5)
        axes.tick_params(labelsize=9, labelbottom=axes is rows[-1])
        low, high = min(values.min(), aim.min(), 0.0), max(values.max(), aim.max(), 0.0)
        slack = max(span - (high - low), 0.0) / 2 + 0.06 * (high - low)
        axes.set_ylim(low - slack, high + slack)
        axes.locator_params(nbins=4)
        light_grid(axes)
    rows[-1].set_xlabel("time [s]")
    return svg(figure, key=f"primitive-{number}", label=f"Path and velocities of primitive {primitive.name}")


def _draw_path(axes: Axes, pose: Array, hull_b: Array) -> None:
    axes.plot(pose[:, 1], pose[:, 0], color=PRIMITIVE, linewidth=1.6)
    samples = np.linspace(0, len(pose) - 1, TUNING.hulls).round().astype(int)
    hulls = [to_n_frame(hull_b, pose[sample]) for sample in samples]
    for corners in hulls:
        axes.fill(corners[:, 1], corners[:, 0], facecolor="none", edgecolor=GREY, linewidth=0.8)
    axes.plot(pose[0, 1], pose[0, 0], "o", color=GREEN, markersize=6)
    places = np.vstack([*hulls, pose[:, :2]])
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    inches = np.array([PATH_BOX[3] * SIZE_IN[1], PATH_BOX[2] * SIZE_IN[0]])
    half = inches * float((np.ptp(places, axis=0) / inches).max()) * 0.54  # metres alike on both axes, with a margin
    axes.set_ylim(middle[0] - half[0], middle[0] + half[0])
    axes.set_xlim(middle[1] - half[1], middle[1] + half[1])
    axes.set_xlabel("starboard [m]")
    axes.set_ylabel("ahead [m]")
    axes.yaxis.set_label_coords(-0.27, 0.5)
    axes.tick_params(labelsize=9)
    axes.locator_params(nbins=4)
    light_grid(axes)
