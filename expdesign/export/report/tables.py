"""Tables of the report: rows of text."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.conventions import KNOTS_PER_MPS
from expdesign.export import words
from expdesign.export.report.content import ReportContent, primitive_runs
from expdesign.information.moments import PrimitiveInformation
from expdesign.plan.values import Leg, Plan
from expdesign.shortest_day import ShortestDay
from expdesign.values import Array

REST_MPS, REST_RADPS, AT_REST = 0.02, 0.0005, "at rest"
NEARLY_ZERO = 1e-9  # in SI; smaller settings are rounding errors


@dataclass(frozen=True, kw_only=True)
class AgendaRow:
    """One leg of the agenda."""

    leg: int
    run: int | None
    starts: str
    what: str
    lasts: str
    latitude: str
    longitude: str
    heading: str
    speed: str
    knots: str


def agenda(content: ReportContent) -> list[AgendaRow]:
    """The agenda: time, name, duration, position, heading and speeds of every leg."""
    plan = content.plan
    numbers = {run.leg: run.number for run in primitive_runs(plan)}
    return [
        _agenda_row(plan, index, leg, numbers.get(index), content.shown(leg.name))
        for index, leg in enumerate(plan.legs)
    ]


def _agenda_row(plan: Plan, index: int, leg: Leg, run: int | None, name: str) -> AgendaRow:
    pose = plan.trajectory.pose[leg.first]
    lat, lon = plan.area.frame.to_degrees(pose[:2]).tolist()
    before, after = (float(np.hypot(*plan.trajectory.velocity[sample, :2])) for sample in (leg.first, leg.last))
    return AgendaRow(
        leg=index,
        run=run,
        starts=words.clock(leg.first * plan.commands.sample_time_s),
        what=name if run else f"reposition to {name}",
        lasts=words.duration((leg.last - leg.first) * plan.commands.sample_time_s),
        latitude=words.latitude(lat),
        longitude=words.longitude(lon),
        heading=words.bearing(float(pose[2])),
        speed=_from_to(before, after),
        knots=_from_to(before * KNOTS_PER_MPS, after * KNOTS_PER_MPS),
    )


def _from_to(before: float, after: float) -> str:
    return f"{words.number(before, 1)} \N{RIGHTWARDS ARROW} {words.number(after, 1)}"


def primitive_rows(content: ReportContent) -> list[tuple[str, ...]]:
    """The dictionary in the order of the design: name, initial motion, excitation, information, time, runs."""
    design = content.design
    columns = zip(
        content.information,
        design.fractions,
        design.durations_s,
        design.repeats,
        design.sensitivities - design.certificate.prices,
        design.problem.included,
        strict=True,
    )
    return [
        (
            content.shown(item.primitive.name),
            motion(item.primitive.entry_velocity),
            excitation_words(item),
            "singular" if item.log_det_alone is None else words.number(item.log_det_alone, 1),
            words.number(float(sensitivity), 3) if included else "excluded",
            words.percent(float(fraction)),
            words.duration(float(seconds)),
            words.duration(item.primitive.duration_s),
            str(runs),
        )
        for item, fraction, seconds, runs, sensitivity, included in columns
    ]


UNITS = {
    "mps": ("m/s", 1.0),
    "radps": ("\N{DEGREE SIGN}/s", 180.0 / np.pi),
    "rad": ("\N{DEGREE SIGN}", 180.0 / np.pi),
    "s": ("s", 1.0),
    "m": ("m", 1.0),
    "fraction": ("% of the run", 100.0),
}
"""Ending of a setting's name -> unit shown and factor to it."""


def settings_sentence(item: PrimitiveInformation) -> str:
    """Settings of a primitive in friendly units, without its duration, and offsets and shares of zero."""
    told = {name: value for name, value in item.primitive.settings.items() if name != "duration_s"}
    chosen = {
        k: value for k, value in told.items() if abs(value) > NEARLY_ZERO or not ("offset" in k or "fraction" in k)
    }
    return ", ".join(setting(name, value) for name, value in chosen.items())


def setting(name: str, value: float) -> str:
    """Name and value of a setting, in friendly units."""
    stem, _, ending = name.rpartition("_")
    unit, factor = UNITS.get(ending, ("", 1.0)) if stem else ("", 1.0)
    value = 0.0 if abs(value) < NEARLY_ZERO else value
    title = (stem if unit else name).replace("_", " ")
    if ending == "mps" and value:
        knots = words.number(value * KNOTS_PER_MPS, 1)
        return f"{title} {words.significant(value)}{words.NB}m/s ({knots}{words.NB}kn)"
    gap = "" if unit == "\N{DEGREE SIGN}" else words.NB
    return f"{title} {words.significant(value * factor)}{gap}{unit}".rstrip()


def motion(velocity: Array) -> str:
    """A velocity (3,) in words."""
    u, v, r = velocity.tolist()
    if np.hypot(u, v) < REST_MPS and abs(r) < REST_RADPS:
        return AT_REST
    parts = [f"{words.speed(abs(u))} {'ahead' if u >= 0 else 'astern'}"]
    if abs(v) >= REST_MPS:
        parts.append(f"{words.speed(abs(v))} to {'starboard' if v > 0 else 'port'}")
    if abs(r) >= REST_RADPS:
        side = "starboard" if r > 0 else "port"
        parts.append(f"turning {words.number(abs(np.degrees(r)))} \N{DEGREE SIGN}/s to {side}")
    return ", ".join(parts)


