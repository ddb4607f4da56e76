"""Results of standard trials with 95 % intervals: of ships that are drawn, each trial with a scatter of its own.

Two trials of one ship differ, and a model of second order misses her by more than its parameters' errors say: it has
no cubes of small drift angles, which decide first overshoots. Both are in `SCATTER`, and so in every interval.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from expdesign.particulars.card import SCATTER, Trial
from expdesign.particulars.trials import Fleet
from expdesign.values import Array
from expdesign.vessel import Vessel

DRAWS = 240  # ships


@dataclass(frozen=True, kw_only=True)
class Expected:
    """A quantity of a trial with its 95 % interval."""

    trial: Trial
    quantity: str
    value: float  # of the nominal ship; infinite, as the others, where the trial has no end
    low: float
    high: float


def interval(value: float, drawn: Array, scatter: float, rng: np.random.Generator) -> tuple[float, float]:
    """Of 95 %, around a value.

    Args:
        drawn: (n,) results of ships; infinite where a trial has no end.
        scatter: of single trials, standard deviation of the logarithm.
    """
    shows = drawn * np.exp(scatter * rng.standard_normal(len(drawn)))
    low, high = np.quantile(shows, [0.025, 0.975], method="inverted_cdf").tolist()
    return min(low, value), max(high, value)


def expected(vessel: Vessel, trials: Iterable[Trial], *, seed: int = 0) -> tuple[Expected, ...]:
    """Results of a vessel's trials, as far as its standard deviations tell.

    Raises:
        InputError: hardly any ship of its prior is within the ranges of parameters.
        NoAnswer: nothing steers her.
    """
    rng, trials = np.random.default_rng(seed), tuple(trials)
    drawn = vessel.model.drawn_parameters(DRAWS, rng)
    fastest = 4.0 * max(one.speed_mps for one in trials)
    fleet = Fleet(vessel, np.vstack([vessel.model.parameters, drawn]), fastest_mps=fastest)
    found = []
    for trial in trials:
        for quantity, values in fleet.results(trial).items():
            value, *rest = np.nan_to_num(values, nan=math.inf).tolist()
            low, high = interval(value, np.array(rest), SCATTER[quantity], rng)
            found.append(Expected(trial=trial, quantity=quantity, value=value, low=low, high=high))
    return tuple(found)


def standard_trials(speed_mps: float, *, stops: bool) -> tuple[Trial, ...]:
    """The circle, zig-zags and stop of the resolution on standards, MSC.137(76), from a speed."""
    circle = Trial(kind="circle", speed_mps=speed_mps, angle_rad=math.radians(35.0))
    turns = (Trial(kind="zigzag", speed_mps=speed_mps, angle_rad=math.radians(angle)) for angle in (10.0, 20.0))
    return (circle, *turns, *([Trial(kind="stop", speed_mps=speed_mps)] if stops else []))
