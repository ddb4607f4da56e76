"""Starting points of fits: first guesses, and a grid search where the likelihood has corners."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.fit import Fit
from expdesign.diagnosis.select.score_tests import ScoreTest, score_tests
from expdesign.diagnosis.select.tuning import TUNING


@dataclass(frozen=True, kw_only=True, eq=False)
class StartingPoint:
    """Starting point of the fit of a candidate.

    Attributes:
        test: of the candidate.
        effects: first guesses.
        keys: the candidate's own effects that the fit estimates.
        profiled: the effect found by a grid search, with its standard error; the fit holds it.
    """

    test: ScoreTest
    effects: dict[str, float]
    keys: tuple[str, ...]
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
        inside = tried[statistics > statistics.max() - scipy.stats.chi2.isf(TUNING.level, 1)]
        std = max(float(np.ptp(inside)) / 4.0, width / 3.5)
        low, high = tried[max(place - 1, 0)], tried[min(place + 1, len(tried) - 1)]
        values = tuple(np.linspace(low, high, TUNING.refined_grid).tolist())
    return key, best, std


def _at(candidate: Candidate, key: str, value: float) -> Candidate:
    if key in candidate.free:
        return replace(candidate, free={**candidate.free, key: value})
    return replace(candidate, fixed={**candidate.fixed, key: value})


def _value(candidate: Candidate, key: str) -> float:
    return candidate.free.get(key, candidate.fixed.get(key, 0.0))
