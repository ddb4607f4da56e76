"""Candidates fitted with everything that was found before, and what each is then worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows, spread
from expdesign.diagnosis.fit import LEVEL, Fit, Scored, fit, profile_cost, screen
from expdesign.diagnosis.model import Extended, first_states, simulate_windows
from expdesign.values import Array

FINER = 11
PRICE = 5.0
"""Of every estimated number, in units of twice the log likelihood: a cause with fewer numbers is to be preferred."""
COARSE_S, MIDDLE_S, COARSE_SAMPLES, COARSE_STEPS = 45.0, 140.0, 30, 6
"""Length of short windows and of those between them and long ones, at least in samples; Gauss-Newton steps in them."""
CLOSELY_LESS = 0.75
"""Candidates that explain less than this share of the most explained in short windows are not fitted in long ones."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Contender:
    """A candidate fitted with everything that was found before.

    Attributes:
        candidate: which.
        fit: of all windows.
        gain: fall of twice the negative log likelihood.
        worth: the same less the price of its numbers.
        keys: its own free effects.
        searched: the effect found by trying values, with its standard error.
        tests: what its p-value is to be multiplied with, for all that was tried.
    """

    candidate: Candidate
    fit: Fit
    gain: float
    worth: float
    keys: tuple[str, ...]
    searched: tuple[str, float] | None = None
    tests: float = 1.0

    @property
    def p_value(self) -> float:
        """Corrected for all that was tried."""
        return min(1.0, self.tests * float(chi2.sf(max(self.gain, 0.0), max(1, len(self.keys)))))


def seen_closely(base: Fit, windows: Windows) -> Fit | None:
    """The same model in short windows with white noise: a poor judge of small effects and a good guide to large ones.

    Over long windows a simulation that is far off says little of why, and the colour of what it leaves hides much of
    it. None where windows are short anyhow, or the model cannot be fitted so.
    """
    samples = max(COARSE_SAMPLES, round(COARSE_S / windows.sample_s))
    if 2 * samples > windows.measured.shape[1]:
        return None
    short = replace(windows.shortened(samples), has_heading=False)
    try:
        return fit(
            base.ship, short, base.keys[: base.free], starts=first_states(short), steps=COARSE_STEPS, colour_order=0
        )
    except (FloatingPointError, np.linalg.LinAlgError):
        return None


@dataclass(frozen=True, kw_only=True, eq=False)
class Opening:
    """Where the fit of a candidate begins: effects first guessed, its own free keys, and what was found by trying."""

    scored: Scored
    effects: dict[str, float]
    keys: tuple[str, ...]
    searched: tuple[str, float] | None = None


def opening(base: Fit, scored: Scored) -> Opening:
    """The first guess."""
    candidate = scored.candidate
    searched = None if candidate.grid is None else _searched(base, scored)
    fixed = dict(candidate.fixed) if searched is None else {**candidate.fixed, searched[0]: searched[1]}
    start = dict(candidate.free) if candidate.finite else {key: base.ship.get(key) for key in candidate.free}
    extra = tuple(key for key in ("roll:period", "roll:damping") if key in candidate.fixed)
    keys = tuple(key for key in (*candidate.free, *extra) if searched is None or key != searched[0])
    return Opening(
        scored=scored,
        effects={**start, **fixed},
        keys=keys,
        searched=None if searched is None else (searched[0], searched[2]),
    )


def _kept(base: Fit, keys: tuple[str, ...]) -> tuple[str, ...]:
    return (*(key for key in base.keys[: base.free] if key not in keys), *keys)


def opened_closely(closely: Fit, shortlist: Sequence[Scored], certain: int) -> list[Opening]:
    """Candidates fitted in short windows; those that explain much less than the best are left out.

    Args:
        closely: `seen_closely`.
        shortlist: candidates.
        certain: so many of the first are kept anyhow.
    """
    tried: list[tuple[Opening, float, Fit | None]] = []
    for scored in shortlist:
        first = opening(closely, scored)
        try:
            found = fit(
                closely.ship.having(first.effects), closely.linear.motion.windows, _kept(closely, first.keys),
                starts=closely.starts, noise=closely.noise, steps=COARSE_STEPS, colour_order=0, near=closely.linear,
            )  # fmt: skip
        except (FloatingPointError, np.linalg.LinAlgError):
            tried.append((first, -np.inf, None))
            continue
        tried.append((first, gain_over(closely, found, found), found))
    judge = max(tried, key=lambda item: item[1])[2]
    if judge is None:
        return [first for first, _, _ in tried]
    gains = [-np.inf if found is None else gain_over(closely, found, judge) for _, _, found in tried]
    return [
        replace(first, effects=first.effects | {key: found.value(key) for key in found.keys})
        if found is not None
        else first
        for number, ((first, _, found), gain) in enumerate(zip(tried, gains, strict=True))
        if number < certain or gain > CLOSELY_LESS * max(gains)
    ]


