"""Colours, sizes and the way from a figure to a piece of a web page.

Colours: M. Okabe and K. Ito, Color Universal Design (2008), told apart by colour-blind readers.
"""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeVar

import numpy as np
from markupsafe import Markup, escape

from expdesign.export.folder import not_drawn
from expdesign.export.formats.format import xml_text
from expdesign.memory import in_order

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDE_AXIS = 10.0  # ratio of the ends of an axis above which it has fewer ticks
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
PRIMITIVE, REPOSITION = VERMILION, BLUE
LINES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
GREY = "#6b6b6b"
PIXELS_PER_INCH = 120.0
"""Figures are shown no larger than this, so that their letters keep the size of the text around them."""
LAND, WATER, FORBIDDEN = "#e9d8a6", "#e6f2fa", "#d4d4d4"

LONGEST_NAME = 32
NO_TITLES: Mapping[str, str] = {}
Drawn = TypeVar("Drawn")
Given = ParamSpec("Given")

SETTINGS: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "expdesign",
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
    "legend.frameon": False,
    "path.simplify": True,
    "text.parse_math": False,
}


@contextmanager
def report_style() -> Iterator[None]:
    """Figures of the report are drawn inside this block; settings are as before after it."""
    import matplotlib  # here and below: what only reads files does not wait for it

    with matplotlib.rc_context(SETTINGS), warnings.catch_warnings():
        # text stays text in the page, so the reader's fonts draw what matplotlib's font lacks
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


def marked(figure: str, mark: str) -> Markup:
    """An SVG element with a word across it."""
    found = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', figure)
    if found is None:  # what could not be drawn
        return Markup(figure)
    width, height = map(float, found.groups())
    size, angle = 0.9 * min(width, height) / len(mark) * 2, -math.degrees(math.atan2(height, width))
    word = (
        f'<text class="mark-across" x="{width / 2:g}" y="{height / 2:g}" font-size="{size:.0f}" text-anchor="middle" '
        f'dominant-baseline="middle" fill="{VERMILION}" fill-opacity="0.35" '
        f'transform="rotate({angle:.1f} {width / 2:g} {height / 2:g})">{escape(mark)}</text>'
    )
    return Markup(f"{figure.removesuffix('</svg>')}{word}</svg>")


def drawn(figures: Sequence[Callable[[], Drawn]]) -> list[Drawn]:
    """Results of functions that draw, in report style."""
    return list(in_order(_in_style, (), ((figure,) for figure in figures)))


def _in_style(figure: Callable[[], Drawn]) -> Drawn:
    with report_style():
        return figure()


def page_figure(draw: Callable[Given, Drawn]) -> Callable[Given, Drawn | Markup]:
    """A function that draws a figure of a page. Where it fails, the page says so in its place; see `NotDrawn`."""

    @wraps(draw)
    def drawn_or_said(*args: Given.args, **options: Given.kwargs) -> Drawn | Markup:
        try:
            return draw(*args, **options)
        except Exception as error:
            return Markup(not_drawn(f"the figure {draw.__name__.strip('_')}", error))

    return drawn_or_said


def new_figure(
    width_in: float, height_in: float, *, layout: Literal["constrained", "compressed"] | None = "constrained"
) -> Figure:
    """An empty figure that owes nothing to any window system.

    Its axes are arranged such that all labels have room: "compressed" for axes with a fixed aspect ratio, None for axes
    that are given places.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout=layout)
    FigureCanvasSVG(figure)
    return figure


def svg(figure: Figure, *, key: str, label: str, titles: Mapping[str, str] = NO_TITLES) -> Markup:
    """The figure as an SVG element for a page.

    Args:
        figure: drawn inside `report_style`.
        key: makes the ids of this figure unique in the page.
        label: what it shows, for those who cannot see it.
        titles: gid of an artist -> text that is shown while the pointer rests on it.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    target = io.StringIO()
    figure.set_facecolor("none")
    FigureCanvasSVG(figure).print_svg(target, metadata={"Date": None, "Creator": None})  # savefig would draw it twice
    text = target.getvalue()
    text = text[text.index("<svg") :].strip()
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    for gid, title in titles.items():
        text = text.replace(f'<g id="{gid}">', f'<g id="{gid}"><title>{escape(plain(title))}</title>')
    text = re.sub(r'(<[^<>]*?\sid=")', rf"\1{key}-", text)
    text = re.sub(r'(\sxlink:href="#|url\(#)', rf"\1{key}-", text)
    text = re.sub(r' d="[^"]*"', lambda found: re.sub(r"(\.\d\d)\d+", r"\1", found[0]), text)
    head, body = text.split(">", 1)
    head = re.sub(r'\s(?:width|height)="[^"]*"', "", head)
    width = figure.get_figwidth() * PIXELS_PER_INCH
    return Markup(f'{head} style="max-width: {width:.0f}px" role="img" aria-label="{escape(plain(label))}">{body}')


def plain(text: str) -> str:
    """Text on one line, with a replacement sign for each character that no SVG may hold."""
    return " ".join(xml_text(text).split())


def short(text: str) -> str:
    """A name beside an axis: on one line, and cut where it would take the figure's room."""
    line = plain(text)
    return line if len(line) <= LONGEST_NAME else f"{line[: LONGEST_NAME - 1]}\N{HORIZONTAL ELLIPSIS}"


def light_grid(axes: Axes, axis: Literal["both", "x", "y"] = "both") -> None:
    """Thin lines behind the data."""
    axes.grid(visible=True, axis=axis, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)


def round_ticks(axes: Axes) -> None:
    """Round numbers on a logarithmic x axis: fewer of them, the more decades it spans; both ends of a short one."""
    low, high = axes.get_xlim()
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    ladder: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)
    if high / low > WIDE_AXIS:
        ladder = (1.0, 2.0, 5.0) if high / low < WIDE_AXIS**3 else (1.0,)
    ticks = [step * 10.0**decade for decade in decades for step in ladder if low <= step * 10.0**decade <= high]
    if len(ticks) < 2:
        ticks = [low, high]
    axes.set_xticks(ticks, [f"{tick:.4g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_xlim(low, high)
