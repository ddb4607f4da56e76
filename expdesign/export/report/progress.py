"""The section of the report on a trial in progress: what is known, and what the rest of the trial adds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from expdesign.export import words
from expdesign.export.files import Known, Purchase
from expdesign.export.tuning import TUNING
from expdesign.sea_area import LocalFrame


@dataclass(frozen=True, kw_only=True)
class KnownRow:
    """One parameter: its value and standard deviation before the trial, now, and after the rest."""

    name: str
    new: bool
    before: str
    now: str
    stated: str
    so_far: str
    after: str
    bought: str
    without: str


def known_rows(known: Known | None) -> list[KnownRow]:
    """Parameters in order; none for a new trial."""
    if known is None:
        return []
    columns = (known.before, known.now, known.stated, known.so_far, known.after)
    rows = zip(known.parameters, *(column.tolist() for column in columns), known.purchases, strict=True)
    return [
        KnownRow(
            name=name,
            new=name in known.new,
            before="not in the model" if math.isnan(before) else words.significant(before),
            now=words.significant(now, 4),
            stated=words.significant(stated, 2) if stated > 0 else "not stated",
            so_far=_std(so_far),
            after=_std(after),
            bought=f"{item.runs} \N{MULTIPLICATION SIGN} {item.primitive}" if item.primitive else "no single manoeuvre",
            without=_without(item),
        )
        for name, before, now, stated, so_far, after, item in rows
    ]


def _std(value: float) -> str:
    return "not estimable" if math.isnan(value) else words.significant(value, 2)


def _without(item: Purchase) -> str:
    if not item.primitive:
        return ""
    return "not estimable" if math.isinf(item.without) else f"{words.significant(item.without, 2)} times larger"


def known_sentences(known: Known | None, frame: LocalFrame) -> list[str]:
    """The state of the trial; none for a new trial."""
    if known is None:
        return []
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
    grown = known.after > known.so_far * (1.0 + TUNING.noticed)
    larger = [name for name, is_so in zip(known.parameters, grown, strict=True) if is_so]
    worse = f" Larger {'is that' if len(larger) == 1 else 'are those'} of {', '.join(larger)}." if larger else ""
    factor = max(ratio, 1 / ratio)
    size = f"{words.significant(factor, 3)} times {'smaller' if ratio > 1 else 'larger'} than"
    change = "as large as" if factor < 1.0 + TUNING.noticed else size
    return (
        f"After the rest, the expected standard deviations are {change} from the data so far (geometric mean)."
        f"{worse * (ratio > 1)}{more}"
    )