def contend(base: Fit, windows: Windows, first: Opening, *, far: bool = False, steps: int = 8) -> Contender | None:
    """Fit a candidate together with everything found before.

    Args:
        base: the fit without it.
        windows: data.
        first: where to begin.
        far: from far away, by way of windows of middle length.
        steps: Gauss-Newton steps.
    """
    keys = _kept(base, first.keys)
    try:
        ship, starts = _nearer(base, windows, first.effects, keys) if far else (None, base.starts)
        found = fit(
            base.ship.having(first.effects) if ship is None else ship, windows, keys, starts=starts, noise=base.noise,
            colour_order=base.noise.order, near=base.linear, steps=steps,
        )  # fmt: skip
        gain = gain_over(base, found, found)
    except (FloatingPointError, np.linalg.LinAlgError):
        return None
    counted = len(first.keys) + (first.searched is not None)
    return Contender(
        candidate=first.scored.candidate,
        fit=found,
        gain=gain,
        worth=gain - PRICE * counted,
        keys=first.keys,
        searched=first.searched,
        tests=first.scored.tests,
    )


def finished(base: Fit, windows: Windows, rough: Contender) -> Contender:
    """The same with its fit led to the end."""
    fitted = rough.fit
    if fitted.converged:
        return rough
    try:
        found = fit(
            fitted.ship, windows, fitted.keys[: fitted.free], starts=fitted.starts, noise=fitted.noise,
            colour_order=fitted.noise.order, near=fitted.linear,
        )  # fmt: skip
    except (FloatingPointError, np.linalg.LinAlgError):
        return rough
    gain = gain_over(base, found, found)
    return replace(rough, fit=found, gain=gain, worth=gain - (rough.gain - rough.worth))


def _nearer(
    base: Fit, windows: Windows, effects: dict[str, float], keys: tuple[str, ...]
) -> tuple[Extended | None, Array]:
    """Where to begin a fit from: where short windows put it, if that simulates better than the fit before."""
    ship = base.ship.having(effects)
    before, after = _badness(base, windows, base.ship), _badness(base, windows, ship)
    middle = windows.shortened(max(COARSE_SAMPLES, round(MIDDLE_S / windows.sample_s)))
    if after > 0.5 * before and middle.measured.shape[1] < windows.measured.shape[1]:
        starts = first_states(middle, ship.states)
        ship = fit(
            ship, replace(middle, has_heading=False), keys, starts=starts, steps=COARSE_STEPS, colour_order=0
        ).ship
        after = _badness(base, windows, ship)
    return (ship, first_states(windows)) if after < before else (None, base.starts)


def _badness(base: Fit, windows: Windows, ship: Extended) -> float:
    """Squared error of a simulation from the measured beginnings, in units of the measured spread."""
    motion = simulate_windows(ship, windows, first_states(windows, ship.states), near=base.linear)
    size = spread(windows.measured)
    scale = np.where(size > 0, size, np.inf)
    return np.inf if motion.diverged else float(np.nansum((motion.error / scale) ** 2))


def _searched(base: Fit, scored: Scored) -> tuple[str, float, float]:
    """Key, best value and standard error of the effect that is found by trying values."""
    assert scored.candidate.grid is not None
    key, values = scored.candidate.grid
    best, std, width = values[0], float("nan"), 0.0
    for _ in range(2):
        tried = [_at(scored.candidate, key, value) for value in values]
        results = {_value(item.candidate, key): item.statistic for item in screen(base, tried)}
        if not results:
            break
        found = np.array(sorted(results))
        statistics = np.array([results[value] for value in found])
        best = float(found[np.argmax(statistics)])
        width = float(np.min(np.diff(found))) if len(found) > 1 else 0.0
        inside = found[statistics > statistics.max() - chi2.isf(LEVEL, 1)]
        std = max(float(np.ptp(inside)) / 4.0, width / 3.5)
        place = int(np.argmax(statistics))
        low, high = found[max(place - 1, 0)], found[min(place + 1, len(found) - 1)]
        values = tuple(np.linspace(low, high, FINER).tolist())
    return key, best, std


def _at(candidate: Candidate, key: str, value: float) -> Candidate:
    if key in candidate.free:
        return replace(candidate, free={**candidate.free, key: value})
    return replace(candidate, fixed={**candidate.fixed, key: value})


def _value(candidate: Candidate, key: str) -> float:
    return candidate.free.get(key, candidate.fixed.get(key, 0.0))


def gain_over(base: Fit, found: Fit, judge: Fit) -> float:
    """Fall of twice the negative log likelihood, both fits under the noise of a third."""
    return profile_cost(base, judge.noise) - profile_cost(found, judge.noise)


def judged(base: Fit, contenders: list[Contender]) -> list[Contender]:
    """Contenders by worth, all under the noise of the best."""
    if not contenders:
        return []
    judge = max(contenders, key=lambda item: item.worth).fit
    without = profile_cost(base, judge.noise)
    results = []
    for item in contenders:
        gain = without - profile_cost(item.fit, judge.noise)
        results.append(replace(item, gain=gain, worth=gain - (item.gain - item.worth)))
    return sorted(results, key=lambda item: -item.worth)