def excitation_words(item: PrimitiveInformation) -> str:
    """Where the excitation condition holds: in all, or by equation the share of the samples that meet it."""
    if item.excitation_condition:
        return "holds"
    if not item.excites:
        return "does not hold"
    parts = [
        f"{output}: holds" if held else f"{output}: {words.percent(item.clear_share.get(output, 0.0))}"
        for output, held in item.excites.items()
    ]
    return ", ".join(parts)


def excitation_sentence(content: ReportContent) -> str:
    """Consequences of the excitation condition for the estimation."""
    held = [item.primitive.name for item in content.information if item.excitation_condition]
    if len(held) == len(content.information):
        return (
            "The excitation condition holds in all manoeuvres: instrumental variables are unbiased with noisy sensors."
        )
    problem = content.design.problem
    if problem.excitation != "free":
        whole = "" if problem.excitation == "rewarded" else " of manoeuvres that keep it, once clear,"
        return (
            "In each equation only samples count at which what stands inside its absolute values is clear of zero,"
            f"{whole} so that noisy velocities leave no bias; estimate with --samples equation-wise. The table says "
            "which share of a run that is."
        )
    where = f"only in {words.counted(len(held), 'manoeuvre')}" if held else "in no manoeuvre"
    return (
        f"The excitation condition holds {where}. Elsewhere noisy velocities bias the terms with an absolute "
        "value, also with instrumental variables. Output error avoids this bias if sensor noise is the only "
        "disturbance."
    )


def day_rows(content: ReportContent, day: ShortestDay) -> list[tuple[str, ...]]:
    """The days planned in search of the shortest, in order: number, runs, length, time in runs, information."""
    return [
        (
            str(number),
            ", ".join(f"{count} {content.shown(name)}" for name, count in item.runs.items()) or "none",
            words.duration(item.day_s),
            words.duration(item.informative_s),
            words.percent(item.information),
        )
        for number, item in enumerate(day.tried, start=1)
    ]


def minutes_sentence(day: ShortestDay) -> str:
    """Where the minutes go."""
    parts, length = day.parts, day.plan.day
    extra_s = length.median_s - length.planned_s
    more = f"; slower ships and go-arounds add {words.duration(extra_s)} in the middle of simulated trials"
    return (
        f"Of the {words.duration(length.planned_s)} the way to the goal takes {words.duration(parts.way_s)} at transit "
        f"speed, runs {words.duration(parts.runs_s)} beyond their distance made good, and the legs between them "
        f"{words.duration(parts.legs_s)}{more if extra_s > 0 else ''}."
    )


def found_sentence(day: ShortestDay) -> str:
    """What the day is the best of, and its information."""
    tried = words.counted(len(day.tried), "day")
    if day.plan.draft:
        return (
            "It is a DRAFT, the first day that the search tries; others may be shorter or tell more. Its track, legs "
            f"included, holds {words.percent(day.information)} of the information asked for."
        )
    if day.most_s is not None:
        return (
            f"It has the most information of {tried} planned to take at most {words.duration(day.most_s)}: its track, "
            f"legs included, holds {words.percent(day.information)} of the information that the optimal durations "
            f"would in {words.duration(day.design.problem.total_s)}."
        )
    known = " with what was known before," if day.design.problem.prior.any() else ""
    return (
        f"It is the shortest of {tried} planned that is as accurate as asked for: its track, legs included,{known} "
        f"holds {words.percent(day.information)} of the information needed."
    )


def day_sentences(day: ShortestDay) -> list[str]:
    """How far the choice of runs is proven, and what no day can fall below."""
    return [
        f"At the prices learnt from the days planned, the cheapest runs found cost {words.duration(day.cost_s)} with "
        "their share of the repositioning. No choice of runs from the dictionary costs less than "
        f"{words.duration(day.cost_bound_s)} then.",
        *_bound_sentences(day),
        *([f"{day.note[0].upper()}{day.note[1:]}."] if day.note else []),
    ]


def _bound_sentences(day: ShortestDay) -> list[str]:
    """What no day can fall below, and for which motions that is proved."""
    bound = day.bound
    if bound is None or bound.day_s <= 0:
        return []
    (u_low, u_high), (_, v), (_, r) = bound.velocities.tolist()
    informing = f", and gathering the information at least {words.duration(bound.information_s)}"
    required = f", and the runs that limits require {words.duration(bound.required_s)}" if bound.required_s else ""
    return [
        f"No day is shorter than {words.duration(bound.day_s)}, "
        f"{words.percent(bound.day_s / day.plan.commands.duration_s)} of this one: the way to the goal takes at least "
        f"{words.duration(bound.way_s)}{informing if bound.information_s > 0 else ''}{required}. "
        f"Proved for all motions through water with {u_low:.2f} to {u_high:.2f} m/s ahead, {v:.2f} m/s to a side, "
        f"{bound.speed_mps:.2f} m/s in all and {r:.3f} rad/s, by any input within limits; no ship can do most of them."
    ]
