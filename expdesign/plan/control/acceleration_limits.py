"""How fast a vessel can change its speed at most where a leg begins or ends, and what that loses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.memory import recalled
from expdesign.simulation import Environment
from expdesign.values import Array, sealed
from expdesign.vessel import NUMPY, Vessel

SPEED_BANDS = 12  # with a largest acceleration each
# of the time in which actuators get from nothing to full; until then they reach only so far
STAGE_SHARES = (0.1, 0.2, 0.35, 0.6, 1.0)
DRAWN_MOTIONS = 240  # motions and commands drawn for each band and stage
REFINEMENTS, REFINED_MOTIONS = 5, 12  # rounds in which the best of them are varied, and how many are
RATE_MARGIN = 1.1  # factor on the largest rates found, for what the search may have missed
# step of time, in the actuators' time from nothing to full, and their largest number
LOSS_STEP, LOSS_STEPS = 0.01, 3000


@sealed(edges_mps="e", until_s="s", faster_mps2="s k", slower_mps2="s k")
class SpeedChanges:
    """Largest rates of change of speed after commands that stood, or before commands that will."""

    edges_mps: Array  # (k + 1,) speeds between bands, from 0 to that of the fastest leg
    until_s: Array  # (s,) ends of stages, the last infinite
    # faster_mps2, slower_mps2: (s, k) largest rates, both positive
    faster_mps2: Array
    slower_mps2: Array

    @property
    def mean_mps2(self) -> float:
        """Mean over all speeds of the largest rate at which speed was found to grow, actuators being anywhere."""
        return float(self.faster_mps2[-1].mean()) / RATE_MARGIN

    def most(self, speed_mps: float, time_s: Array) -> Array:
        """(n,) largest speed at even times (n,) after the given speed, or before it."""
        return self._followed(speed_mps, time_s, self.faster_mps2, 1.0)

    def least(self, speed_mps: float, time_s: Array) -> Array:
        """(n,) least speed at even times (n,) after the given speed, or before it."""
        return self._followed(speed_mps, time_s, self.slower_mps2, -1.0)

    def reversed(self) -> SpeedChanges:
        """The changes backwards in time."""
        return SpeedChanges(
            edges_mps=self.edges_mps,
            until_s=self.until_s,
            faster_mps2=self.slower_mps2,
            slower_mps2=self.faster_mps2,
        )

    def _followed(self, speed: float, time_s: Array, rates: Array, sign: float) -> Array:
        # a step may lead into the next band: the larger rate of both counts
        further = np.c_[rates[:, 1:], rates[:, -1:]] if sign > 0 else np.c_[rates[:, :1], rates[:, :-1]]
        step_s, top, bands = float(time_s[1] - time_s[0]), float(self.edges_mps[-1]), rates.shape[1]
        changes = (sign * np.maximum(rates, further) * step_s).tolist()
        now = min(speed, top)
        speeds = [now]
        for stage in np.searchsorted(self.until_s, time_s[1:], side="left").tolist():
            now += changes[stage][min(int(now / top * bands), bands - 1)]
            now = 0.0 if now < 0.0 else min(now, top)
            speeds.append(now)
        return np.array(speeds)


@dataclass(frozen=True, kw_only=True, eq=False)
class LegEnd:
    """Where a leg begins or ends."""

    # slowest_mps, fastest_mps: through water
    slowest_mps: float
    fastest_mps: float
    inputs: Array | None  # (m,) commands before it begins, or after it has ended, nan for any; None for any at all
    changes: SpeedChanges  # of speed, in the leg's direction of time


def leg_end(
    vessel: Vessel,
    environment: Environment,
    speed_mps: float,
    inputs: Array | None,
    *,
    top_mps: float,
    yaw_rate_radps: float,
) -> LegEnd:
    """An end of legs, with the fastest changes of speed through water found among motions and commands, a tenth added.

    They are looked for by drawing them, half of the commands at a limit, and by varying the best. Commands move no
    faster than their rates from those at the end. Actuators that answer late may still show others: then any count.

    Args:
        speed_mps, inputs: at the end; nan where a command may be anything.
        top_mps: speed of the fastest leg.
        yaw_rate_radps: no turn is faster.
    """
    edges = np.linspace(0.0, top_mps, SPEED_BANDS + 1)
    until_s, boxes = _boxes(vessel, inputs)
    wind = float(np.hypot(*(environment.wind_to - environment.current_to)))
    found = [recalled(_most, vessel, boxes, edges, wind, yaw_rate_radps, sign) for sign in (1.0, -1.0)]
    least = 1e-3 * max(rate.max() for rate in found)  # a band that nothing passes through costs much, but not all
    faster, slower = (RATE_MARGIN * np.maximum(rate, least) for rate in found)
    changes = SpeedChanges(edges_mps=edges, until_s=until_s, faster_mps2=faster, slower_mps2=slower)
    return LegEnd(slowest_mps=speed_mps, fastest_mps=speed_mps, inputs=inputs, changes=changes)


def to_work_s(vessel: Vessel) -> float:
    """Time of the slowest actuator from nothing to full, of those without limits over a quarter turn [s]."""
    reach = [max(abs(limit.low), abs(limit.high)) for limit in vessel.limits]
    rates: list[float] = vessel.rates.tolist()
    times = [(far if np.isfinite(far) else np.pi / 2) / rate for far, rate in zip(reach, rates, strict=True)]
    return max([*times, vessel.sample_time_s])


def _boxes(vessel: Vessel, inputs: Array | None) -> tuple[Array, Array]:
    """Ends of stages (s,) [s], the last infinite, and least and largest commands until then (s, 2, m)."""
    limited = np.isfinite([limit.high - limit.low for limit in vessel.limits])
    low, high = (
        np.where(limited, [getattr(x, name) for x in vessel.limits], far)
        for name, far in (("low", -np.pi), ("high", np.pi))
    )
    if inputs is None or not all(response.follows for response in vessel.responses):
        return np.array([np.inf]), np.stack([low, high])[None]
    until_s = to_work_s(vessel) * np.array(STAGE_SHARES)
    # a command may move before the first sample of a leg is over
    reach = np.minimum(vessel.rates * (until_s[:, None] + vessel.sample_time_s), np.where(limited, np.inf, np.pi))
    # fmax and fmin take the limit where a command may be anything
    lows = np.where(limited | np.isnan(inputs), np.fmax(inputs - reach, low), inputs - reach)
    highs = np.where(limited | np.isnan(inputs), np.fmin(inputs + reach, high), inputs + reach)
    return np.r_[until_s, np.inf], np.concatenate([np.stack([lows, highs], axis=1), np.stack([low, high])[None]])


def _most(vessel: Vessel, boxes: Array, edges: Array, wind_mps: float, yaw_rate_radps: float, sign: float) -> Array:
    """(s, k) largest rate of change of speed found in each stage and band, faster or slower."""
    rng = np.random.default_rng(0)
    shares = rng.uniform(-0.5, 1.5, (DRAWN_MOTIONS, len(boxes), len(edges) - 1, 4 + boxes.shape[-1]))
    shares[..., :4] = (shares[..., :4] + 0.5) / 2
    shares = shares.clip(0.0, 1.0)
    most = np.full(shares.shape[1:3], -np.inf)
    for spread in 0.3 * 0.5 ** np.arange(REFINEMENTS):
        rates = sign * _rates(vessel, shares, boxes, edges, wind_mps, yaw_rate_radps)
        most = np.maximum(most, rates.max(axis=0))
        order = np.argpartition(-rates, REFINED_MOTIONS, axis=0)[:REFINED_MOTIONS]
        best = np.take_along_axis(shares, order[..., None], axis=0)
        varied = np.repeat(best, DRAWN_MOTIONS // REFINED_MOTIONS, axis=0)
        shares = (varied + spread * rng.standard_normal(varied.shape)).clip(0.0, 1.0)
    rates = sign * _rates(vessel, shares, boxes, edges, wind_mps, yaw_rate_radps)
    most = np.maximum(most, rates.max(axis=0))
    return np.asarray(np.maximum.accumulate(most, axis=0))  # what a smaller reach can do, a larger one can


def _rates(vessel: Vessel, shares: Array, boxes: Array, edges: Array, wind_mps: float, yaw_rate_radps: float) -> Array:
    """(n, s, k) rates of change of speed through water, for speed, drift, wind, yaw rate and commands as shares."""
    speed = edges[:-1] + shares[..., 0] * np.diff(edges)
    drift, wind_from = 2 * np.pi * shares[..., 1], 2 * np.pi * shares[..., 2]
    r = yaw_rate_radps * (2 * shares[..., 3] - 1)
    low, high = boxes[:, 0, None], boxes[:, 1, None]
    inputs = tuple(np.moveaxis(low + shares[..., 4:] * (high - low), -1, 0))
    u, v = speed * np.cos(drift), speed * np.sin(drift)
    air = (u - wind_mps * np.cos(wind_from), v - wind_mps * np.sin(wind_from))
    surge, sway, _ = vessel.model.accelerations((u, v, r), air, inputs, NUMPY)
    return np.asarray(surge * np.cos(drift) + sway * np.sin(drift))


def least_loss(firsts: Sequence[LegEnd], lasts: Sequence[LegEnd], vessel: Vessel) -> Array:
    """(n, k, 2) what no leg from each of n ends to each of k falls below.

    That is the distance lost against the fastest leg [m], and the time [s]. The speed at any time is at most what can
    be reached by then and what can still be shed, so the longer a leg, the more is lost: the shortest one counts in
    which the one speed can become the other, and the one command the other.
    """
    step_s = LOSS_STEP * to_work_s(vessel)
    time_s: Array = step_s * np.arange(LOSS_STEPS, dtype=np.float64)
    after = [_speeds(end, end.changes, time_s) for end in firsts]
    before = [_speeds(end, end.changes.reversed(), time_s) for end in lasts]
    losses = np.empty((len(firsts), len(lasts), 2))
    for (row, first), (column, last) in product(enumerate(firsts), enumerate(lasts)):
        moved_s = 0.0 if first.inputs is None or last.inputs is None else _moved_s(vessel, first.inputs, last.inputs)
        count = _steps_to_meet(after[row], before[column], int(moved_s / step_s))
        most, shed = after[row][0], before[column][0]
        sailed_m = step_s * float(np.minimum(most[: count + 1], shed[count::-1]).sum())  # no less than the integral
        least_s = step_s * max(0, count - 1)  # the step before was too short
        losses[row, column] = max(0.0, float(first.changes.edges_mps[-1]) * least_s - sailed_m), least_s
    return losses


def _speeds(end: LegEnd, changes: SpeedChanges, time_s: Array) -> tuple[Array, Array]:
    """Largest and least speeds (n,) at times (n,) from an end."""
    return changes.most(end.fastest_mps, time_s), changes.least(end.slowest_mps, time_s)


def _steps_to_meet(after: tuple[Array, Array], before: tuple[Array, Array], least: int) -> int:
    """Steps until speeds after one end can meet those before another, so many at least."""
    count = min(least, LOSS_STEPS - 1)
    while count < LOSS_STEPS - 1 and not _can_meet(*after, *before, count):
        count += 1
    return count


def _can_meet(fast: Array, slow: Array, shed: Array, kept: Array, count: int) -> bool:
    """Whether speeds from `slow` to `fast` since the beginning meet those from `kept` to `shed` until the end."""
    most, least = np.minimum(fast[: count + 1], shed[count::-1]), np.maximum(slow[: count + 1], kept[count::-1])
    return bool((least <= most + 1e-9).all())


def _moved_s(vessel: Vessel, first: Array, last: Array) -> float:
    """Time in which commands (m,) become others at their rates, less the two samples in which they may stand."""
    turned = np.nan_to_num(np.abs(first - last), nan=0.0)
    turns = ~np.isfinite([limit.high - limit.low for limit in vessel.limits])
    turned[turns] = np.abs(wrap_angle(turned[turns]))
    return max(0.0, float((turned / vessel.rates).max(initial=0.0)) - 2 * vessel.sample_time_s)
