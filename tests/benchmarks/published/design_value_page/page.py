"""Errors of every simulated trial, one panel for each design, and the tables of the study."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from expdesign.export.pages import page_template
from expdesign.export.pages.figures import (
    BLUE,
    LINES,
    VERMILION,
    light_grid,
    new_figure,
    plain,
    report_style,
    svg,
)
from expdesign.values import Array, seal

CUT_PARAMETER, CUT_NORM, CUT_DOF = 5.0, 0.5, (1.0, 0.25, 0.15)
"""Larger errors are drawn as these, as in the source's figures."""
DOF = ("surge [m/s]", "sway [m/s]", "yaw rate [rad/s]")


@dataclass(frozen=True, kw_only=True, eq=False)
class DesignErrors:
    """Errors of the simulated trials of one design.

    Attributes:
        name: of the design.
        parameters: (n,) root mean square of (estimate - truth) / |truth|; inf without an estimate.
        outputs: (n, 3) root mean square of simulated less true u [m/s], v [m/s], r [rad/s] on unseen input; inf where
            the simulation diverges.
        spread: (p,) median of |estimate - truth| / |truth| of each parameter.
    """

    name: str
    parameters: Array
    outputs: Array
    spread: Array

    def __post_init__(self) -> None:
        seal(self, parameters="n", outputs="n 3", spread="p")

    @property
    def norm(self) -> Array:
        """(n,) norm of `outputs`."""
        return np.asarray(np.linalg.norm(self.outputs, axis=1))


@dataclass(frozen=True, kw_only=True)
class StudyTable:
    """A table of the study.

    Attributes:
        title: what it shows.
        header: names of the columns.
        rows: as many cells each.
        note: what to know about it.
        text_columns: how many columns to the left hold words; the others hold numbers.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    text_columns: int = 1


def design_value_html(
    designs: Sequence[DesignErrors], tables: Sequence[StudyTable], *, limits: tuple[float, float], command: str
) -> str:
    """One HTML page without any outside reference.

    Args:
        designs: errors to draw.
        tables: to show above the figures.
        limits: of the parameter error and of the norm of the simulation errors, drawn as lines.
        command: to reproduce it.
    """
    with report_style():
        figures = {
            "parameters": _stems(
                designs, [item.parameters for item in designs], CUT_PARAMETER, limits[0], "parameters"
            ),
            "outputs": _shares(designs),
            "norm": _stems(designs, [item.norm for item in designs], CUT_NORM, limits[1], "norm"),
        }
    return page_template("design_value.html", package="design_value_page").render(
        trials=len(designs[0].parameters),
        tables=tables,
        figures=figures,
        cuts=(CUT_PARAMETER, CUT_NORM, CUT_DOF),
        command=command,
    )


def _stems(designs: Sequence[DesignErrors], values: Sequence[Array], cut: float, limit: float, key: str) -> Markup:
    """One panel for each design: the error of every trial in its order."""
    figure = new_figure(8.0, 0.5 + 1.25 * len(designs))
    panels = np.atleast_1d(figure.subplots(len(designs), 1, sharex=True, sharey=True))
    for axes, item, errors in zip(panels, designs, values, strict=True):
        _stem_panel(axes, plain(item.name), np.minimum(errors, cut), limit)
        axes.set_ylim(0, cut)
    panels[-1].set_xlabel("trial")
    return svg(figure, key=key, label=f"Error of every trial, by design: {key}")


def _stem_panel(axes: Axes, name: str, errors: Array, limit: float) -> None:
    axes.vlines(np.arange(1, len(errors) + 1), 0, errors, color=BLUE, linewidth=0.7)
    axes.axhline(limit, color=VERMILION, linewidth=1.0, linestyle="--")
    axes.set_title(f"{name}: {100 * (errors < limit).mean():.1f} % below {limit:g}", loc="left")
    axes.set_xlim(0, len(errors) + 1)
    light_grid(axes, "y")


def _shares(designs: Sequence[DesignErrors]) -> Markup:
    """Share of trials below each simulation error, a panel for each degree of freedom."""
    figure = new_figure(8.0, 3.0)
    panels = figure.subplots(1, 3, sharey=True)
    for index, (axes, cut) in enumerate(zip(panels, CUT_DOF, strict=True)):
        for item, colour in zip(designs, LINES, strict=False):
            errors = np.sort(np.minimum(item.outputs[:, index], cut))
            axes.step(
                np.r_[0.0, errors],
                100 * np.arange(len(errors) + 1) / len(errors),
                where="post",
                color=colour,
                label=plain(item.name),
            )
        axes.set_xlim(0, cut)
        axes.set_ylim(0, 101)
        axes.set_xlabel(DOF[index])
        light_grid(axes)
    panels[0].set_ylabel("trials below [%]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(designs))
    return svg(figure, key="outputs", label="Share of trials below each simulation error, by degree of freedom")
