"""How an actuator follows its order, where both are recorded: slew rate, lag and dead time.

    x' = clip((order - x) / 0, -rate, rate)     the position that slews towards the order
    reached(t) + lag reached'(t) = x(t - delay) + offset

which is the response of vessel files (`expdesign.vessel.Response`), fitted to the readings by least squares.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from expdesign.importing.channels import Channel
from expdesign.records.file import REACHED, is_input, is_turning_input
from expdesign.values import Array

MOST_SAMPLES = 12_000
FEWEST_MOVES = 3
MOVED = 0.05  # share of the range by which an order must change to count
AFTER_S = 20.0  # of readings after a change of the order that are used, beside as long before
LONGEST_S = 10.0  # dead time and lag that are sought
CERTAIN = 3.0  # standard errors from zero at which a lag or a dead time is told
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


def _fit(name: str, order: Channel, reached: Channel) -> Followed | None:
    turning = is_turning_input(name)
    step_s = min(max(reached.interval_s, 0.02), 1.0)
    first, last = max(order.time_s[0], reached.time_s[0]), min(order.time_s[-1], reached.time_s[-1])
    if not last - first > 10 * step_s:
        return None
    times = np.arange(first, last, step_s)
    order_step_s = max(order.interval_s, step_s)
    wanted = order.values if not turning else np.unwrap(order.values)
    seen = reached.values if not turning else np.unwrap(reached.values)
    orders = wanted[np.maximum(np.searchsorted(order.time_s, times + 1e-9, side="right") - 1, 0)]
    positions = np.interp(times, reached.time_s, seen)
    changes = np.flatnonzero(np.abs(np.diff(orders)) > MOVED * max(np.ptp(orders), 1e-12)) + 1
    moves = int((np.diff(changes, prepend=-10) > 1).sum())
    if moves < FEWEST_MOVES:
        return None
    after = round(AFTER_S / step_s)
    near = np.zeros(len(times), dtype=bool)
    for change in changes:
        near[max(0, change - after // 4) : change + after] = True
    cut = int(np.flatnonzero(near)[:MOST_SAMPLES][-1]) + 1
    orders, positions, near = orders[:cut], positions[:cut], near[:cut]
    speed = np.abs(np.diff(positions)) / step_s
    fastest = float(np.quantile(speed[speed > 0.05 * speed.max()], 0.9)) if speed.any() else math.inf
    offset = float(np.median((positions - orders)[~near])) if (~near).sum() > 20 else 0.0

    def left(values: Array, free: tuple[str, ...]) -> Array:
        given = dict(zip(free, values.tolist(), strict=True))
        rate = math.exp(given["rate"]) if "rate" in given else math.inf
        own = simulated(orders, step_s, rate, given.get("lag", 0.0), given.get("delay", 0.0), positions[0] - offset)
        return (own + offset - positions)[near]

    start = {"rate": math.log(fastest), "lag": max(step_s, 0.3), "delay": step_s}

    def fit(free: tuple[str, ...]) -> Any:
        # an order is seen up to a step after it was given, so that positions may be sooner than it
        least = {"rate": math.log(fastest) - 2.0, "lag": 0.0, "delay": -order_step_s}
        low = [least[part] for part in free]
        high = [math.log(fastest) + 3.0 if part == "rate" else LONGEST_S for part in free]
        return scipy.optimize.least_squares(
            left, [start[part] for part in free], bounds=(low, high), args=(free,), diff_step=1e-3,
            x_scale=[0.1 if part == "rate" else step_s for part in free],
        )  # fmt: skip

    free: tuple[str, ...] = ("rate", "lag", "delay")
    best, plain = fit(free), fit(("lag", "delay"))
    if best.cost > LESS**2 * plain.cost:
        best, free = plain, ("lag", "delay")
    elif (without := fit(("rate", "delay"))).cost < best.cost / LESS**2:  # a lag may stand for orders between readings
        best, free = without, ("rate", "delay")
    rest = float(np.sqrt(2 * best.cost / max(int(near.sum()), 1)))
    scatter = np.linalg.pinv(best.jac.T @ best.jac) * rest**2
    std = dict(zip(free, np.sqrt(np.maximum(np.diag(scatter), 0.0)).tolist(), strict=True))
    value = dict(zip(free, best.x.tolist(), strict=True))
    # a change between two readings is seen at the second one: a part of a step, over the root of their number
    floor_s = step_s / math.sqrt(12.0 * moves)
    rate = math.exp(value["rate"]) if "rate" in value else math.inf

    # the same, as a share of the time that a usual change takes
    usual_s = (
        float(np.median(np.abs(np.diff(orders))[changes[changes < cut] - 1])) / rate if rate < math.inf else math.inf
    )
    late = order_step_s / math.sqrt(12.0 * moves) / max(usual_s, step_s)

    def told(part: str) -> tuple[float, float] | None:
        own = math.hypot(std.get(part, 0.0), floor_s)
        return (value[part], own) if part in value and value[part] > CERTAIN * own else None

    return Followed(
        signal=name.removesuffix("_rps").removesuffix("_rad"),
        rate=(rate, rate * math.hypot(std["rate"], late)) if math.isfinite(rate) else None,
        lag_s=told("lag"), delay_s=told("delay"), offset=offset, rest=rest, moves=moves,
    )  # fmt: skip


def simulated(orders: Array, step_s: float, rate: float, lag_s: float, delay_s: float, start: float) -> Array:
    """(k,) position that is delivered of orders (k,), each held to the next."""
    position, reach = start, rate * step_s
    slewed = np.empty(len(orders))
    for k, order in enumerate(orders.tolist()):
        slewed[k] = position
        way = order - position
        position = order if abs(way) <= reach else position + math.copysign(reach, way)
    if delay_s:  # also one that is negative
        times = step_s * np.arange(len(orders))
        slewed = np.interp(times - delay_s, times, slewed)
    if lag_s > 0:
        gone = -math.expm1(-step_s / lag_s)
        slewed = scipy.signal.lfilter([0.0, gone], [1.0, gone - 1.0], slewed - start) + start
    return slewed
