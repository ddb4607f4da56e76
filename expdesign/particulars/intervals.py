"""Results of standard trials with 95 % intervals: of ships that are drawn, each trial with a scatter of its own.

Two trials of one ship differ, and a model of second order misses her by more than its parameters' errors say: it has
no cubes of small drift angles, which decide first overshoots. What is missed of runs that are left out of an estimate
in turn says how much of both there is, as shares s of the way sailed and t of the heading turned. To first order

    a speed scatters by s                   a radius, which is speed over yaw rate, by (s^2 + t^2)^(1/2)
    a time to turn through an angle by t    an overshoot o, at the end of a swing by a + o, by t (a + o) radians

and all but overshoots as standard deviations of logarithms. Runs say nothing of stops, and nothing is known of ships
without data: there `SCATTER` counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from expdesign.particulars.card import SCATTER, Trial
from expdesign.particulars.trials import Fleet
from expdesign.values import Array
from expdesign.vessel import Missed, Vessel

DRAWS = 240  # ships
SPEEDS = ("speed_mps", "speed_90_mps", "speed_180_mps")
TIMES = ("time_90_s", "time_180_s")
RADII = ("advance_m", "transfer_m", "tactical_diameter_m")


@dataclass(frozen=True, kw_only=True)
class Expected:
    """A quantity of a trial with its 95 % interval."""

    trial: Trial
    quantity: str
    value: float  # of the nominal ship; infinite, as the others, where the trial has no end
    low: float
    high: float


def single_trials(quantity: str, drawn: Array, trial: Trial, missed: Missed | None, rng: np.random.Generator) -> Array:
    """(n,) what single trials show of ships whose results are `drawn` (n,); infinite where a trial has no end."""
    chance, scatter = rng.standard_normal(len(drawn)), SCATTER[quantity]
    if missed is not None and quantity.startswith("overshoot"):
        swing = np.where(np.isfinite(drawn), trial.angle_rad + drawn, 0.0)
        return np.maximum(drawn + missed.turn_share * swing * chance, 0.0)
    if missed is not None and quantity in SPEEDS:
        scatter = missed.way_share
    elif missed is not None and quantity in TIMES:
        scatter = missed.turn_share
    elif missed is not None and quantity in RADII:
        scatter = math.hypot(missed.way_share, missed.turn_share)
    return np.asarray(drawn * np.exp(scatter * chance))


def interval(value: float, shows: Array) -> tuple[float, float]:
    """Of 95 %, around a value, of what trials of drawn ships show (n,); infinite where a trial has no end."""
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
            with np.errstate(over="ignore"):  # of ships that run away
                shows = single_trials(quantity, np.array(rest), trial, vessel.model.missed, rng)
            low, high = interval(value, shows)
            found.append(Expected(trial=trial, quantity=quantity, value=value, low=low, high=high))
    return tuple(found)


def standard_trials(speed_mps: float, *, stops: bool) -> tuple[Trial, ...]:
    """The circle, zig-zags and stop of the resolution on standards, MSC.137(76), from a speed."""
    circle = Trial(kind="circle", speed_mps=speed_mps, angle_rad=math.radians(35.0))
    turns = (Trial(kind="zigzag", speed_mps=speed_mps, angle_rad=math.radians(angle)) for angle in (10.0, 20.0))
    return (circle, *turns, *([Trial(kind="stop", speed_mps=speed_mps)] if stops else []))
