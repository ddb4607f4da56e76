"""Effects that are found by trying values, as the likelihood has corners or plateaus in them, and how surely.

Between two sizes of command that occur, any width of a dead band explains the data alike; a time of change is known to
within what the ship does meanwhile. So the value is the middle of all those that are nearly as likely as the best, and
its standard error half their width, everything else moved to its best for each (profile likelihood).

Source: D. R. Cox and D. Oakes, Analysis of Survival Data (1984), section 3.3, for intervals from profiles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.diagnosis.fit import Fit, answers, fit, profile_cost
from expdesign.diagnosis.model import linearise, simulate_windows
from expdesign.diagnosis.select.contenders import Contender, gain_over

POINTS, ROUNDS = 9, 9
ALIKE = 1.0
"""Twice the log likelihood that values may lack to count as alike: within one standard error of a Gaussian one."""
WITHIN = 3
"""So many values alike settle the search."""


def sharpened(chosen: Contender, base: Fit) -> Contender:
    """A contender with its searched number at the middle of what is likely; others are returned as they are.

    Args:
        chosen: fitted, best of its round.
        base: the fit without it.
    """
    if chosen.searched is None or not chosen.searched[1] > 0:
        return chosen
    key, std = chosen.searched
    found, std = middle(chosen.fit, key, std)
    gain = gain_over(base, found, found)
    return replace(chosen, fit=found, searched=(key, std), gain=gain, worth=gain - (chosen.gain - chosen.worth))


def middle(found: Fit, key: str, std: float) -> tuple[Fit, float]:
    """A fit with one of its fixed numbers where it is likeliest beside all others, and its standard error.

    Args:
        found: converged with that number where it is.
        key: which.
        std: a guess of its standard error.
    """
    centre, span = found.value(key), 4.0 * std
    costs: dict[float, float] = {}
    low = high = centre
    for _ in range(ROUNDS):
        values = centre + span * np.linspace(-1.0, 1.0, POINTS)
        for value in values.tolist():
            if value not in costs:
                costs[value] = _cost(found, key, value)
        least = min(costs.values())
        alike = [value for value, cost in costs.items() if cost < least + ALIKE]
        low, high, best = min(alike), max(alike), min(costs, key=lambda value: costs[value])
        spacing = 2.0 * span / (POINTS - 1)
        if best in (values[0], values[-1]):
            centre = best
        elif low <= values[0] or high >= values[-1]:  # a plateau that goes on beyond
            centre, span = (low + high) / 2, 2.5 * span
        elif sum(low <= value <= high for value in values) >= WITHIN:
            break
        else:
            centre, span = (low + high) / 2, (high - low) / 2 + spacing
    settled = fit(
        found.ship.having({key: (low + high) / 2}), found.linear.motion.windows, found.keys[: found.free],
        starts=found.starts, noise=found.noise, colour_order=found.noise.order, near=found.linear,
    )  # fmt: skip
    return settled, (high - low + spacing) / 2


def _cost(found: Fit, key: str, value: float) -> float:
    """Twice the negative log likelihood with that value, all other numbers at their best in the linear model."""
    windows = found.linear.motion.windows
    ship = found.ship.having({key: value})
    motion = simulate_windows(ship, windows, found.starts, near=found.linear)
    if motion.diverged:
        return np.inf
    linear = linearise(motion)
    columns = answers(linear, found.keys)
    if columns.lost:
        return np.inf
    return profile_cost(replace(found, ship=ship, linear=linear, columns=columns), found.noise)
