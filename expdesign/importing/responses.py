"""What logs tell of sensors and actuators: noise, rounding, interval of readings; how actuators follow orders.

    x' = clip((order - x) / 0, -rate, rate)     the position that slews towards the order
    reached(t) + lag reached'(t) = x(t - delay) + offset

which is the response of vessel files (`expdesign.vessel.Response`), fitted to the readings by least squares. An order
that is read at even times was given some time before its reading; that of each move is found beside. Where it is the
same for all, one clock gives the orders and reads them, and they count from their readings. Readings a second apart
give a rate that errs by up to 1.6 times its standard error; farther than `COARSEST_S` apart, they tell the rate alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.importing.channels import LARGEST, Channel
from expdesign.importing.sampling import SAME, Sampled
from expdesign.own_units import covariance_of
from expdesign.records.file import REACHED, is_input, is_turning_input
from expdesign.values import Array

EARTH_M_PER_DEG = 111195.0
THIRD = math.sqrt(20.0)  # standard deviation of third differences of white noise of one
STEPS = 2000
WHOLE = 0.98
DITHERED = 0.3  # noise over rounding above which means of readings are finer than the rounding
KEYS = (("heading_rad", ("heading_rad",), "heading"), ("yaw_rate_radps", ("r_radps",), "yaw_rate"),
        ("velocity_mps", ("u_mps", "v_mps"), "velocity"), ("position_m", ("lat_deg",), "position"),
        ("position_m", ("north_m", "east_m"), "position"), ("wind_mps", ("wind_speed_mps",), "wind"),
        ("roll_rad", ("roll_rad",), ""))  # fmt: skip
"""Key of a sensor's noise in [sensors], the columns that show it, and the sensor whose interval is stated beside."""


def sensor_keys(found: Sampled) -> dict[str, tuple[float, str]]:
    """Key of [sensors] -> value for the rows that are written, and what it is, for every sensor that shows."""
    keys: dict[str, tuple[float, str]] = {}
    for key, columns, sensor in KEYS:
        own = [found.channels[name] for name in columns if name in found.channels]
        if not own or key in keys:
            continue
        value, words = _noise(own, found.sample_time_s)
        if value > 0:
            keys[key] = float(f"{value:.2g}"), words
        if sensor and columns[0] in found.held_s:
            keys[f"{sensor}_interval_s"] = float(f"{found.held_s[columns[0]]:.4g}"), "between readings"
    return keys


def _noise(channels: Sequence[Channel], step_s: float) -> tuple[float, str]:
    """Standard deviation of the readings of one sensor in the rows that are written, and words on it."""
    squares, noises, roundings, averaged = [], [], [], False
    for channel in channels:
        scale = EARTH_M_PER_DEG if channel.name == "lat_deg" else 1.0
        values = np.unwrap(channel.values) if channel.name == "heading_rad" else channel.values
        rounding, noise = scale * step_of(values), scale * white_noise(values)
        share = channel.interval_s / step_s
        averaged = share < 1.0 / SAME
        mean = math.sqrt(share) if averaged else 1.0
        coarse = rounding / math.sqrt(12.0) * (mean if noise > DITHERED * rounding else 1.0)
        squares.append(max(noise * mean, coarse) ** 2)
        noises.append(noise)
        roundings.append(rounding)
    words = f"noise {max(noises):.2g}" + (f", rounded to {max(roundings):.2g}" if any(roundings) else "")
    return math.sqrt(float(np.mean(squares))), words + (" in each reading, of which rows are means" if averaged else "")


