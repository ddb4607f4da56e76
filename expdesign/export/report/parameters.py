"""Parameters in a report: expected standard deviations before and after the trial, and while it is in progress."""

from __future__ import annotations

import math

import numpy as np

from expdesign.estimation.methods import steady_current_method
from expdesign.export import words
from expdesign.export.files import Known, PlannedAccuracy, Purchase
from expdesign.export.report.content import ReportContent
from expdesign.export.words import NOTICED
from expdesign.sea_area import LocalFrame
from expdesign.shortest_day import ShortestDay

# Parameters: expected standard deviations before and after the trial, and their table.


def parameter_rows(content: ReportContent, found: PlannedAccuracy) -> list[tuple[str, ...]]:
    """By parameter: name, term, value, standard deviation before, after the runs, after the track, and their ratio."""
    model = content.vessel.model
    nominal = dict(zip(found.parameters, found.nominal.tolist(), strict=True))
    left = "T d{}/dt" if model.form == "discrete" else "d{}/dt"
    terms = {term.name: f"{left.format(term.equation)} = ... + {term.name} * {term.expression}" for term in model.terms}
    columns = zip(content.parameters, found.before.tolist(), found.runs.tolist(), found.track.tolist(), strict=True)
    return [
        (
            name,
            terms[name],
            _small(nominal[name], 3),
            _small(before) if before > 0 else "not stated",
            _std(runs),
            _std(track),
            f"{words.significant(before / track, 2)} times" if before > 0 and track > 0 else "",
        )
        for name, before, runs, track in columns
    ]


def _std(value: float) -> str:
    return "not estimable" if np.isnan(value) else _small(value)


def accuracy_table(day: ShortestDay) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """How well each parameter and outcome is told by every day planned, the shortest first: header and rows."""
    days = sorted((item for item in enumerate(day.tried, start=1) if item[1].told), key=lambda item: item[1].day_s)
    names = list(dict.fromkeys(name for _, item in days for name in item.told))
    header = ("", *(f"Day {number}, {words.duration(item.day_s)}" for number, item in days))
    return header, [(name, *(_small(item.told[name]) for _, item in days)) for name in names]


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


def unknown_current_sentence(content: ReportContent) -> str:
    """Which estimate the accuracies are of where the forecast leaves a steady current unknown; "" where it does not."""
    std_mps = content.environment.current_std_mps
    if std_mps <= 0:
        return ""
    method = steady_current_method(content.vessel.model)
    return (
        f"The forecast leaves a steady current of {words.speed(std_mps)} (standard deviation) unknown. Accuracies on "
        f"this page hold where it is estimated with the parameters, by expdesign estimate --method {method}. By a "
        "method that knows nothing of it, errors can be many times larger."
    )


def measures_velocity(content: ReportContent) -> bool:
    """Whether the vessel file states noise to propagate."""
    sensors = content.vessel.sensors
    return sensors.velocity_mps > 0 or sensors.yaw_rate_radps > 0


# The section of the report on a trial in progress: what is known, and what the rest of the trial adds.


def known_rows(known: Known) -> list[tuple[str, ...]]:
    """By parameter: name, what told most, value before the trial and now, standard deviations before, now, after."""
    columns = (known.before, known.now, known.stated, known.so_far, known.after)
    rows = zip(known.parameters, *(column.tolist() for column in columns), known.purchases, strict=True)
    return [
        (
            f"{name} (new)" if name in known.new else name,
            f"{item.runs} \N{MULTIPLICATION SIGN} {item.primitive}" if item.primitive else "no single manoeuvre",
            "not in the model" if math.isnan(before) else words.significant(before),
            words.significant(now, 4),
            words.significant(stated, 2) if stated > 0 else "not stated",
            _std_progress(so_far),
            _std_progress(after),
            _without(item),
        )
        for name, before, now, stated, so_far, after, item in rows
    ]


def _std_progress(value: float) -> str:
    return "not estimable" if math.isnan(value) else words.significant(value, 2)


def _without(item: Purchase) -> str:
    if not item.primitive:
        return ""
    return "not estimable" if math.isinf(item.without) else f"{words.significant(item.without, 2)} times larger"


def known_sentences(known: Known, frame: LocalFrame) -> list[str]:
    """The state of the trial."""
    lat, lon = frame.to_degrees(known.pose[:2]).tolist()
    files = ", ".join(known.data)
    left = _time_left(known)
    current = words.current(known.environment.current_to, known.environment.current_std_mps)
    wind = words.wind(known.environment.wind_to, known.environment.wind_std_mps)
    moving = f"The speed over ground was {words.speed(known.speed_mps)}. " + (
        "The plan assumes that the ship then stops relative to the water."
        if known.under_way is None
        else "The plan begins there and then, with the motion and the commands of the last rows of the data."
    )
    return [
        f"This plan is for the rest of a trial. Data so far: {words.duration(known.sailed_s)} ({files}). Informative "
        f"time left: {left}.",
        f"The data end with the ship at {words.latitude(lat)}, {words.longitude(lon)}, heading "
        f"{words.bearing(float(known.pose[2]))}. {moving}",
        f"Model: {known.model}. Weather: {current}; {wind} ({known.weather}).",
        *known.notes,
        _gain(known),
    ]


def _time_left(known: Known) -> str:
    if math.isnan(known.remaining_s):
        return "as long as the day asked for takes"
    left, whole = words.duration(known.remaining_s), words.duration(known.total_s)
    if known.remaining_stated:
        return f"{left}, as stated"
    return f"{left}, that is {whole} for the whole trial minus the duration of the data"


def _gain(known: Known) -> str:
    """The gain in accuracy by the rest of the trial."""
    both = np.isfinite(known.so_far) & np.isfinite(known.after) & (known.after > 0)
    if not both.any():
        return "The accuracy from the data so far cannot be compared with the accuracy after the rest."
    ratio = float(np.exp(np.mean(np.log(known.so_far[both] / known.after[both]))))
    first = np.isnan(known.so_far) & np.isfinite(known.after)
    names = [name for name, untold in zip(known.parameters, first, strict=True) if untold]
    more = f" The data so far cannot determine {', '.join(names)}; the rest can." if names else ""
    grown = known.after > known.so_far * (1.0 + NOTICED)
    larger = [name for name, is_so in zip(known.parameters, grown, strict=True) if is_so]
    worse = f" Larger {'is that' if len(larger) == 1 else 'are those'} of {', '.join(larger)}." if larger else ""
    factor = max(ratio, 1 / ratio)
    size = f"{words.significant(factor, 3)} times {'smaller' if ratio > 1 else 'larger'} than"
    change = "as large as" if factor < 1.0 + NOTICED else size
    return (
        f"After the rest, the expected standard deviations are {change} from the data so far (geometric mean)."
        f"{worse * (ratio > 1)}{more}"
    )
