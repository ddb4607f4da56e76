"""What stands on one card."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from expdesign.export.cards.chart import run_chart
from expdesign.export.cards.danger import FARTHEST_M, Danger, look_out
from expdesign.export.cards.orders import order_columns, order_rows
from expdesign.export.report import words
from expdesign.export.report.content import ReportContent, Run, relative_information
from expdesign.export.report.tables import settings_sentence
from expdesign.vessel import column_name

STEADY_HEADING_RAD = math.radians(3.0)
STEADY_SPEED_SHARE, STEADY_SPEED_MPS = 0.1, 0.1
LONG, WIDE = 12, 6
"""Rows and columns of orders that fit one beside another."""
TOLD = 4
"""Parameters named as what a run is for."""


@dataclass(frozen=True, kw_only=True)
class Card:
    """One run, in words and figures ready to be printed; `rows` are (name, text) pairs."""

    number: int
    name: str
    chart: str
    what: str
    purpose: str
    approach: list[tuple[str, str]]
    signals: list[tuple[str, str]]
    orders: list[list[tuple[str, ...]]]
    orders_note: str
    stop: str
    abort: list[tuple[str, str]]
    abort_off: str
    room: list[tuple[str, str]]
    record: str


def build_card(content: ReportContent, run: Run) -> Card:
    """The card of one run."""
    plan, leg = content.plan, content.plan.legs[run.leg]
    names = [item.primitive.name for item in content.information]
    item = content.information[names.index(leg.name)]
    rows, missed = order_rows(content.vessel, plan.commands, leg.first, leg.last)
    pose = plan.trajectory.pose[leg.first : leg.last + 1]
    danger = look_out(pose, hull_b=content.vessel.hull_b, water=plan.area.water)
    step = plan.commands.sample_time_s
    return Card(
        number=run.number,
        name=leg.name,
        chart=run_chart(content, leg, number=run.number),
        what=f"{item.primitive.family.replace('_', ' ')}; {settings_sentence(item)}",
        purpose=_purpose(content, names.index(leg.name)),
        approach=_approach(content, leg.first),
        signals=[(name, unit) for name, unit, _ in order_columns(content.vessel)],
        orders=_columns(rows),
        orders_note=(
            f"Between the rows all orders change evenly; the full commands every {step:g} s are in commands.csv, and "
            f"these rows differ from them by {100 * missed:.0f} % of each order's span at most."
        ),
        stop=_stop(content, leg.first, leg.last),
        abort=_abort(danger, step),
        abort_off=words.distance(danger.nearest_m / 2),
        room=_room(content, danger),
        record=_record(content),
    )


def _columns(rows: list[tuple[str, ...]]) -> list[list[tuple[str, ...]]]:
    """Rows in one column, or in two beside each other where they are many and narrow."""
    if len(rows) <= LONG or len(rows[0]) > WIDE:
        return [rows]
    half = (len(rows) + 1) // 2
    return [rows[:half], rows[half:]]


def _purpose(content: ReportContent, index: int) -> str:
    share = relative_information(content)[index]
    order = np.argsort(-share, kind="stable")[:TOLD]
    told = [f"{content.parameters[k]} ({words.percent(float(share[k]))})" for k in order.tolist() if share[k] > 0]
    return f"tells most about {', '.join(told)}, in per cent of the run that tells most of each" if told else "none"


def _approach(content: ReportContent, first: int) -> list[tuple[str, str]]:
    plan = content.plan
    pose, velocity = plan.trajectory.pose[first], plan.trajectory.velocity[first]
    lat, lon = plan.area.frame.to_degrees(pose[:2]).tolist()
    return [
        ("Starts at", words.clock(first * plan.commands.sample_time_s)),
        ("Position", f"{words.latitude(lat)}, {words.longitude(lon)}"),
        ("Heading", words.bearing(float(pose[2]))),
        ("Speed over ground", words.speed(float(np.hypot(*velocity[:2])))),
        ("Sway, yaw rate", f"{words.number(velocity[1])} m/s, {words.number(math.degrees(velocity[2]), 1)} deg/s"),
        ("Steady before", words.duration(steady_s(content, first))),
    ]


def steady_s(content: ReportContent, first: int) -> float:
    """For how long before a sample heading and speed stay near what they are at it, by the plan [s]."""
    motion = content.plan.trajectory
    speed = np.hypot(*motion.velocity[: first + 1, :2].T)
    close = np.abs(motion.pose[: first + 1, 2] - motion.pose[first, 2]) < STEADY_HEADING_RAD
    close &= np.abs(speed - speed[first]) < max(STEADY_SPEED_SHARE * speed[first], STEADY_SPEED_MPS)
    away = np.flatnonzero(~close)
    return float(first - (away[-1] + 1 if len(away) else 0)) * motion.sample_time_s


def _stop(content: ReportContent, first: int, last: int) -> str:
    plan = content.plan
    pose, step = plan.trajectory.pose, plan.commands.sample_time_s
    lat, lon = plan.area.frame.to_degrees(pose[last, :2]).tolist()
    turned = math.degrees(float(pose[last, 2] - pose[first, 2]))
    side = "starboard" if turned > 0 else "port"
    heading = words.bearing(float(pose[last, 2]))
    return (
        f"after {words.duration((last - first) * step)}, at {words.clock(last * step)}. Planned: heading {heading} "
        f"(turned {abs(turned):.0f} deg to {side}), {words.latitude(lat)}, {words.longitude(lon)}."
    )


def _abort(danger: Danger, step: float) -> list[tuple[str, str]]:
    when = words.clock(danger.nearest_sample * step)
    return [
        ("ahead", _reach(danger.ahead_m)),
        ("to port", _reach(danger.port_m)),
        ("to starboard", _reach(danger.starboard_m)),
        (f"nearest, at {when}", words.distance(danger.nearest_m)),
    ]


def _reach(distance_m: float) -> str:
    return f"over {words.distance(FARTHEST_M)}" if distance_m >= FARTHEST_M else words.distance(distance_m)


def _room(content: ReportContent, danger: Danger) -> list[tuple[str, str]]:
    long, wide = danger.room_m
    draught = content.vessel.draught_m
    return [
        ("Hull sweeps", f"{words.distance(long)} by {words.distance(wide)}"),
        ("With clearance", " by ".join(words.distance(side + 2 * content.clearance_m) for side in (long, wide))),
        (
            "Depth",
            f"more than {4 * draught:g} m for results free of the bottom (4 draughts); {content.plan.area.depth_rule}",
        ),
    ]


def _record(content: ReportContent) -> str:
    step = content.plan.commands.sample_time_s
    inputs = ", ".join(column_name(name) for name in content.vessel.model.inputs)
    return (
        f"every {step:g} s with one clock: time_s, lat_deg, lon_deg, heading_deg, u_mps, v_mps, r_radps, {inputs}, "
        "wind_speed_mps, wind_angle_rad; begin 30 s before the run and end 30 s after it"
    )
