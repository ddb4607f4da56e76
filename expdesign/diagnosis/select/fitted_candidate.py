"""Candidates fitted together with the findings so far, their likelihood gains, and profiles of their likelihoods."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import (
    Fit,
    FitOptions,
    continuing,
    fit,
    gram_matrices,
    likeliest,
    log_likelihood_gain,
    of_several,
    profile_cost,
    sensitivities_to,
    tail,
)
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import linearise, simulate_windows
from expdesign.diagnosis.select.starting_point import StartingPoint, joint_keys, start_nearer
from expdesign.diagnosis.select.tuning import TUNING

PROFILE_POINTS, PROFILE_ROUNDS = 9, 9  # values per round of a profile likelihood, and rounds, at most
EQUIVALENT_COST = 1.0  # values of a profile count as equally likely up to this cost: one standard error of a Gaussian
EQUIVALENT_VALUES = 3  # this many equally likely values in a round end the search


# Candidates fitted together with the findings so far, and their likelihood gains.


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedCandidate:
    """A candidate fitted together with the findings so far."""

    candidate: Candidate  # the candidate
    fit: Fit  # of all windows
    likelihood_gain: float  # likelihood ratio statistic against the fit without it
    penalised_gain: float  # the same less the price of its effects
    keys: tuple[str, ...]  # its own estimated effects
    # the effect that a grid or a profile likelihood found, with its standard error
    profiled: tuple[str, float] | None = None
    multiplicity: float = 1.0  # number of independent tests that it is among

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that it changes, by most standard errors first."""
        changes = {
            key.split(":", 1)[1]: abs(self.fit.value(key)) / max(self.fit.std(key), 1e-300)
            for key in self.keys
            if key.startswith("theta:")
        }
        return tuple(sorted(changes, key=lambda name: -changes[name]))

    @property
    def is_block(self) -> bool:
        """Whether it is several parameters at once."""
        return self.candidate.cause == "parameters" and len(self.keys) > 1

    @property
    def numbers(self) -> int:
        """How many it takes from the data."""
        return len(self.keys) + (self.profiled is not None)

    @property
    def p_value(self) -> float:
        """Of the likelihood ratio test, adjusted for multiple tests."""
        return of_several(tail(max(self.likelihood_gain, 0.0), max(1, len(self.keys))), self.multiplicity)

    def with_gain(self, likelihood_gain: float) -> FittedCandidate:
        """The same with another gain at the same price."""
        price = self.likelihood_gain - self.penalised_gain
        return replace(self, likelihood_gain=likelihood_gain, penalised_gain=likelihood_gain - price)


@dataclass(frozen=True, kw_only=True, eq=False)
class Rival:
    """Another candidate that explains the data nearly as well."""

    candidate: Candidate  # the candidate
    ship: ExtendedModel  # with its effects fitted
    trails_by: float  # penalised gain of the chosen candidate less its own


def kind_of(candidate: Candidate) -> tuple[str, frozenset[str]]:
    """Its cause, and the kinds of its effects: an offset of angles and a moment of thrust are answers of their own."""
    return candidate.cause, frozenset(key.split(":")[0] for key in candidate.free)


def fit_candidate(
    base: Fit, windows: Windows, point: StartingPoint, *, far: bool = False, steps: int = FitOptions().steps
) -> FittedCandidate | None:
    """Fit a candidate together with the findings so far; None if that fails.

    A random current of the noise that was estimated without a steady one holds most of it, and as long as it stays the
    steady one gains little: the noise is estimated from white noise on, too.

    Args:
        base: the fit without it.
        far: the effect is large, so begin in windows of middle length.
    """
    try:
        nearby = base.ship.with_effects(point.effects), base.starts
        ship, starts = start_nearer(base, windows, point) if far else nearby
        keys, options = joint_keys(base, point.keys), continuing(base, steps=steps)
        found = fit(ship, windows, keys, starts=starts, options=options)
        if base.noise.current_std_mps and any(key.startswith("current:") for key in point.keys):
            anew = fit(ship, windows, keys, starts=starts, options=FitOptions(steps=steps, warm_start=base))
            found = min(found, anew, key=lambda item: item.deviance)
        gain = log_likelihood_gain(base, found)
    except (FloatingPointError, np.linalg.LinAlgError):
        return None
    estimated = len(point.keys) + (point.profiled is not None)
    return FittedCandidate(
        candidate=point.test.candidate,
        fit=found,
        likelihood_gain=gain,
        penalised_gain=gain - TUNING.price * estimated,
        keys=point.keys,
        profiled=point.profiled,
        multiplicity=point.test.multiplicity,
    )


