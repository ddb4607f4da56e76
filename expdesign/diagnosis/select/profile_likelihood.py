"""Profile likelihood of effects whose likelihood has corners or plateaus: widths of dead bands, times of changes.

All widths of a dead band between two recorded command levels explain the data equally well, and so do nearby times of a
change. So the estimate is the middle of all values that are nearly as likely as the best one, and its standard error is
half their range. All other effects are optimised for each value.

Source: D. R. Cox and D. Oakes, Analysis of Survival Data (1984), section 3.3, for intervals from profiles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.diagnosis.fit import (
    Fit,
    continuing,
    fit,
    gram_matrices,
    log_likelihood_gain,
    profile_cost,
    sensitivities_to,
)
from expdesign.diagnosis.motion import linearise, simulate_windows
from expdesign.diagnosis.select.fitted_candidate import FittedCandidate
from expdesign.diagnosis.select.tuning import TUNING


def with_profile_estimate(chosen: FittedCandidate, base: Fit) -> FittedCandidate:
    """A candidate with its profiled effect at the profile estimate; candidates without one are returned unchanged.

    Args:
        chosen: fitted, best of its round.
        base: the fit without it.
    """
    if chosen.profiled is None or not chosen.profiled[1] > 0:
        return chosen
    key, std = chosen.profiled
    found, std = profile_estimate(chosen.fit, key, std)
    return replace(chosen, fit=found, profiled=(key, std)).with_gain(log_likelihood_gain(base, found))


def profile_estimate(found: Fit, key: str, std: float) -> tuple[Fit, float]:
    """A fit with one held effect at its profile estimate, and the standard error of that effect.

    Args:
        found: converged with that effect held.
        key: the effect.
        std: a guess of its standard error.
    """
    centre, span, limits = found.value(key), 4.0 * std, _limits(found, key)
    costs: dict[float, float] = {}
    low = high = centre
    for _ in range(TUNING.profile_rounds):
        values = np.clip(centre + span * np.linspace(-1.0, 1.0, TUNING.profile_points), *limits)
        for value in values.tolist():
            if value not in costs:
                costs[value] = _cost(found, key, value)
        least = min(costs.values())
        likely = [value for value, cost in costs.items() if cost < least + TUNING.equivalent_cost]
        low, high, best = min(likely), max(likely), min(costs, key=lambda value: costs[value])
        spacing = 2.0 * span / (TUNING.profile_points - 1)
        if best in (values[0], values[-1]) and best not in limits:
            centre = best
        elif (low <= values[0] > limits[0]) or (
            high >= values[-1] < limits[1]
        ):  # the plateau continues beyond these values
            centre, span = (low + high) / 2, 2.5 * span
        elif sum(low <= value <= high for value in values) >= TUNING.equivalent_values:
            break
        else:
            centre, span = (low + high) / 2, (high - low) / 2 + spacing
    ship, windows = found.ship.with_effects({key: (low + high) / 2}), found.linear.motion.windows
    at_middle = fit(ship, windows, found.free_keys, starts=found.starts, options=continuing(found))
    return at_middle, (high - low + spacing) / 2


def _limits(found: Fit, key: str) -> tuple[float, float]:
    """Least and greatest possible value: of a time, those of its run."""
    if key != "change:time":
        return found.ship.bounds(key)
    windows = found.linear.motion.windows
    _, begin, length = windows.place(found.value(key))
    return begin + windows.sample_s, begin + length - windows.sample_s


def _cost(found: Fit, key: str, value: float) -> float:
    """Twice the negative log likelihood at a value, minimised over all other effects of the linear model."""
    ship = found.ship.with_effects({key: value})
    motion = simulate_windows(ship, found.linear.motion.windows, found.starts, warm_start=found.linear)
    if motion.diverged:
        return np.inf
    linear = linearise(motion)
    sensitivities = sensitivities_to(linear, found.keys)
    if sensitivities.unbounded:
        return np.inf
    grams = gram_matrices(sensitivities, found.noise)
    moved = replace(found, ship=ship, linear=linear, sensitivities=sensitivities, grams=grams)
    return profile_cost(moved, found.noise)
