"""Starting points of fits: first guesses, a grid search where the likelihood has corners, and fits in short windows.

Large effects begin in short windows: long simulations are too far from the data there.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows, channel_std
from expdesign.diagnosis.fit import Fit, FitOptions, fit, likeliest, profile_cost
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import initial_states, simulate_windows
from expdesign.diagnosis.select.score_tests import ScoreTest, score_tests
from expdesign.diagnosis.select.tuning import TUNING
from expdesign.processes import in_order
from expdesign.values import Array

SHORT_S, MIDDLE_S = 45.0, 140.0  # length of short windows, and of those between short and long ones [s]
FEWEST_SAMPLES = 30  # of a short window
SHORT_STEPS = 6  # Gauss-Newton steps in short windows
# candidates that gain less than this share of the best in short windows are not fitted in long ones
LEAST_GAIN_SHARE = 0.75
REFINED_GRID = 11  # values of the second grid search
FAR_BETTER = 0.5  # share of a squared error below which another one is far better


FROM_NOTHING = FitOptions(steps=SHORT_STEPS)
"""Noise of unknown size."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StartingPoint:
    """Starting point of the fit of a candidate."""

    test: ScoreTest  # of the candidate
    effects: dict[str, float]  # first guesses
    keys: tuple[str, ...]  # the candidate's own effects that the fit estimates
    # the effect found by a grid search, with its standard error; the fit holds it
    profiled: tuple[str, float] | None = None


def starting_point(base: Fit, test: ScoreTest) -> StartingPoint:
    """First guesses of a candidate beside everything in `base`."""
    candidate = test.candidate
    start = dict(candidate.free) if candidate.finite else {key: base.ship.get(key) for key in candidate.free}
    effects = {**start, **candidate.fixed}
    shape = tuple(key for key in ("roll:period", "roll:damping") if key in candidate.fixed)
    keys = (*candidate.free, *shape)
    if candidate.grid is None:
        return StartingPoint(test=test, effects=effects, keys=keys)
    key, value, std = _grid_search(base, candidate)
    return StartingPoint(
        test=test,
        effects={**effects, key: value},
        keys=tuple(other for other in keys if other != key),
        profiled=(key, std),
    )


def joint_keys(base: Fit, keys: tuple[str, ...]) -> tuple[str, ...]:
    """Effects without a prior in a fit of a candidate's effects beside those of `base`."""
    return (*(key for key in base.free_keys if key not in keys), *keys)


def _grid_search(base: Fit, candidate: Candidate) -> tuple[str, float, float]:
    """Key, best value and standard error of the effect that is searched on a grid, by score tests."""
    assert candidate.grid is not None
    key, values = candidate.grid
    best, std, width = values[0], float("nan"), 0.0
    for _ in range(2):
        tests = score_tests(base, [_at(candidate, key, value) for value in values])
        results = {_value(item.candidate, key): item.statistic for item in tests}
        if not results:
            break
        tried = np.array(sorted(results))
        statistics = np.array([results[value] for value in tried])
        place = int(np.argmax(statistics))
        best = float(tried[place])
        width = float(np.min(np.diff(tried))) if len(tried) > 1 else 0.0
        inside = tried[statistics > statistics.max() - scipy.special.chdtri(1, TUNING.level)]
        std = max(float(np.ptp(inside)) / 4.0, width / 3.5)
        low, high = tried[max(place - 1, 0)], tried[min(place + 1, len(tried) - 1)]
        values = tuple(np.linspace(low, high, REFINED_GRID).tolist())
    return key, best, std


def _at(candidate: Candidate, key: str, value: float) -> Candidate:
    if key in candidate.free:
        return replace(candidate, free={**candidate.free, key: value})
    return replace(candidate, fixed={**candidate.fixed, key: value})


def _value(candidate: Candidate, key: str) -> float:
    return candidate.free.get(key, candidate.fixed.get(key, 0.0))


def fit_short_windows(base: Fit, windows: Windows) -> Fit | None:
    """The same model fitted in short windows with white noise: imprecise, but a good start for large effects.

    None where windows are short anyway, or where the model cannot be fitted in them.
    """
    samples = max(FEWEST_SAMPLES, round(SHORT_S / windows.sample_s))
    if 2 * samples > windows.measured.shape[1]:
        return None
    short = replace(windows.cut_shorter(samples), white_noise=True)
    try:
        return fit(base.ship, short, base.free_keys, starts=initial_states(short), options=FROM_NOTHING)
    except (FloatingPointError, np.linalg.LinAlgError):
        return None


