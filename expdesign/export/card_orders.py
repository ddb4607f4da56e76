"""Orders for a helmsman: commands reduced to few samples with linear changes, and zig-zags switched by heading."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

from expdesign.conventions import to_n_frame
from expdesign.dictionary.spec import Primitive
from expdesign.errors import ExpdesignError
from expdesign.export import words
from expdesign.export.report.content import ReportContent, Run
from expdesign.export.words import NB
from expdesign.plan.values import Leg
from expdesign.simulation import steady_ahead
from expdesign.values import Array
from expdesign.vessel import Vessel, stem
from expdesign.vessel.vessel import swept_area

# largest error of the condensed orders, as a share of the range of each signal; larger at `MOST_ORDER_ROWS`
ORDER_TOLERANCE = 0.02
MOST_ORDER_ROWS = 48  # rows of orders on one sheet
CALLED_ORDER_S = 10.0  # mean time between orders below which they are too fast to be called out [s]
FARTHEST_DANGER_M = 5000.0  # distance up to which the nearest danger is stated [m]
HEADS = ("helm", "until the heading has changed by", "about, s")  # heads of the columns of `heading_rows`
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
        values: (k, m) commands of the run.
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
    """Samples at which the helm changes sides; without one, the propeller that changes most."""
    inputs = vessel.model.inputs
    helms = [column for column, name in enumerate(inputs) if stem(name) in HELM_STEMS] or list(range(len(inputs)))
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


UNITS = {"n": ("rpm", 60.0), "a": ("deg", 180.0 / math.pi), "rudder": ("deg", 180.0 / math.pi)}


def condensed(values: Array) -> tuple[list[int], float]:
    """Samples of (k, m) commands to be called out, and the largest error of linear interpolation between them.

    Returns:
        Indices, the first and the last sample among them; the error as a share of the range of each signal.

    Source: D. H. Douglas and T. K. Peucker (1973), on all signals together.
    """
    span = np.ptp(values, axis=0)
    scaled = (values - values.min(axis=0)) / np.where(span > 1e-9, span, np.inf)
    kept = [0, len(values) - 1] if len(values) > 1 else [0]
    while len(kept) < min(MOST_ORDER_ROWS, len(values)):
        worst, place = _worst(scaled, kept)
        if worst <= ORDER_TOLERANCE:
            break
        kept = sorted({*kept, place})
    return kept, _worst(scaled, kept)[0] if len(kept) < len(values) else 0.0


def _worst(values: Array, kept: list[int]) -> tuple[float, int]:
    samples = np.arange(len(values))
    lines = np.stack([np.interp(samples, kept, column[kept]) for column in values.T], axis=1)
    missed = np.abs(values - lines).max(axis=1)
    return float(missed.max()), int(missed.argmax())


def order_columns(vessel: Vessel) -> list[tuple[str, str, float]]:
    """(signal, unit shown, factor to it) in command order: rpm and degrees; forces in the model's own unit."""
    return [(name, *UNITS.get(stem(name), ("", 1.0))) for name in vessel.model.inputs]


def order_rows(vessel: Vessel, values: Array, step_s: float) -> tuple[list[tuple[str, ...]], float]:
    """Time from the start of the run [s] and every signal, row by row; and the largest error as a share of its range.

    Args:
        values: (k, m) commands of a run.
    """
    kept, missed = condensed(values)
    columns, side = order_columns(vessel), starboard_helm(vessel)
    factors = np.array([factor for *_, factor in columns])
    rows = []
    for index in kept:
        shown = zip(columns, (values[index] * factors).tolist(), strict=True)
        cells = (
            _helm(value * side) if side and stem(name) == "rudder" else _figure(value) for (name, *_), value in shown
        )
        rows.append((f"{index * step_s:.4g}", *cells))
    return rows, missed


def starboard_helm(vessel: Vessel) -> int:
    """Sign of the rudder angle that turns the ship to starboard; 0 where its model does not say."""
    if not any(stem(name) == "rudder" for name in vessel.model.inputs):
        return 0
    try:
        return steady_ahead(vessel).starboard
    except ExpdesignError:
        return 0


def _helm(angle_deg: float) -> str:
    """A helm order: S 10, P 20, or 0 amidships."""
    figure = _figure(abs(angle_deg))
    return figure if figure == "0" else f"{'S' if angle_deg > 0 else 'P'}{NB}{figure}"


def _figure(value: float) -> str:
    text = f"{value:.0f}" if abs(value) >= 20 else f"{value:.1f}"
    return "0" if float(text) == 0 else text.replace("-", "\N{MINUS SIGN}")


LONG, WIDE = 12, 5
"""Number of rows above which the orders use several columns, and cells per row up to which there are three."""
TURN = 2 * math.pi


