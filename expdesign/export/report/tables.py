"""Tables of the report: rows of text."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.export import words
from expdesign.export.report.content import ReportContent, primitive_runs
from expdesign.export.report.procedure import aborted_words, extra_words, left_words
from expdesign.export.report.uncertainty import Expected
from expdesign.information.primitive_information import PrimitiveInformation
from expdesign.plan.values import Leg, Plan, Promise

REST_MPS, REST_RADPS = 0.02, 0.0005


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


def agenda(content: ReportContent) -> list[AgendaRow]:
    """Leg by leg: when, what, for how long, from where, with which heading and speeds."""
    plan = content.plan
    numbers = {run.leg: run.number for run in primitive_runs(plan)}
    return [_agenda_row(plan, index, leg, numbers.get(index)) for index, leg in enumerate(plan.legs)]


def _agenda_row(plan: Plan, index: int, leg: Leg, run: int | None) -> AgendaRow:
    pose = plan.trajectory.pose[leg.first]
    lat, lon = plan.area.frame.to_degrees(pose[:2]).tolist()
    before, after = (float(np.hypot(*plan.trajectory.velocity[sample, :2])) for sample in (leg.first, leg.last))
    return AgendaRow(
        leg=index,
        run=run,
        starts=words.clock(leg.first * plan.commands.sample_time_s),
        what=leg.name if run else f"reposition to {leg.name}",
        lasts=words.duration((leg.last - leg.first) * plan.commands.sample_time_s),
        latitude=words.latitude(lat),
        longitude=words.longitude(lon),
        heading=words.bearing(float(pose[2])),
        speed=f"{words.number(before, 1)} \N{RIGHTWARDS ARROW} {words.number(after, 1)}",
    )


@dataclass(frozen=True, kw_only=True)
class PrimitiveRow:
    """One primitive: description, information, number of runs."""

    name: str
    family: str
    settings: str
    lasts: str
    entry: str
    log_det: str
    excites: bool
    share: str
    optimal: str
    runs: int
    sensitivity: str


def primitive_rows(content: ReportContent) -> list[PrimitiveRow]:
    """The dictionary in the order of the design."""
    design = content.design
    columns = zip(
        content.information,
        design.fractions,
        design.durations_s,
        design.repeats,
        design.sensitivities - design.certificate.prices,
        strict=True,
    )
    return [
        PrimitiveRow(
            name=item.primitive.name,
            family=item.primitive.family.replace("_", " "),
            settings=settings_sentence(item),
            lasts=words.duration(item.primitive.duration_s),
            entry=_entry(item),
            log_det="singular" if item.log_det_alone is None else words.number(item.log_det_alone, 1),
            excites=item.excitation_condition,
            share=words.percent(float(fraction)),
            optimal=words.duration(float(seconds)),
            runs=runs,
            sensitivity=words.number(float(sensitivity), 3),
        )
        for item, fraction, seconds, runs, sensitivity in columns
    ]


UNITS = {
    "mps": ("m/s", 1.0),
    "radps": ("\N{DEGREE SIGN}/s", 180.0 / np.pi),
    "rad": ("\N{DEGREE SIGN}", 180.0 / np.pi),
    "s": ("s", 1.0),
    "m": ("m", 1.0),
    "fraction": ("of the run", 1.0),
}
"""Ending of a setting's name -> unit shown and factor to it."""


def settings_sentence(item: PrimitiveInformation) -> str:
    """Settings of a primitive in friendly units, its duration left out."""
    chosen = {name: value for name, value in item.primitive.settings.items() if name != "duration_s"}
    return ", ".join(setting(name, value) for name, value in chosen.items())


def setting(name: str, value: float) -> str:
    """Name and value of a setting, in friendly units."""
    stem, _, ending = name.rpartition("_")
    unit, factor = UNITS.get(ending, ("", 1.0)) if stem else ("", 1.0)
    title = (stem if unit else name).replace("_", " ")
    return f"{title} {words.significant(value * factor)} {unit}".rstrip()


def _entry(item: PrimitiveInformation) -> str:
    u, v, r = item.primitive.entry_velocity.tolist()
    if np.hypot(u, v) < REST_MPS and abs(r) < REST_RADPS:
        return "at rest"
    parts = [f"{words.number(u)} m/s ahead"]
    if abs(v) >= REST_MPS:
        parts.append(f"{words.number(abs(v))} m/s to {'starboard' if v > 0 else 'port'}")
    if abs(r) >= REST_RADPS:
        side = "starboard" if r > 0 else "port"
        parts.append(f"turning {words.number(abs(np.degrees(r)))} \N{DEGREE SIGN}/s to {side}")
    return ", ".join(parts)