def fit_to_convergence(base: Fit, windows: Windows, rough: FittedCandidate) -> FittedCandidate:
    """The same candidate with its fit continued."""
    if rough.fit.converged:
        return rough
    try:
        options = continuing(rough.fit)
        found = fit(rough.fit.ship, windows, rough.fit.free_keys, starts=rough.fit.starts, options=options)
    except (FloatingPointError, np.linalg.LinAlgError):
        return rough
    return replace(rough, fit=found).with_gain(log_likelihood_gain(base, found))


def with_noise_begun_anew(base: Fit, windows: Windows, chosen: FittedCandidate) -> FittedCandidate:
    """The same candidate with the noise estimated from white noise on, where that is likelier.

    Noise that was estimated without an effect holds some of it for slow noise. A fit that continues from there may stay
    where the effect is too small.
    """
    found = chosen.fit
    try:
        anew = fit(found.ship, windows, found.free_keys, starts=found.starts)
    except (FloatingPointError, np.linalg.LinAlgError):
        return chosen
    if likeliest([found, anew]) is found:
        return chosen
    return replace(chosen, fit=anew).with_gain(log_likelihood_gain(base, anew))


def ranked_by_gain(base: Fit, fitted: Sequence[FittedCandidate]) -> list[FittedCandidate]:
    """Candidates by penalised gain, all under the noise of the likeliest."""
    noise = likeliest([base, *(item.fit for item in fitted)]).noise
    without = profile_cost(base, noise)
    results = [item.with_gain(without - profile_cost(item.fit, noise)) for item in fitted]
    return sorted(results, key=lambda item: -item.penalised_gain)


# Profile likelihood of effects whose likelihood has corners or plateaus: widths of dead bands, times of changes.
#
# All widths of a dead band between two recorded command levels explain the data equally well, and so do nearby times of
# a change. So the estimate is the middle of all values that are nearly as likely as the best one, and its standard
# error is half their range. All other effects are optimised for each value.
#
# Source: D. R. Cox and D. Oakes, Analysis of Survival Data (1984), section 3.3, for intervals from profiles.


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
        std: a guess of its standard error.
    """
    centre, span, limits = found.value(key), 4.0 * std, _limits(found, key)
    costs: dict[float, float] = {}
    low = high = centre
    for _ in range(PROFILE_ROUNDS):
        values = np.clip(centre + span * np.linspace(-1.0, 1.0, PROFILE_POINTS), *limits)
        for value in values.tolist():
            if value not in costs:
                costs[value] = _cost(found, key, value)
        least = min(costs.values())
        likely = [value for value, cost in costs.items() if cost < least + EQUIVALENT_COST]
        low, high, best = min(likely), max(likely), min(costs, key=lambda value: costs[value])
        spacing = 2.0 * span / (PROFILE_POINTS - 1)
        if best in (values[0], values[-1]) and best not in limits:
            centre = best
        elif (low <= values[0] > limits[0]) or (
            high >= values[-1] < limits[1]
        ):  # the plateau continues beyond these values
            centre, span = (low + high) / 2, 2.5 * span
        elif sum(low <= value <= high for value in values) >= EQUIVALENT_VALUES:
            break
        else:
            centre, span = (low + high) / 2, (high - low) / 2 + spacing
    ship, windows = found.ship.with_effects({key: (low + high) / 2}), found.linear.motion.windows
    with suppress(FloatingPointError, np.linalg.LinAlgError):  # between likely values: the one that was found stays
        found = fit(ship, windows, found.free_keys, starts=found.starts, options=continuing(found))
    return found, (high - low + spacing) / 2


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
