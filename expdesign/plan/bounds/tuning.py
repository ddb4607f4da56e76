"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Bounds on repositioning time.

    Attributes:
        quad_segments: chords to a quarter circle round grown water.
        wind_headings: at which runs are simulated where wind makes a difference.
        wind_margin: factor for what headings in between may give more.
        cell_hulls: edge of the first cells of branch and bound, in hull lengths.
        cell_headings: of them to a full turn.
        levels, extra_levels: refinement levels, and extra levels for the most promising cells.
        cells, pairs, lookups: limits of branch and bound: cells of a level, their pairs with corners, and cells whose
            times are looked up for all runs together.
        worthwhile: share of the path that must be gainable over the known bound.
        enough: gain that need not be improved on, in sizes of the cells after `levels`.
        candidates: cells among which the largest real gain is looked for.
        track_samples: samples of a run at which its hull needs room.
        sides: of the polygon that contains a track.
        sides_margin: no corner of such a polygon is farther away than its farthest side by more.
        lookup_chunk: points looked up at a time.
        order_states: combinations of remaining runs up to which all orders are enumerated.
    """

    quad_segments: int = 32
    wind_headings: int = 72
    wind_margin: float = 1.02
    cell_hulls: float = 16 / 15
    cell_headings: int = 32
    levels: int = 3
    extra_levels: int = 3
    cells: int = 300_000
    pairs: int = 20_000_000
    lookups: int = 400_000
    worthwhile: float = 0.005
    enough: float = 0.3
    candidates: int = 4000
    track_samples: int = 13
    sides: int = 24
    sides_margin: float = 1.01
    lookup_chunk: int = 1_000
    order_states: int = 20_000


BOUNDS = Tuning()