def nearer_in_short_windows(ship: ExtendedModel, windows: Windows, found: Fit) -> ExtendedModel | None:
    """The model with its uncertain effects fitted in short windows, where it simulates long ones far better than a fit.

    A model that is far from the ship leaves so much over long windows that a fit to them may end with all of it in the
    noise. None where windows are short anyway, where it cannot be fitted, or where the fit is about as near.
    """
    samples = max(FEWEST_SAMPLES, round(SHORT_S / windows.sample_s))
    if 2 * samples > windows.measured.shape[1]:
        return None
    short = replace(windows.cut_shorter(samples), white_noise=True)
    try:
        near = fit(ship, short, (), starts=initial_states(short, ship.states), options=FROM_NOTHING).ship
        left, before = (_squared_error(found, windows, one) for one in (near, found.ship))
    except (FloatingPointError, np.linalg.LinAlgError):
        return None
    return near if left < FAR_BETTER * before else None


def start_in_short_windows(
    short_fit: Fit,
    shortlist: Sequence[ScoreTest],
    certain: int,
    known: dict[Hashable, tuple[StartingPoint, Fit | None]],
) -> list[StartingPoint]:
    """Starting points from fits in short windows; candidates that gain much less than the best are left out.

    Args:
        short_fit: the model in use, by `fit_short_windows`.
        shortlist: tests of the candidates.
        certain: this many of the first are never left out.
        known: candidate -> its first guess and its fit, beside this one, of earlier rounds and of this one.
    """
    keys = [_same(test.candidate) for test in shortlist]
    waiting = {key: test for key, test in zip(keys, shortlist, strict=True) if key not in known}
    guesses = list(in_order(starting_point, (short_fit,), [(test,) for test in waiting.values()]))
    fitted = in_order(_fit_in_short_windows, (short_fit,), [(point,) for point in guesses])
    known |= dict(zip(waiting, zip(guesses, fitted, strict=True), strict=True))
    points = [replace(known[key][0], test=test) for key, test in zip(keys, shortlist, strict=True)]
    fits = [known[key][1] for key in keys]
    noise = likeliest([short_fit, *(found for found in fits if found is not None)]).noise
    without = profile_cost(short_fit, noise)
    never_left_out = {of_one_fit(point) for point in points[:certain]}
    gains = [-np.inf if found is None else without - profile_cost(found, noise) for found in fits]
    best: dict[Hashable, int] = {}
    for number, (point, gain) in enumerate(zip(points, gains, strict=True)):
        other = best.setdefault(of_one_fit(point), number)
        best[of_one_fit(point)] = number if gain > gains[other] else other
    return [
        point
        if found is None
        else replace(point, effects=point.effects | {key: found.value(key) for key in found.keys})
        for number, (point, found, gain) in enumerate(zip(points, fits, gains, strict=True))
        if best[of_one_fit(point)] == number
        and (of_one_fit(point) in never_left_out or gain > LEAST_GAIN_SHARE * max(gains))
    ]


def _same(candidate: Candidate) -> Hashable:
    """What candidates that are fitted alike share."""
    return candidate.cause, tuple(candidate.free.items()), tuple(candidate.fixed.items())


def of_one_fit(point: StartingPoint) -> Hashable:
    """What candidates share that differ in their first guesses alone, so that the best fit is the answer of all."""
    candidate = point.test.candidate
    held = ((key, value) for key, value in candidate.fixed.items() if key not in point.keys)
    return candidate.cause, frozenset(candidate.free), frozenset(held)


def _fit_in_short_windows(short_fit: Fit, point: StartingPoint) -> Fit | None:
    """None where the candidate cannot be fitted."""
    options = replace(FROM_NOTHING, noise=short_fit.noise, warm_start=short_fit)
    ship, windows = short_fit.ship.with_effects(point.effects), short_fit.linear.motion.windows
    try:
        return fit(ship, windows, joint_keys(short_fit, point.keys), starts=short_fit.starts, options=options)
    except (FloatingPointError, np.linalg.LinAlgError):
        return None


def start_nearer(base: Fit, windows: Windows, point: StartingPoint) -> tuple[ExtendedModel, Array]:
    """Model and initial states to begin a fit with, by a fit in windows of middle length where that simulates better.

    Raises:
        FloatingPointError: the model cannot be simulated there.
    """
    guess = base.ship.with_effects(point.effects)
    before, after = _squared_error(base, windows, base.ship), _squared_error(base, windows, guess)
    middle = windows.cut_shorter(max(FEWEST_SAMPLES, round(MIDDLE_S / windows.sample_s)))
    ship = guess
    if after > FAR_BETTER * before and middle.measured.shape[1] < windows.measured.shape[1]:
        part, starts = replace(middle, white_noise=True), initial_states(middle, guess.states)
        ship = fit(guess, part, joint_keys(base, point.keys), starts=starts, options=FROM_NOTHING).ship
        after = _squared_error(base, windows, ship)
    return (ship, initial_states(windows)) if after < before else (guess, base.starts)


def _squared_error(base: Fit, windows: Windows, ship: ExtendedModel) -> float:
    """Of a simulation from measured initial states, in units of the measured variances; infinite where it diverges."""
    motion = simulate_windows(ship, windows, initial_states(windows, ship.states), warm_start=base.linear)
    size = channel_std(windows.measured)
    scale = np.where(size > 0, size, np.inf)
    return np.inf if motion.diverged else float(np.nansum((motion.error / scale) ** 2))