def step_of(values: Array) -> float:
    """The step that readings are rounded to; 0 where none shows."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-9 * max(float(np.abs(values).max()), 1e-12)]
    if not len(steps):
        return 0.0
    least = float(np.quantile(steps, 0.01)) if len(steps) > STEPS else float(steps.min())
    near = steps[steps < 1.5 * least]
    step = float(near.mean()) if len(near) else least
    small = steps[steps < 50 * step]
    whole = np.abs(small / step - np.round(small / step)) < 0.2
    return step if len(small) > 20 and whole.mean() > WHOLE else 0.0


def white_noise(values: Array) -> float:
    """Standard deviation of what changes from reading to reading, from third differences, robust against orders."""
    if len(values) < 50:
        return 0.0
    third = np.diff(values, 3)
    return float(1.4826 * np.median(np.abs(third - np.median(third))) / THIRD)


MOST_SAMPLES = 12_000
FEWEST_MOVES = 3
MOVED = 0.05  # share of the range by which an order must change to count
AFTER_S = 20.0  # of readings after a change of the order that are used, beside as long before
LONGEST_S = 10.0  # dead time and lag that are sought
CERTAIN = 3.0  # standard errors from zero at which a lag or a dead time is told
LONGEST_GAP_S = 60.0  # of positions; the time beyond it counts for nothing
FINE_S = 0.1  # of the simulation, at most
SHIFTS = 2  # steps in which the moment of each move is found
NO_LAG = 0.15  # steps below which a lag is none
EVEN = 0.9  # share of an order's intervals that are one and the same, where it is read at even times
COARSEST_S = 1.5  # interval of orders or positions beyond which neither lag nor dead time is told
SURE_MOVES, SURE = 8, 0.8  # moves, and how well their moments are known, that tell orders of one clock from others
TOGETHER = 0.5  # spread of these moments, as a share of that of moments anywhere between readings, below which they are
LESS = 0.9  # share of the root mean square that a slew rate must leave, to be told


@dataclass(frozen=True, kw_only=True)
class Followed:
    """How one signal follows its order; value and standard error each."""

    signal: str  # e.g. "rudder1"
    rate: tuple[float, float] | None  # [unit of the signal per second]; None where no limit shows
    lag_s: tuple[float, float] | None  # None where it is none
    delay_s: tuple[float, float] | None
    offset: float  # reached less ordered, at rest
    rest: float  # root mean square of what is left
    moves: int  # changes of the order


def followed(found: Mapping[str, Channel]) -> tuple[Followed, ...]:
    """The response of every signal whose order and position are both among the columns."""
    pairs = [(name, found[name], found[REACHED + name]) for name in found if is_input(name) and REACHED + name in found]
    fits = (_fit(name, order, reached) for name, order, reached in pairs)
    return tuple(one for one in fits if one is not None)


def _without_gaps(order: Channel, reached: Channel) -> tuple[Channel, Channel]:
    """The same on a clock that stands still through most of each gap of the positions."""
    gaps = np.diff(reached.time_s)
    begins, lasts = reached.time_s[:-1][gaps > LONGEST_GAP_S], gaps[gaps > LONGEST_GAP_S]
    if not len(lasts):
        return order, reached

    total = np.cumsum(lasts - LONGEST_GAP_S)
    ends = np.column_stack([begins + LONGEST_GAP_S, begins + lasts]).ravel()
    gone = np.column_stack([np.r_[0.0, total[:-1]], total]).ravel()

    def moved(channel: Channel) -> Channel:
        return replace(channel, time_s=channel.time_s - np.interp(channel.time_s, ends, gone))

    return moved(order), moved(reached)


def _fit(name: str, order: Channel, reached: Channel) -> Followed | None:
    turning = is_turning_input(name)
    order, reached = _without_gaps(order, reached)
    read_s = min(max(reached.interval_s, 0.02), 1.0)
    step_s = read_s / math.ceil(read_s / FINE_S)
    first, last = max(order.time_s[0], reached.time_s[0]), min(order.time_s[-1], reached.time_s[-1])
    if not last - first > 10 * read_s:
        return None
    times = np.arange(first, last, step_s)
    wanted = order.values if not turning else np.unwrap(order.values)
    seen = reached.values if not turning else np.unwrap(reached.values)
    stamp = np.maximum(np.searchsorted(order.time_s, times + 1e-9, side="right") - 1, 0)
    orders = wanted[stamp]
    changes = np.flatnonzero(np.abs(np.diff(orders)) > MOVED * max(np.ptp(orders), 1e-12)) + 1
    moves = int((np.diff(changes, prepend=-10) > round(read_s / step_s)).sum())
    if moves < FEWEST_MOVES:
        return None
    after = round(AFTER_S / step_s)
    near = np.zeros(len(times), dtype=bool)
    for change in changes:
        near[max(0, change - after // 4) : change + after] = True
    cut = int(np.flatnonzero(near)[:MOST_SAMPLES][-1]) + 1
    changes = changes[changes < cut]
    inside = (reached.time_s >= first) & (reached.time_s <= times[cut - 1])
    read, positions = reached.time_s[inside], seen[inside]
    by = near[np.clip(np.searchsorted(times, read, side="right") - 1, 0, cut - 1)]
    at_order = np.interp(read, times[:cut], orders[:cut])
    offset = float(np.median((positions - at_order)[~by])) if (~by).sum() > 20 else 0.0
    speed = np.abs(np.diff(positions)) / np.maximum(np.diff(read), 1e-9)
    fastest = float(np.quantile(speed[speed > 0.05 * speed.max()], 0.9)) if speed.any() else math.inf
    begin, noise = positions[0] - offset, max(white_noise(positions), step_of(positions) / math.sqrt(12.0))
    noise = max(noise, 1e-6 * float(np.ptp(positions)))
    read, positions = read[by], positions[by]
    own = np.maximum(np.searchsorted(times[changes], read, side="right") - 1, 0)  # the move that a reading follows
    # an order that is read at even times was given up to a step before; how much before each is sought beside
    steps = np.diff(order.time_s)
    even = float((np.abs(steps - np.median(steps)) < 0.2 * np.median(steps)).mean()) > EVEN
    spread_s = max(order.interval_s if even else 0.0, step_s) / math.sqrt(12.0)
    bound = (noise / spread_s) ** 2

    def placed(values: Array, free: tuple[str, ...]) -> tuple[Array, Array, Array]:
        """Errors of the readings, and of each move how early it was given [s] and what share of that they tell."""
        given = dict(zip(free, values.tolist(), strict=True))
        rate = math.exp(given["rate"]) if "rate" in given else math.inf
        at = simulated(orders[:cut], step_s, rate, given.get("lag", 0.0), given.get("delay", 0.0), begin) + offset
        change = np.gradient(at, step_s)
        early, told = np.zeros(len(changes)), np.zeros(len(changes))
        for _ in range(SHIFTS):
            error = np.interp(read + early[own], times[:cut], at) - positions
            slope = np.interp(read + early[own], times[:cut], change)
            down, steep = (np.bincount(own, slope * part, len(changes)) for part in (error, slope))
            early = early - (down + bound * early) / (steep + bound)
            told = steep / (steep + bound)
        return np.interp(read + early[own], times[:cut], at) - positions, early, told

    def left(values: Array, free: tuple[str, ...]) -> Array:
        error, early, _ = placed(values, free)
        return np.concatenate([error, math.sqrt(bound) * early])

    start = {"rate": math.log(fastest), "lag": max(step_s, 0.3), "delay": step_s}
    least = {"rate": math.log(fastest) - 2.0, "lag": 0.0, "delay": -order.interval_s - step_s}

    def fit(free: tuple[str, ...]) -> Any:
        high = [math.log(fastest) + 3.0 if part == "rate" else LONGEST_S for part in free]
        return scipy.optimize.least_squares(
            left, [start[part] for part in free], bounds=([least[part] for part in free], high), args=(free,),
            diff_step=1e-3, x_scale=[0.1 if part == "rate" else read_s for part in free],
        )  # fmt: skip

    moved = np.concatenate([own, np.arange(len(changes))])
    free: tuple[str, ...] = ("rate", "lag", "delay")
    best, plain = fit(free), fit(("lag", "delay"))
    if best.cost > LESS**2 * plain.cost:
        best, free = plain, ("lag", "delay")
    std = dict(zip(free, _by_moves(best.jac, best.fun, moved).tolist(), strict=True))
    if "rate" in free and best.x[1] < max(CERTAIN * std["lag"], NO_LAG * read_s):
        best, free = fit(("rate", "delay")), ("rate", "delay")
        std = dict(zip(free, _by_moves(best.jac, best.fun, moved).tolist(), strict=True))
    value = dict(zip(free, best.x.tolist(), strict=True))
    late_s = float(np.mean(times[changes] - order.time_s[stamp[changes]]))  # by the steps of the fit
    _, early, known = placed(best.x, free)
    one_clock = even and _go_together(early, known, spread_s)
    value["delay"] += late_s + (order.interval_s / 2.0 if even and not one_clock else 0.0)
    std["delay"] = math.hypot(std["delay"], spread_s / math.sqrt(moves) if one_clock is not None else spread_s)
    fine = max(order.interval_s, reached.interval_s) <= COARSEST_S
    rate = math.exp(value["rate"]) if "rate" in value else math.inf

    def told(part: str) -> tuple[float, float] | None:
        return (value[part], std[part]) if fine and part in value and value[part] > CERTAIN * std[part] else None

    return Followed(
        signal=name.removesuffix("_rps").removesuffix("_rad"),
        rate=(rate, rate * std["rate"]) if math.isfinite(rate) else None,
        lag_s=told("lag"), delay_s=told("delay"), offset=offset, moves=moves,
        rest=float(np.sqrt(2 * best.cost / max(len(read), 1))),
    )  # fmt: skip


def _go_together(early: Array, known: Array, spread_s: float) -> bool | None:
    """Whether all moves were given as long before their readings; None where the readings do not tell.

    Args:
        early: (k,) how long before its reading each move was given [s].
        known: (k,) share of that which readings tell, from 0 to 1; the rest is what is expected.
        spread_s: standard deviation of moments anywhere between two readings [s].
    """
    sure = early[known > SURE]
    return None if len(sure) < SURE_MOVES else bool(sure.std() < TOGETHER * spread_s)


def _by_moves(jacobian: Array, left: Array, move: NDArray[np.signedinteger[Any]]) -> Array:
    """(p,) standard errors of least squares whose residuals go together from one move of the order to the next.

    The covariance of clusters (Liang and Zeger, 1986), as leaving each out in turn gives it (Bell and McCaffrey, 2002).
    """
    bread = covariance_of(jacobian.T @ jacobian)
    scores = np.array([jacobian[move == k].T @ left[move == k] for k in np.unique(move)])
    few = (len(scores) / max(len(scores) - jacobian.shape[1], 1)) ** 2
    together = few * bread @ (scores.T @ scores) @ bread
    alone = bread * float(left @ left) / max(len(left) - jacobian.shape[1], 1)
    return np.asarray(np.sqrt(np.maximum(np.diag(together), np.diag(alone))))


def simulated(orders: Array, step_s: float, rate: float, lag_s: float, delay_s: float, start: float) -> Array:
    """(k,) position that is delivered of orders (k,), each held to the next."""
    begins = np.flatnonzero(np.diff(orders, prepend=np.nan) != 0)  # of each order that stands
    lasts = np.diff(begins, append=len(orders))
    reach, position, at = min(rate * step_s, LARGEST), start, []
    for order, steps in zip(orders[begins].tolist(), lasts.tolist(), strict=True):
        at.append(position)
        way = order - position
        position = order if abs(way) <= steps * reach else position + math.copysign(steps * reach, way)
    from_there, way_left = np.repeat(at, lasts), np.repeat(orders[begins] - at, lasts)
    gone = reach * (np.arange(len(orders)) - np.repeat(begins, lasts))
    slewed = from_there + np.clip(way_left, -gone, gone)
    if delay_s:  # also one that is negative
        times = step_s * np.arange(len(orders))
        slewed = np.interp(times - delay_s, times, slewed)
    if lag_s > 0:
        done = -math.expm1(-step_s / lag_s)
        before = done * lag_s / step_s - 1.0 + done  # between samples the position goes straight
        slewed = scipy.signal.lfilter([done - before, before], [1.0, done - 1.0], slewed - start) + start
    return slewed
