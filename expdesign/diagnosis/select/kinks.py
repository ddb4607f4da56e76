"""Standard errors of effects that cannot be below zero, where the likelihood is no parabola.

A time, a width or a growth with depth acts from zero on. Near zero it may act not at all: no recorded command is fast
enough for a slew time, or several values explain the data alike. There the curvature at the estimate tells nothing, and
what follows from it is far too small or far too large. So the likelihood is followed to both sides, all other effects
fitted again, to the ends of the interval of 95 %, and the standard error is that of the interval's wider side: two of
them hold the whole interval, also one that ends at zero. The other effects are as unsure beside it as their estimates
move on that way (law of total variance).

Source: D. R. Cox and D. Oakes, Analysis of Survival Data (1984), section 3.3, for intervals from profiles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis.fit import Fit, continuing, fit, marginalised, profile_cost
from expdesign.diagnosis.select.selection import Selection
from expdesign.estimation.solve import Dispersion, few_runs_factor
from expdesign.own_units import covariance_of
from expdesign.values import Array
from expdesign.vessel.quantities import EFFECTS

FROM_ZERO = tuple(kind for kind, row in EFFECTS.items() if row.low == 0.0)
"""Kinds of effects that begin at zero."""
ALIKE = 2.0
"""Factor of a parabola's rise within which the rise of the cost is taken for that of one."""
RISE_95, STDS_95 = 3.84, 1.96
"""Rise of the cost at the ends of an interval of 95 %, and how many standard errors away these are of a parabola."""
STEPS = 3  # Gauss-Newton steps of the other effects
DOUBLINGS, HALVINGS = 12, 3  # of a step that is to reach the end of the interval, and between its last two values
LEAST_SHARE, LEAST = 0.05, 1e-3  # first step as a share of the value, and at least


@dataclass(frozen=True, kw_only=True, eq=False)
class End:
    """An end of an interval, or a bound before it."""

    value: float  # of the effect
    others: Array  # (c - 1,) estimates of the other effects there


def with_honest_errors(found: Selection) -> Selection:
    """The selection with standard errors of its last fit that do not rest on a curvature which there is not."""
    last = found.last
    for key in last.free_keys:
        if key.split(":")[0] in FROM_ZERO:
            last = with_profiled_error(last, key, found.dispersion)
    return replace(found, last=last)


def with_profiled_error(found: Fit, key: str, known: Dispersion) -> Fit:
    """A fit with the standard error of a free effect from its profile likelihood, where that is no parabola.

    Args:
        found: with standard errors that count how runs differ.
        known: what estimates differ by between runs.
    """
    factor, freedom = known.alone
    likely = RISE_95 * factor * float(few_runs_factor(freedom)) ** 2
    profile = _Profile(found, key)
    if profile.is_parabola():
        return found
    value = found.value(key)
    ends = [profile.end(way, likely) for way in (-1.0, 1.0)]
    far = max(ends, key=lambda end: abs(end.value - value))
    distance = abs(far.value - value)
    if not distance > 0.0:
        return found
    return replace(found, covariance=_beside(found, key, distance / STDS_95, (far.others - profile.others) / distance))


def _beside(found: Fit, key: str, std: float, slopes: Array) -> Array:
    """(c, c) covariance where one effect has another standard error, and others move with it by slopes (c - 1,)."""
    place, covariance = found.keys.index(key), found.covariance
    others = np.delete(np.arange(len(found.keys)), place)
    own, shared = covariance[place, place], covariance[others, place]
    held = covariance[np.ix_(others, others)] - (np.outer(shared, shared) / own if own > 0.0 else 0.0)
    result = np.empty_like(covariance)
    result[np.ix_(others, others)] = held + std**2 * np.outer(slopes, slopes)
    result[others, place] = result[place, others] = std**2 * slopes
    result[place, place] = std**2
    return result


class _Profile:
    """Cost along one effect: twice the negative log likelihood, the others fitted."""

    def __init__(self, found: Fit, key: str) -> None:
        """From a fit, along one of its effects."""
        self._found, self._key = found, key
        self._others = tuple(other for other in found.keys if other != key)
        self._known: dict[float, tuple[float, Array]] = {}
        self.least, self.others = self._at(found.value(key))

    def _at(self, value: float) -> tuple[float, Array]:
        """Cost at a value, and estimates of the other effects; infinite where the ship cannot be simulated."""
        if value not in self._known:
            found = self._found
            free = tuple(key for key in found.free_keys if key != self._key)
            stated_std = {key: std for key, std in found.ship.stated_std.items() if key != self._key}
            ship = replace(found.ship.with_effects({self._key: value}), stated_std=stated_std)
            windows, options = found.linear.motion.windows, continuing(found, steps=STEPS)
            try:
                near = fit(ship, windows, free, starts=found.starts, options=options)
            except (FloatingPointError, np.linalg.LinAlgError):
                return np.inf, self.others
            others = np.array([near.value(key) for key in self._others])
            self._known[value] = profile_cost(near, found.noise), others
        return self._known[value]

    def is_parabola(self) -> bool:
        """Whether the cost rises two standard errors away, or at a bound before, about as the curvature says."""
        found, place = self._found, self._found.keys.index(self._key)
        information = marginalised(found.grams, found.sensitivities, found.noise).A + found.precision
        std = float(np.sqrt(covariance_of(information)[place, place]))
        value, (low, high) = found.value(self._key), found.ship.bounds(self._key)
        ends = [end for end in (max(value - 2.0 * std, low), min(value + 2.0 * std, high)) if abs(end - value) > std]
        rises = [(self._at(end)[0] - self.least) / ((end - value) / std) ** 2 for end in ends]
        return bool(ends) and all(1.0 / ALIKE < rise < ALIKE for rise in rises)

    def end(self, way: float, likely: float) -> End:
        """Where the cost has risen by as much as is likely, on one side, or the bound before."""
        value, limits = self._found.value(self._key), self._found.ship.bounds(self._key)
        bound = limits[0] if way < 0 else limits[1]
        inside, step = value, max(LEAST_SHARE * value, LEAST)
        for _ in range(DOUBLINGS):
            outside = float(np.clip(value + way * step, *limits))
            if self._rise(outside) > likely:
                break
            inside, step = outside, 2.0 * step
            if inside == bound:
                break
        else:
            outside = inside
        for _ in range(HALVINGS if inside != outside else 0):
            middle = (inside + outside) / 2
            inside, outside = (middle, outside) if self._rise(middle) <= likely else (inside, middle)
        return End(value=outside, others=self._at(inside)[1])

    def _rise(self, value: float) -> float:
        """Of the cost above its least value so far: the estimate need not be the likeliest value."""
        cost = self._at(value)[0]
        self.least = min(self.least, cost)
        return cost - self.least
