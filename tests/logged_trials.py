"""Trials of a 50 m ship with a rudder of 0.05 rad/s, sailed in steps of 20 ms, as loggers write them."""

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np

from expdesign.signals import Batch
from nomoto_ship import nomoto_ship

SHIP = replace(nomoto_ship(sense=1.0), length_m=50.0)
"""Length, actuators and the side to which the helm turns are all that reading a record takes from a vessel."""
STEP, SPEED, LEAD = 0.02, 3 * math.sqrt(2), 30.0
TEN, TWENTY, FULL = (math.radians(angle) for angle in (10, 20, 35))
APPROACHES = {
    "steady": (LEAD, lambda _: 0.0),
    "from rest": (45.0, lambda time: 0.1 * math.sin(time / 4)),
    "against wind": (60.0, lambda _: math.radians(3.5)),
    "hard helm": (90.0, lambda time: 0.4 * math.sin(time / 3) if time < 56.5 else 0.0),
}
"""Time of the first order [s], and helm [rad] before it."""


def moved(state: tuple[float, ...], rudder: float, time_s: float) -> tuple[float, ...]:
    """North, east, heading, u, v, r a little later, at 3 rps."""
    _, _, heading, u, v, r = state
    c, s = math.cos(heading), math.sin(heading)
    surge = -0.004 * abs(u) * u + 0.008 * 9 + 1.2 * v * r
    yaw = -0.02 * abs(u) * r + 0.0005 * abs(u) * u * math.sin(rudder)
    rates = (u * c - v * s, u * s + v * c, r, surge, -0.02 * abs(u) * v - 0.3 * u * r, yaw)
    return tuple(value + time_s * rate for value, rate in zip(state, rates, strict=True))


@cache
def sailed(
    helm: float, change: float, *, seconds: float = 260.0, orders_every_s: float = STEP, approach: str = "steady"
) -> tuple[np.ndarray, tuple[float, ...]]:
    """(k, 9) time, state, order, rudder, and the times of the orders; a change of heading of inf gives a circle."""
    lead, steered = APPROACHES[approach]
    state = (0.0, 0.0, 0.0, 0.3 if approach == "from rest" else SPEED, 0.0, 0.0)
    order, rudder, side, course = 0.0, 0.0, -1, 0.0
    rows, orders, every = [], [], round(orders_every_s / STEP)
    for k in range(round(seconds / STEP)):
        time = k * STEP
        if time < lead:
            order = steered(time)
        elif k % every == 0 and (not orders or side * (state[2] - course) >= change):
            course = course if orders else state[2]
            side = -side
            order = side * helm
            orders.append(time)
        rows.append((time, *state, order, rudder))
        after = rudder + min(max(order - rudder, -0.05 * STEP), 0.05 * STEP)
        middle = moved(state, rudder, STEP / 2)
        change_of = moved(middle, (rudder + after) / 2, STEP)
        state = tuple(x + b - a for x, a, b in zip(state, middle, change_of, strict=True))
        rudder = after
    return np.array(rows), tuple(orders)


def record(rows: np.ndarray, interval_s: float, column: str = "order", *, first_s: float = 0.0) -> Batch:
    """What a logger without noise writes every `interval_s`, from `first_s` on."""
    kept = rows[round(first_s / STEP) :: round(interval_s / STEP)]
    rudder = kept[:, 7 if column == "order" else 8]
    return Batch(
        name="log.csv",
        sample_time_s=interval_s,
        input_names=("n1", "rudder1"),
        inputs=np.stack([np.full(len(kept), 3.0), rudder], axis=1),
        velocity=kept[:, 4:7],
        pose=kept[:, 1:4],
    )


def overshoots(rows: np.ndarray, orders: tuple[float, ...]) -> np.ndarray:
    """Largest heading after each reversal, less the heading at it [rad]."""
    cuts = [round(time / STEP) for time in (*orders[1:], rows[-1, 0] + STEP)]
    return np.array([(np.sign(rows[a, 3]) * (rows[a:b, 3] - rows[a, 3])).max() for a, b in pairwise(cuts)])
