"""The content of one card: a sheet for consecutive runs of one manoeuvre."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from expdesign.conventions import to_n_frame
from expdesign.export import words
from expdesign.export.card_orders import (
    HEADS,
    Danger,
    columns_of,
    heading_rows,
    heading_zigzag,
    look_out,
    order_columns,
    order_rows,
    orders_notes,
    run_orders,
)
from expdesign.export.pages import page_template
from expdesign.export.pages.figures import BLACK, GREEN, PRIMITIVE, REPOSITION, drawn, page_figure, svg
from expdesign.export.report import tables
from expdesign.export.report.chart import (
    chart,
    chart_legend,
    draw_position_ticks,
    draw_scale_and_north,
    place_labels,
    sea_figure,
)
from expdesign.export.report.checks import day_sentence, day_words, procedure_sentences
from expdesign.export.report.content import ReportContent, Run, primitive_runs, relative_information
from expdesign.export.report.tables import settings_sentence
from expdesign.export.routes import require_verified
from expdesign.plan.values import Leg, Plan
from expdesign.values import Array
from expdesign.vessel import column_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
from expdesign.export.card_orders import FARTHEST_DANGER_M

RUNS_PER_SHEET = 3  # runs on one sheet
NAMED_PARAMETERS = 4  # parameters named in the purpose of a run
WIDTH_IN = 3.6


@page_figure
def run_chart(content: ReportContent, legs: Sequence[Leg], *, numbers: Sequence[int]) -> str:
    """Runs that share a sheet, as SVG; where there are several, each has its number."""
    plan, pose = content.plan, content.plan.trajectory.pose
    tracks = [pose[leg.first : leg.last + 1, 1::-1] for leg in legs]
    places = np.vstack(tracks)
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    half = max(float(np.ptp(places, axis=0).max()) * 0.75, 3 * content.vessel.length_m, 4 * content.clearance_m)
    box = (*(middle - half), *(middle + half))
    figure, axes = sea_figure(plan.area, box, WIDTH_IN, clearance_m=content.clearance_m, vessel=content.vessel)
    for leg, track in zip(legs, tracks, strict=True):
        lead = pose[max(leg.first - (leg.last - leg.first), 0) : leg.first + 1]
        axes.plot(lead[:, 1], lead[:, 0], color=REPOSITION, linewidth=1.2)
        axes.plot(track[:, 0], track[:, 1], color=PRIMITIVE, linewidth=2.2)
        for sample, colour in ((leg.last, "white"), ((leg.first + leg.last) // 2, "white"), (leg.first, GREEN)):
            hull = to_n_frame(content.vessel.hull_b, pose[sample])
            axes.fill(hull[:, 1], hull[:, 0], facecolor=colour, edgecolor=BLACK, linewidth=0.8, zorder=4)
    if len(legs) > 1:
        _number(axes, np.array([track[0] for track in tracks]), places, numbers, size=0.16 * half)
    draw_position_ticks(axes, plan.area.frame, box, most_lon=2)
    draw_scale_and_north(axes, box)
    label = f"Chart of run {', '.join(map(str, numbers))}, {content.shown(legs[0].name)}"
    return svg(figure, key=f"card-{numbers[0]}", label=label)


def _number(axes: Axes, starts: Array, track: Array, numbers: Sequence[int], *, size: float) -> None:
    places = place_labels(starts, track, size=size, bounds=(axes.get_xlim(), axes.get_ylim()))
    for number, anchor, place in zip(numbers, starts, places, strict=True):
        axes.plot(*zip(anchor, place, strict=True), color=PRIMITIVE, linewidth=0.7, zorder=5)
        axes.text(
            place[0], place[1], str(number), ha="center", va="center", fontsize=9, fontweight="bold", zorder=6,
            bbox={"boxstyle": "circle,pad=0.2", "facecolor": "white", "edgecolor": PRIMITIVE, "linewidth": 1.2},
        )  # fmt: skip


STEADY_HEADING_RAD = math.radians(3.0)
STEADY_SPEED_SHARE, STEADY_SPEED_MPS = 0.1, 0.1
BLANKS = ("Start (UTC)", "Wind, from", "Sea state; current, to", "Depth", "File")  # blanks to be filled in at every run


@dataclass(frozen=True, kw_only=True)
class Card:
    """A sheet: consecutive runs of one manoeuvre, as printable text and figures."""

    runs: tuple[int, ...]  # numbers of the runs
    name: str
    chart: str
    what: str
    purpose: str
    # approach, danger, end: (name, one text for each run) row by row
    approach: list[tuple[str, tuple[str, ...]]]
    danger: list[tuple[str, tuple[str, ...]]]
    end: list[tuple[str, tuple[str, ...]]]
    heads: tuple[str, ...]  # of the columns of orders
    orders: list[list[tuple[str, ...]]]  # the rows of orders, in one or several columns
    orders_notes: list[str]
    room: list[tuple[str, str]]  # (name, text) pairs
    record: str

    @property
    def title(self) -> str:
        """Run 3, Runs 4 and 5, or Runs 6 to 8."""
        first, last = self.runs[0], self.runs[-1]
        if first == last:
            return f"Run {first}"
        return f"Runs {first} {'and' if last == first + 1 else 'to'} {last}"


def card_groups(content: ReportContent, runs: Sequence[Run]) -> list[list[Run]]:
    """Runs sheet by sheet, in time order: neighbours with equal names and orders share one."""
    groups: list[list[Run]] = []
    for run in runs:
        if groups and _alike(content, groups[-1][-1], run):
            groups[-1].append(run)
        else:
            groups.append([run])
    return [
        [group[index] for index in part]
        for group in groups
        for part in np.array_split(np.arange(len(group)), math.ceil(len(group) / RUNS_PER_SHEET))
    ]


def _alike(content: ReportContent, one: Run, other: Run) -> bool:
    a, b = (content.plan.legs[run.leg] for run in (one, other))
    first, second = (run_orders(content, run) for run in (one, other))
    return a.name == b.name and first.shape == second.shape and bool(np.allclose(first, second, rtol=0, atol=1e-6))


def build_card(content: ReportContent, runs: Sequence[Run]) -> Card:
    """The card of runs that share a sheet."""
    plan, vessel = content.plan, content.vessel
    legs = [plan.legs[run.leg] for run in runs]
    names = [item.primitive.name for item in content.information]
    item = content.information[names.index(legs[0].name)]
    poses = [plan.trajectory.pose[leg.first : leg.last + 1] for leg in legs]
    dangers = [look_out(pose, hull_b=vessel.hull_b, water=plan.area.water) for pose in poses]
    step = plan.commands.sample_time_s
    lasts = words.duration((legs[0].last - legs[0].first) * step)
    heads, rows, missed = _orders(content, runs[0])
    return Card(
        runs=tuple(run.number for run in runs),
        name=content.shown(legs[0].name),
        chart=run_chart(content, legs, numbers=[run.number for run in runs]),
        what=f"{words.family(item.primitive.family)} of {lasts}; {settings_sentence(item)}",
        purpose=_purpose(content, names.index(legs[0].name)),
        approach=_together([_approach(content, leg.first) for leg in legs]),
        danger=_together([_danger(danger, leg.first, step) for danger, leg in zip(dangers, legs, strict=True)]),
        end=_together([_end(content, leg.first, leg.last) for leg in legs]),
        heads=heads,
        orders=columns_of(rows),
        orders_notes=orders_notes(content, legs[0], rows, missed),
        room=_room(content, max((danger.room_m for danger in dangers), key=math.prod)),
        record=_record(content),
    )


def _orders(content: ReportContent, run: Run) -> tuple[tuple[str, ...], list[tuple[str, ...]], float]:
    """Heads and rows of the orders, and the largest error between rows; by heading where the helm goes by it."""
    vessel, values, step = content.vessel, run_orders(content, run), content.plan.commands.sample_time_s
    if zigzag := heading_zigzag(content, content.plan.legs[run.leg].name):
        return HEADS, heading_rows(zigzag, vessel, values, step), 0.0
    signals = (f"{name}, {unit}" if unit else name for name, unit, _ in order_columns(vessel))
    return ("time, s", *signals), *order_rows(vessel, values, step)


def _together(runs: list[list[tuple[str, str]]]) -> list[tuple[str, tuple[str, ...]]]:
    """Rows with the same name of several runs as one row with a cell for each."""
    return [(rows[0][0], tuple(text for _, text in rows)) for rows in zip(*runs, strict=True)]


def _purpose(content: ReportContent, index: int) -> str:
    share = relative_information(content)[index]
    order = np.argsort(-share, kind="stable")[:NAMED_PARAMETERS]
    named = [f"{content.parameters[k]} ({words.percent(float(share[k]))})" for k in order.tolist() if share[k] > 0]
    listed = ", ".join(named)
    return f"{listed}: information in per cent of the most informative manoeuvre for each" if named else "none"


def _approach(content: ReportContent, first: int) -> list[tuple[str, str]]:
    plan = content.plan
    pose, velocity = plan.trajectory.pose[first], plan.trajectory.velocity[first]
    lat, lon = plan.area.frame.to_degrees(pose[:2]).tolist()
    sway, rate = words.speed(float(velocity[1])), words.number(math.degrees(velocity[2]), 1)
    return [
        ("Start time", words.clock(first * plan.commands.sample_time_s)),
        ("Latitude", words.latitude(lat)),
        ("Longitude", words.longitude(lon)),
        ("Heading", words.bearing(float(pose[2]))),
        ("Speed over ground", words.speed(float(np.hypot(*velocity[:2])))),
        ("Sway; yaw rate", f"{sway}; {rate}{words.NB}\N{DEGREE SIGN}/s"),
        ("Steady for", words.duration(steady_s(content, first))),
        *_within(plan, first),
    ]


def _within(plan: Plan, first: int) -> list[tuple[str, str]]:
    """Start tolerances of the run that begins at a sample; none without Monte Carlo trials."""
    risk = plan.risk
    if risk is None:
        return []
    begun = next(item for leg, item in zip(plan.legs, risk.legs, strict=True) if leg.first == first)
    heading, rate = (words.significant(math.degrees(value), 2) for value in (risk.heading_rad, risk.yaw_rate_radps))
    return [
        (
            "Start tolerance",
            f"{words.distance(begun.position_m)}; {heading}\N{DEGREE SIGN}; "
            f"{words.speed(begun.speed_mps)}; {rate}{words.NB}\N{DEGREE SIGN}/s; else go-around",
        )
    ]


def steady_s(content: ReportContent, first: int) -> float:
    """How long the planned heading and speed are constant before a sample [s]."""
    motion = content.plan.trajectory
    speed = np.hypot(*motion.velocity[: first + 1, :2].T)
    close = np.abs(motion.pose[: first + 1, 2] - motion.pose[first, 2]) < STEADY_HEADING_RAD
    close &= np.abs(speed - speed[first]) < max(STEADY_SPEED_SHARE * speed[first], STEADY_SPEED_MPS)
    away = np.flatnonzero(~close)
    return float(first - (away[-1] + 1 if len(away) else 0)) * motion.sample_time_s


def _end(content: ReportContent, first: int, last: int) -> list[tuple[str, str]]:
    plan = content.plan
    pose, step = plan.trajectory.pose, plan.commands.sample_time_s
    turned = math.degrees(float(pose[last, 2] - pose[first, 2]))
    side = "starboard" if turned > 0 else "port"
    way = f" ({abs(turned):.0f}\N{DEGREE SIGN} to {side})" if round(abs(turned)) else ""
    return [
        ("End time", words.clock(last * step)),
        ("Final heading", f"{words.bearing(float(pose[last, 2]))}{way}"),
    ]


def _danger(danger: Danger, first: int, step: float) -> list[tuple[str, str]]:
    when = words.clock((first + danger.nearest_sample) * step)
    return [
        ("Ahead", _reach(danger.ahead_m)),
        ("To port", _reach(danger.port_m)),
        ("To starboard", _reach(danger.starboard_m)),
        ("Least distance", f"{words.distance(danger.nearest_m)} at {when}"),
        ("Abort if off track by", words.distance(danger.nearest_m / 2)),
    ]


def _reach(distance_m: float) -> str:
    return (
        f"over {words.distance(FARTHEST_DANGER_M)}" if distance_m >= FARTHEST_DANGER_M else words.distance(distance_m)
    )


def _room(content: ReportContent, room_m: tuple[float, float]) -> list[tuple[str, str]]:
    draught = content.vessel.draught_m
    return [
        ("Swept area", " by ".join(words.distance(side) for side in room_m)),
        ("With clearance", " by ".join(words.distance(side + 2 * content.clearance_m) for side in room_m)),
        (
            "Depth",
            f"more than {4 * draught:g} m (4 draughts) for deep-water results. {content.plan.area.depth_rule}",
        ),
    ]


def _record(content: ReportContent) -> str:
    step = content.plan.commands.sample_time_s
    inputs = ", ".join(column_name(name) for name in content.vessel.model.inputs)
    return (
        f"every {step:g} s, with a common clock: time_s, lat_deg, lon_deg, heading_deg, u_mps, v_mps, r_radps, "
        f"{inputs}, wind_speed_mps, wind_angle_rad; from 30 s before the run to 30 s after it"
    )


def cards_html(content: ReportContent) -> str:
    """One HTML page without outside references; consecutive runs of one manoeuvre share a sheet.

    Raises:
        NoPlan: the plan is not verified and must not be sailed.
    """
    require_verified(content.plan)
    runs = primitive_runs(content.plan)
    cards = drawn([partial(build_card, content, group) for group in card_groups(content, runs)])
    overview = drawn([partial(chart, content)])[0]
    page = page_template("cards.html")
    return page.render(
        content=content,
        cards=cards,
        runs=len(runs),
        blanks=BLANKS,
        depths=bool(content.plan.area.depths),
        chart=overview,
        legend=chart_legend(content),
        agenda=tables.agenda(content),
        procedure=procedure_sentences(content.plan),
        day=day_sentence(content.plan),
        total=day_words(content.plan.day),
        current=words.current(content.environment.current_to, content.environment.current_std_mps),
        wind=words.wind(content.environment.wind_to, content.environment.wind_std_mps),
        clearance=words.distance(content.clearance_m),
    )
