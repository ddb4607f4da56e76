"""Orders of a zig-zag that is switched by heading: helm, and the heading at which it ends; times are hints."""

from __future__ import annotations

import math

import numpy as np

from expdesign.dictionary.primitive import Primitive
from expdesign.export import words
from expdesign.export.report.content import ReportContent
from expdesign.values import Array
from expdesign.vessel import Vessel, stem

HEADS = ("helm", "until the heading has changed by", "about, s")
"""Heads of the columns of `heading_rows`."""
HELM_STEMS = ("rudder", "a")
SIDES = ("starboard", "port")


def heading_zigzag(content: ReportContent, name: str) -> Primitive | None:
    """The manoeuvre of this name if its helm is switched by heading."""
    named = (item.primitive for item in content.information if item.primitive.name == name)
    return next((primitive for primitive in named if primitive.family == "zigzag_heading"), None)


def heading_rows(zigzag: Primitive, vessel: Vessel, values: Array, step_s: float) -> list[tuple[str, ...]]:
    """Rows of `HEADS`, one for each order of the helm.

    Args:
        zigzag: with `helm_rad` > 0 where the first turn is to starboard, and `heading_rad`.
        vessel: whose signals they are.
        values: (k, m) commands of the run.
        step_s: between them.
    """
    helm, change = (math.degrees(zigzag.settings[key]) for key in ("helm_rad", "heading_rad"))
    ends = [*_reversals(vessel, values), len(values)]
    rows: list[tuple[str, ...]] = []
    for number, end in enumerate(ends):
        side = SIDES[(number + (helm < 0)) % 2]
        until = f"{words.significant(change)}\N{DEGREE SIGN} to {side}" if end < len(values) else "end of the run"
        order = f"{side[0].upper()}{words.NB}{words.significant(abs(helm))}"
        rows.append((order, until, f"{end * step_s:.0f}"))
    return rows


def _reversals(vessel: Vessel, values: Array) -> list[int]:
    """Samples at which the helm changes sides."""
    helms = [column for column, name in enumerate(vessel.model.inputs) if stem(name) in HELM_STEMS]
    widest = values[:, max(helms, key=lambda column: float(np.ptp(values[:, column])))]
    first = widest > (widest.max() + widest.min()) / 2
    return (np.flatnonzero(np.diff(first)) + 1).tolist()


def heading_notes(zigzag: Primitive) -> list[str]:
    """How those rows are used."""
    helm, change = (math.degrees(zigzag.settings[key]) for key in ("helm_rad", "heading_rad"))
    first, other = ("S", "P") if helm > 0 else ("P", "S")
    size, turned = words.significant(abs(helm)), f"{words.significant(change)}\N{DEGREE SIGN}"
    return [
        f"Order by heading, not by time. From the approach course order {first} {size}. When the heading has "
        f"changed by {turned} to that side, order {other} {size}. When it is {turned} to the other side of the "
        f"approach course, reverse again, and so on until the run ends. Leave the engine as it is. The times are those "
        f"of the model. S turns to starboard, P to port.",
    ]