@dataclass(frozen=True, kw_only=True)
class Check:
    """One line of the verification; `passed` is None where a number is only reported."""

    what: str
    found: str
    required: str
    passed: bool | None


def checks(content: ReportContent) -> list[Check]:
    """Results of the independent check beside the requirements."""
    plan, found = content.plan, content.plan.verification
    rows = [
        Check(
            what="Least distance from the hull to forbidden water",
            found=f"{words.distance(found.clearance_min_m)} at {words.clock(found.clearance_time_s)}",
            required=f"at least {words.distance(content.clearance_m)}",
            passed=found.clearance_min_m >= content.clearance_m,
        ),
        Check(
            what="Largest distance between the planned track and the independent simulation",
            found="less than 1 mm" if found.reproduction_error_m < 1e-3 else words.distance(found.reproduction_error_m),
            required="",
            passed=None,
        ),
        Check(
            what="Largest violation of an actuator limit or rate limit",
            found="none" if found.limit_excess < 1e-6 else f"{words.percent(found.limit_excess)} of its range",
            required="",
            passed=None,
        ),
    ]
    return rows if plan.promise is None else [*rows, *_promise_checks(plan.promise, 1.0 - content.confidence)]


def _promise_checks(promise: Promise, allowed: float) -> list[Check]:
    """Results of the Monte Carlo trials."""
    return [
        Check(
            what="Probability that the hull leaves allowed water during the trial",
            found=left_words(promise),
            required=f"at most {words.percent(allowed)}",
            passed=promise.left <= allowed + 1e-12,
        ),
        Check(
            what="Trials aborted because a run could not start within its tolerances",
            found=aborted_words(promise),
            required="",
            passed=None,
        ),
        Check(
            what="Time in addition to the plan, for returning to the start of each run",
            found=extra_words(promise),
            required="",
            passed=None,
        ),
    ]


@dataclass(frozen=True, kw_only=True)
class ParameterRow:
    """One parameter to be estimated: its term, its value, and how well it is known before and after."""

    name: str
    term: str
    nominal: str
    before: str
    runs: str
    track: str
    gain: str
    less: bool = False


def parameter_rows(content: ReportContent, found: Expected) -> list[ParameterRow]:
    """Parameters in order; standard deviations in the parameter's own unit."""
    model = content.vessel.model
    nominal = dict(zip(model.names, model.parameters.tolist(), strict=True))
    left = "T d{}/dt" if model.form == "discrete" else "d{}/dt"
    terms = {term.name: f"{left.format(term.equation)} = ... + {term.name} * {term.expression}" for term in model.terms}
    columns = zip(content.parameters, found.before.tolist(), found.runs.tolist(), found.track.tolist(), strict=True)
    return [
        ParameterRow(
            name=name,
            term=terms[name],
            nominal=_small(nominal[name], 3),
            before=_small(before) if before > 0 else "not stated",
            runs=_std(runs),
            track=_std(track),
            gain=f"{words.significant(before / track, 2)} times" if before > 0 and track > 0 else "",
            less=0 < before < track,
        )
        for name, before, runs, track in columns
    ]


def _std(value: float) -> str:
    return "not estimable" if np.isnan(value) else _small(value)


SMALL = 1e-3


def _small(value: float, digits: int = 2) -> str:
    """Significant digits; small values as a power of ten."""
    if not 0 < abs(value) < SMALL:
        return words.significant(value, digits)
    number, _, power = f"{value:.{digits - 1}e}".partition("e")
    trimmed = (number.rstrip("0").rstrip(".") if digits > 2 else number).replace("-", words.MINUS)
    return f"{trimmed}\N{MIDDLE DOT}10{str(int(power)).translate(RAISED)}"


RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def equation_sentence(content: ReportContent) -> str:
    """Units and the sample time of the equations."""
    model = content.vessel.model
    units = "Parameters and standard deviations are in m, s and rad, and the model's units of force."
    if model.form == "discrete":
        return f"T is the sample time of the model, {model.sample_time_s:g} s. {units}"
    return units


def excitation_sentence(content: ReportContent) -> str:
    """Consequences of the excitation condition for the estimation."""
    held = [item.primitive.name for item in content.information if item.excitation_condition]
    if len(held) == len(content.information):
        return (
            "The excitation condition holds in all manoeuvres: instrumental variables are unbiased with noisy sensors."
        )
    where = f"only in {words.counted(len(held), 'manoeuvre')}" if held else "in no manoeuvre"
    return (
        f"The excitation condition holds {where}. In the others noisy velocities bias the terms with an absolute "
        "value, also with instrumental variables. Output error avoids this bias if sensor noise is the only "
        "disturbance."
    )
