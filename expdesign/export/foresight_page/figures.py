"""Power of every cause at its least visible."""

from __future__ import annotations

import numpy as np

from expdesign.export.pages.figures import BLUE, GREY, VERMILION, light_grid, new_figure, plain, svg
from expdesign.foresight import Foreseen, Foresight


def power_figure(found: Foresight) -> str:
    """Probability that the test accepts each cause, that held-out runs show it too, and that it is named first."""
    items = [item for item in found.weakest if item.sized]
    figure = new_figure(6.8, 1.1 + 0.26 * len(items))
    axes = figure.subplots()
    rows = np.arange(len(items))
    axes.barh(
        rows, [100 * item.power for item in items], height=0.6, color=BLUE, alpha=0.35, label="accepted by its test"
    )
    axes.barh(rows, [100 * item.found for item in items], height=0.3, color=BLUE, label="found")
    axes.plot([100 * item.named for item in items], rows, "D", color=VERMILION, markersize=5, label="found and first")
    axes.axvline(100 * found.wanted_power, color=GREY, linewidth=0.9, linestyle="--")
    axes.set_yticks(rows, [plain(_name(item)) for item in items])
    axes.invert_yaxis()
    axes.set_xlim(0, 101)
    axes.set_xlabel("probability [%]")
    axes.legend(loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=3, fontsize=9)
    light_grid(axes, "x")
    return svg(figure, key="power", label="Probability that a diagnosis finds each cause, and that it names it first")


def _name(item: Foreseen) -> str:
    return item.cause if item.cause.endswith(f":{item.name}") else f"{item.cause}: {item.name}"
