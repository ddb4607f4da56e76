"""What estimates tell of current and wind, as entries and a table, and in sentences of what nobody stated."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from expdesign.assessment import Answer, Assessed, Assessment, Current, Moved
from expdesign.conventions import plus_minus
from expdesign.estimation.disturbance import MeasuredWind, Moments
from expdesign.export.document import Table
from expdesign.export.files.text import valued
from expdesign.values import Array
from expdesign.vessel import column_name

CURRENT = "velocity of the water over ground"
WIND = "velocity of the air over ground, measured; the covariance is that of its samples, with the sensors' noise"
CONSTANT = "second moments: the current is estimated as steady"
TOGETHER = "second moments: drag terms of water and air are estimated together"
DIRECTIONS = ("north", "east")
SECOND = ("north_squared_less_east_squared", "north_times_east")
CENTRAL = ("variance_north_less_east", "covariance_north_east")
UNSEEN = "the sum of both squares, a constant in the equations that instruments without mean do not see"
HEADER = (
    "method",
    "of",
    "mean to north, east [m/s]",
    "mean of N N - E E, N E [m2/s2]",
    "var N - var E, cov N E [m2/s2]",
)


def disturbance_entries(item: Assessed) -> list[dict[str, Any]]:
    """One entry for each disturbance that a method estimates; empty where it estimates none."""
    found = item.disturbances
    steady = item.method.weather.steady
    entries = [_moments_entry(own, steady=steady) for own in _moments_of(item)]
    return [*entries, *([] if found.wind is None else [_wind_entry(found.wind)])]


def disturbance_table(found: Assessment) -> Table:
    """A row for each disturbance that a method estimates."""
    rows = []
    for item in found.best_first:
        for own in _moments_of(item):
            std = own.covariance.diagonal() ** 0.5
            cells = [_pair(part, std[2 * n : 2 * n + 2]) for n, part in enumerate((own.mean, own.second, own.central))]
            rows.append((item.method.name, _short(own), *cells))
        wind = item.disturbances.wind
        if wind is not None:
            (nn, ne), (_, ee) = wind.covariance.tolist()
            square = wind.mean[0] ** 2 - wind.mean[1] ** 2, wind.mean[0] * wind.mean[1]
            values = [wind.mean.tolist(), (nn - ee + square[0], ne + square[1]), (nn - ee, ne)]
            rows.append(
                (
                    item.method.name,
                    "air, as measured",
                    *(", ".join(f"{value:.3g}" for value in pair) for pair in values),
                )
            )
    return Table(header=HEADER, rows=rows, texts=3)


def meaning(own: Moments) -> str:
    """What the moments are of."""
    if own.of == "current":
        return CURRENT
    (air, water) = own.shares[0]
    return (
        f"velocity over ground of wind and current combined, as {water} acts on them in d{own.of}/dt: the wind by the "
        f"share of {air} in the sum of both parameters, the current by that of {water}"
    )


def _short(own: Moments) -> str:
    return "water" if own.of == "current" else f"water and air combined, in {own.shares[0][1]}"


def _moments_of(item: Assessed) -> tuple[Moments, ...]:
    found = item.disturbances
    return (*(() if found.current is None else (found.current,)), *found.combined)


def _moments_entry(own: Moments, *, steady: bool) -> dict[str, Any]:
    std = own.covariance.diagonal() ** 0.5
    seen = bool(np.isfinite(own.second).all())
    return {
        "of": "current" if own.of == "current" else f"current and wind in d{own.of}/dt",
        "meaning": meaning(own),
        "mean_mps": valued(DIRECTIONS, own.mean, std[:2]),
        "second_moments_m2ps2": valued(SECOND, own.second, std[2:4]) if seen else None,
        "covariance_m2ps2": valued(CENTRAL, own.central, std[4:]) if seen else None,
        "not_told": UNSEEN if seen else (CONSTANT if steady else TOGETHER),
    }


def _wind_entry(wind: MeasuredWind) -> dict[str, Any]:
    (nn, ne), (_, ee) = wind.covariance.tolist()
    return {
        "of": "wind",
        "meaning": WIND,
        "mean_mps": dict(zip(DIRECTIONS, wind.mean.tolist(), strict=True)),
        "covariance_m2ps2": {"north_north": nn, "north_east": ne, "east_east": ee},
        "samples": wind.samples,
    }


def _pair(values: Array, stds: Array) -> str:
    if not np.isfinite(values).all():
        return "not told"
    return ", ".join(plus_minus(value, std) for value, std in zip(values.tolist(), stds.tolist(), strict=True))


def unstated_sentences(found: Assessment) -> tuple[str, ...]:
    """A current, and inputs that the ship answers at another time than is stated: what they do to the estimates."""
    flow = () if found.current is None else (current_sentence(found.current),)
    return (*flow, *map(answer_sentence, found.answers))


def current_sentence(flow: Current) -> str:
    """What a current that nobody stated does to the estimates, and what helps."""
    toward_deg = math.degrees(math.atan2(flow.east_mps, flow.north_mps)) % 360
    speed = plus_minus(math.hypot(flow.north_mps, flow.east_mps), flow.std_mps)
    return (
        f"The data show a steady current of {speed} m/s towards {toward_deg:.0f} deg, or another push that keeps its "
        f"direction on the earth. It moves {_moved(flow.moved)} of estimates that know of none; "
        "expdesign estimate --unknown steady-current estimates it, too."
    )


def answer_sentence(answer: Answer) -> str:
    """What an input that the ship answers at another time does to the estimates, and what helps."""
    late, column = plus_minus(abs(answer.late_s), answer.std_s), column_name(answer.signal)
    when = "later" if answer.late_s > 0 else "sooner"
    unknown_s = max(0.5, round(2 * abs(answer.late_s), 1))
    return (
        f"The ship answers {column} {late} s {when} than recorded orders and vessel file say: dead times are rarely "
        "known, and an order may be up to one row older than the row that shows it. That moves "
        f"{_moved(answer.moved)}; [std] {answer.signal}_delay_s = {unknown_s:g} in the vessel file lets oe estimate "
        f"the time, too, and a measured position belongs under reached_{column}."
    )


def _moved(most: Moved) -> str:
    return f"{most.parameter} by {most.by_std:.0f} of its standard deviations"
