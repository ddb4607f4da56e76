"""Clocks of several files: how much later one runs than another, from what both saw, with its standard error.

Where both measured the same (a turn, a speed) the lag of the largest correlation is taken. Where one has only the
rudder and the other the turn, the lag at which the rudder explains most of the change of the yaw rate beside that rate,
r' / u^2 = b r / u + k rudder(t - lag), with speed u: the ship's own slowness is in b then, and not in the lag.

Both are found on the whole overlap, and again in blocks of it, whose spread gives the standard error.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.importing.channels import Channel
from expdesign.importing.mapping import COG, EASTWARD, NORTHWARD, SOG
from expdesign.values import Array

BLOCKS = 8
FEWEST = 4  # blocks that must agree
SAME = 0.8  # least squared correlation of one quantity that tells a zone
QUARTER_S, FARTHEST_ZONE_S = 900.0, 14.5 * 3600.0  # of which zones are multiples, and the farthest of them
ROLLOVER_S = 1024 * 7 * 86400.0  # after so long a receiver that knows ten bits of the week begins anew
STEP_S = (0.05, 1.0)  # of the series that are compared, at least and at most [s]
NEAR_S = 120.0  # by which a computer's clock may be off [s]
LIKE = 0.3  # least squared correlation that tells a lag
MOST_SAMPLES = 400_000
OVERLAP = 0.5  # of the shorter series at a lag, at least
LEAST_SPEED = 0.1  # m/s
SLOW = 0.3  # share of the usual speed below which that does not count


@dataclass(frozen=True, kw_only=True)
class Lag:
    """How much is to be added to the times of a file."""

    offset_s: float
    std_s: float
    by: str  # what both saw
    explained: float


@dataclass(frozen=True)
class _Series:
    """Something that a file saw, on its own times."""

    what: str
    time_s: Array
    values: Array
    speed: Array | None = None  # beside a turn, where it is known [m/s]
    is_course: bool = False  # whether the turn is that of the course, not of the heading


def lag_of(
    own: Mapping[str, Channel], other: Mapping[str, Channel], *, near: bool, length_m: tuple[float, float] = (0.0, 0.0)
) -> Lag | None:
    """What is to be added to the times of a file so that it fits another one; None where nothing tells.

    Args:
        own: column -> channel in its unit, of the file whose clock is sought.
        other: those of the file with the clock that is kept.
        near: whether both clocks count from the same origin, and are off by little.
        length_m: of the ship, by which the course is late in turns, and its standard error [m].
    """
    found = []
    for one, two, how in _pairs(own, other):
        lag = _lag(one, two, how, near=near, length_m=length_m)
        if lag is not None:
            found.append(lag)
    return max(found, key=lambda lag: (lag.explained > LIKE, -lag.std_s), default=None)


def zone_lag_of(
    own: Mapping[str, Channel], other: Mapping[str, Channel], *, length_m: tuple[float, float] = (0.0, 0.0)
) -> tuple[Lag, str] | None:
    """What is to be added to a dated clock that is of another zone, or weeks of GPS behind, and words; None for none.

    A lag counts only where both saw the same, and where it is whole quarters of an hour, or 1024 weeks, but for what a
    computer's clock may be off.
    """
    lag = lag_of(own, other, near=False, length_m=length_m)
    if lag is None or lag.explained < SAME:
        return None
    weeks = round(lag.offset_s / ROLLOVER_S)
    late_s = lag.offset_s - weeks * ROLLOVER_S
    quarters = round(late_s / QUARTER_S)
    if abs(late_s) > FARTHEST_ZONE_S or abs(late_s - quarters * QUARTER_S) > NEAR_S or not (weeks or quarters):
        return None
    words = [f"{abs(weeks)} times 1024 weeks {'behind' if weeks > 0 else 'ahead'}, as receivers count after a rollover"]
    hours = f"of a zone {abs(quarters) / 4:g} h {'after' if quarters < 0 else 'before'} the other's"
    return lag, ", and ".join([*words * bool(weeks), *[hours] * bool(quarters)])


def _pairs(own: Mapping[str, Channel], other: Mapping[str, Channel]) -> Iterator[tuple[_Series, _Series, str]]:
    mine, theirs = ({series.what: series for series in _series(table)} for table in (own, other))
    for what in [what for what in mine if what in theirs]:
        yield mine[what], theirs[what], "like"
    if set(mine) & set(theirs):
        return
    rudder = next((name for name in mine if name.startswith("rudder")), None)
    if rudder and "turn" in theirs:
        yield mine[rudder], theirs["turn"], "causes"
    rudder = next((name for name in theirs if name.startswith("rudder")), None)
    if rudder and "turn" in mine:
        yield mine["turn"], theirs[rudder], "follows"


def _series(table: Mapping[str, Channel]) -> Iterator[_Series]:
    speed = next((table[name] for name in ("u_mps", SOG) if name in table), None)

    def beside(times: Array) -> Array | None:
        return None if speed is None else np.interp(times, speed.time_s, np.abs(speed.values))

    if "r_radps" in table:
        times = table["r_radps"].time_s
        yield _Series("turn", times, table["r_radps"].values, beside(times))
    else:
        names = ("heading_rad", "magnetic_heading_rad", COG)
        angle = next((table[name] for name in names if name in table), None)
        if angle is not None and len(angle) > 3:
            turned = np.unwrap(angle.values)
            steps = np.maximum(np.diff(angle.time_s), 1e-6)
            times = (angle.time_s[1:] + angle.time_s[:-1]) / 2
            yield _Series("turn", times, np.diff(turned) / steps, beside(times), is_course=angle is table.get(COG))
    if speed is not None:
        yield _Series("speed", speed.time_s, speed.values)
    elif NORTHWARD in table and EASTWARD in table and len(table[NORTHWARD]) == len(table[EASTWARD]):
        yield _Series("speed", table[NORTHWARD].time_s, np.hypot(table[NORTHWARD].values, table[EASTWARD].values))
    if "roll_rad" in table:
        yield _Series("roll", table["roll_rad"].time_s, table["roll_rad"].values)
    for name in table:
        if name.removeprefix("reached_").startswith(("rudder", "tau_psi")):
            yield _Series(f"rudder {name.removeprefix('reached_')}", table[name].time_s, table[name].values)


def _lag(one: _Series, two: _Series, how: str, *, near: bool, length_m: tuple[float, float]) -> Lag | None:
    step_s = float(np.clip(max(np.median(np.diff(s.time_s)) for s in (one, two)) / 2, *STEP_S))
    length = max(np.ptp(one.time_s), np.ptp(two.time_s)) / step_s
    step_s *= max(1.0, length / MOST_SAMPLES)
    x, y = _even(one, step_s), _even(two, step_s)
    if how == "follows":  # as where the rudder is this file's, but for the sign
        found = _lag(two, one, "causes", near=near, length_m=length_m)
        return None if found is None else replace(found, offset_s=-found.offset_s)
    beside = np.zeros(0)
    if how == "causes":
        y, beside = _change(two, step_s)
    if min(len(x), len(y)) < 40:
        return None
    # index lag that is added to x so that it fits y, beside that of their first times
    between = round((one.time_s[0] - two.time_s[0]) / step_s)
    bounds = (between - round(NEAR_S / step_s), between + round(NEAR_S / step_s)) if near else None
    whole = _best(x, y, beside, bounds)
    if whole is None or whole[1] < LIKE:
        return None
    place, explained = whole
    parts = []
    for piece in np.array_split(np.arange(len(x)), BLOCKS):
        if len(piece) < 20:
            continue
        reach = max(3, round(20.0 / step_s))
        local = _best(x[piece], y, beside, (place + piece[0] - reach, place + piece[0] + reach))
        if local is not None and local[1] > LIKE:
            parts.append(local[0] - piece[0])
    if len(parts) < FEWEST:
        std_s = step_s / np.sqrt(12.0) * np.sqrt(1.0 / max(explained, 1e-3) - 1.0) + step_s / 4
    else:
        median = float(np.median(parts))
        kept = [part for part in parts if abs(part - median) * step_s < 3.0]
        place = float(np.mean(kept))
        std_s = float(np.hypot(np.std(kept, ddof=1) / np.sqrt(len(kept)), 0.05)) * step_s
    offset_s, by = two.time_s[0] - one.time_s[0] + place * step_s, one.what if how == "like" else "rudder and turn"
    if two.is_course or (one.is_course and how == "like"):
        late_s, late_std_s = _drift_s(two if two.is_course else one, length_m)
        both = one.is_course and two.is_course
        offset_s -= 0.0 if both else late_s if two.is_course else -late_s
        std_s = std_s if both else np.hypot(std_s, late_std_s)
        by = by if both else f"{by} of heading and course, which in a turn is late by {late_s:.2g} s of drift"
    return Lag(offset_s=float(offset_s), std_s=float(std_s), by=by, explained=explained)


def _drift_s(turn: _Series, length_m: tuple[float, float]) -> tuple[float, float]:
    """How much later than the heading the course turns, as ships drift: the way to the pivot point; and how unsure [s].

    The pivot point of a turning ship is a fourth to a third of her length behind the bow (Tzeng, 1998), and further
    aft for broad ones: here a fourth ahead of midships, with a standard error of a tenth.
    """
    speed = LEAST_SPEED if turn.speed is None else max(float(np.median(turn.speed)), LEAST_SPEED)
    own, std = length_m
    return 0.25 * own / speed, float(np.hypot(0.1 * own, 0.25 * std)) / speed


def _even(series: _Series, step_s: float) -> Array:
    times = np.arange(series.time_s[0], series.time_s[-1], step_s)
    return np.interp(times, series.time_s, series.values)


def _change(turn: _Series, step_s: float) -> tuple[Array, Array]:
    """(k,) change of a yaw rate over the squared speed, and the yaw rate over the speed."""
    r = _even(turn, step_s)
    u = np.ones(len(r))
    if turn.speed is not None:
        u = _even(replace(turn, values=turn.speed), step_s)
        u = np.maximum(u, SLOW * max(float(np.median(u)), 1e-6))
    return np.gradient(r, step_s) / u**2, r / u


def _best(x: Array, y: Array, beside: Array, bounds: tuple[float, float] | None) -> tuple[float, float] | None:
    """Lag in samples, between them by a parabola, at which x moved by it fits y best; and the share explained."""
    score, lags = _explained(x - x.mean(), y - y.mean(), beside - beside.mean() if len(beside) else None)
    if bounds is not None:
        inside = (lags >= bounds[0]) & (lags <= bounds[1])
        score, lags = score[inside], lags[inside]
    if not len(score):
        return None
    top = int(np.argmax(score))
    if top in (0, len(score) - 1):
        return (float(lags[top]), float(score[top])) if bounds is None else None
    a, b, c = score[top - 1 : top + 2]
    bend = a - 2 * b + c
    return float(lags[top] + (0.5 * (a - c) / bend if bend else 0.0)), float(b)


def _explained(x: Array, y: Array, beside: Array | None) -> tuple[Array, Array]:
    """Share of the squares of y that x explains beside a mean and another series, at every lag with enough overlap."""

    def correlated(a: Array, b: Array) -> Array:
        return np.asarray(scipy.signal.correlate(b, a, mode="full", method="fft"))

    lags = np.arange(-len(x) + 1, len(y), dtype=float)
    one_x, one_y = np.ones(len(x)), np.ones(len(y))
    count = np.maximum(np.round(correlated(one_x, one_y)), 1.0)
    sum_x, sum_y = correlated(x, one_y), correlated(one_x, y)
    xy = correlated(x, y) - sum_x * sum_y / count
    xx, yy = correlated(x**2, one_y) - sum_x**2 / count, correlated(one_x, y**2) - sum_y**2 / count
    if beside is not None:
        sum_b = correlated(one_x, beside)
        bb = correlated(one_x, beside**2) - sum_b**2 / count
        bb = np.maximum(bb, 1e-9 * bb.max())
        xb, by = correlated(x, beside) - sum_x * sum_b / count, correlated(one_x, beside * y) - sum_b * sum_y / count
        xy, xx, yy = xy - xb * by / bb, xx - xb**2 / bb, yy - by**2 / bb
    enough = (count > OVERLAP * min(len(x), len(y))) & (xx > 1e-6 * xx.max()) & (yy > 1e-6 * yy.max())
    score = np.where(enough, xy**2 / np.maximum(xx * yy, 1e-300), 0.0)
    return np.asarray(np.where(xy > 0, score, 0.0) if beside is None else score), lags