def run_orders(content: ReportContent, run: Run) -> Array:
    """(k, m) commands of a run; angles of thrusters start between -180 and 180 degrees."""
    leg, commands = content.plan.legs[run.leg], content.plan.commands
    values = np.array(commands.values[leg.first : leg.last])
    for column, name in enumerate(commands.names):
        if stem(name) == "a":
            values[:, column] -= TURN * np.round(values[0, column] / TURN)
    return values


def columns_of(rows: list[tuple[str, ...]]) -> list[list[tuple[str, ...]]]:
    """Rows in one column, or in two or three beside each other where they are many and narrow."""
    count = 1 if len(rows) <= LONG else 3 if len(rows[0]) <= WIDE and len(rows) > 2 * LONG else 2
    length = math.ceil(len(rows) / count)
    return [rows[start : start + length] for start in range(0, len(rows), length)]


def orders_notes(content: ReportContent, leg: Leg, rows: list[tuple[str, ...]], missed: float) -> list[str]:
    """How the rows of orders of a leg are to be used; `missed` is their largest error as a share of the range."""
    if zigzag := heading_zigzag(content, leg.name):
        return heading_notes(zigzag)
    step = content.plan.commands.sample_time_s
    every = (leg.last - leg.first) * step / len(rows)
    side = starboard_helm(content.vessel)
    known = SIGNS | ({"rudder": "rudder: S turns to starboard, P to port, 0 amidships."} if side else {})
    signs = [meaning for what, meaning in known.items() if any(stem(n) == what for n in content.vessel.model.inputs)]
    notes = [
        "Between the rows all orders change evenly. They differ from commands.csv (one command every "
        f"{step:g} s) by at most {100 * missed:.0f} % of the range of each order. {' '.join(signs)}".rstrip(),
    ]
    if every < CALLED_ORDER_S:
        notes.append(
            f"One order every {every:.2g} s is too fast to be called out. Let the control system execute "
            "commands.csv, and use these rows to monitor it."
        )
    return notes


SIGNS = {
    "n": "n: propeller speed, ahead positive.",
    "a": "a: direction of thrust, 0 ahead, 90 to starboard.",
    "rudder": "rudder: 0 amidships; sign as in the vessel file.",
}
"""Stem of a signal -> meaning of its sign."""
DIRECTIONS = {"ahead": 0.0, "starboard": np.pi / 2, "port": -np.pi / 2}


@dataclass(frozen=True, kw_only=True)
class Danger:
    """Least distances over a run."""

    # ahead_m, port_m, starboard_m: from the hull along straight lines to forbidden water, at most
    # `FARTHEST_DANGER_M` [m]
    ahead_m: float
    port_m: float
    starboard_m: float
    nearest_m: float  # from the hull in any direction [m]
    nearest_sample: int  # when
    room_m: tuple[float, float]  # (length, width) of the smallest rectangle around the swept area of the hull [m]


def look_out(pose: Array, *, hull_b: Array, water: shapely.MultiPolygon) -> Danger:
    """Look from every pose (k, 3) of a run."""
    forbidden = water.boundary
    half_length, half_beam = hull_b.max(axis=0)
    starts = {"ahead": (half_length, 0.0), "starboard": (0.0, half_beam), "port": (0.0, -half_beam)}
    seen = {name: _ray(pose, np.array(starts[name]), turn, forbidden) for name, turn in DIRECTIONS.items()}
    hulls = shapely.polygons([to_n_frame(hull_b, one)[:, ::-1] for one in pose])
    near = shapely.distance(forbidden, hulls)
    box = shapely.minimum_rotated_rectangle(swept_area(pose, hull_b))
    sides = np.hypot(*np.diff(np.array(box.exterior.coords)[:3], axis=0).T)
    return Danger(
        ahead_m=seen["ahead"],
        port_m=seen["port"],
        starboard_m=seen["starboard"],
        nearest_m=float(near.min()),
        nearest_sample=int(near.argmin()),
        room_m=(float(sides.max()), float(sides.min())),
    )


def _ray(pose: Array, start_b: Array, turn_rad: float, forbidden: shapely.Geometry) -> float:
    """Least distance along the lines of sight [m]."""
    begin = np.array([to_n_frame(start_b, one) for one in pose])
    bearing = pose[:, 2] + turn_rad
    end = begin + FARTHEST_DANGER_M * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    rays = shapely.linestrings(np.stack([begin[:, ::-1], end[:, ::-1]], axis=1))
    hits = shapely.intersection(rays, forbidden)
    away = shapely.distance(hits, shapely.points(begin[:, ::-1]))
    return float(np.min(np.where(np.isnan(away), FARTHEST_DANGER_M, away)))
