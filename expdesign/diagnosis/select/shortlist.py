"""The shortlist: the candidates of a round that are worth a fit, and where their fits begin."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import Fit
from expdesign.diagnosis.select.score_tests import ScoreTest, score_tests
from expdesign.diagnosis.select.starting_point import (
    StartingPoint,
    fit_short_windows,
    of_one_fit,
    start_in_short_windows,
    starting_point,
)
from expdesign.diagnosis.select.tuning import TUNING

PER_CAUSE = 2  # candidates of a cause that are fitted in a round, at most
# share of the gain of a candidate from which on another is compared with it on held-out data; one with fewer numbers
# comes first unless it is clearly worse there
ABOUT_AS_LIKELY = 0.85
LARGE_SHARE = 0.15  # share of the remainder above which an effect counts as large and is fitted in short windows too
CERTAIN = 2  # causes whose best candidates are always fitted in long windows

SHORT = "in short windows"
"""What is known of short windows beside a fit: the fit in them, and candidates beside that."""


def starting_points(
    base: Fit, windows: Windows, tests: tuple[ScoreTest, ...], known: dict[Hashable, Any]
) -> tuple[list[StartingPoint], bool]:
    """Starting points, and whether the best candidate is a large effect; then they come from short windows.

    `known` is of `Work.fits_beside`.
    """
    shortlist = _shortlist(tests)
    shortlist += _hidden_by_random_current(base, tests, shortlist)
    if SHORT not in known:
        known[SHORT] = fit_short_windows(base, windows), {}
    short_fit, beside = known[SHORT]
    short_tests = None if short_fit is None else score_tests(short_fit, [item.candidate for item in tests])
    if short_fit is None or short_tests is None or _explained_share(short_tests, short_fit) < LARGE_SHARE:
        points = {of_one_fit(point): point for point in (starting_point(base, test) for test in reversed(shortlist))}
        return [*reversed(points.values())], False
    best, of_short = _never_left_out(shortlist), _shortlist(short_tests)
    certain = [*best, *_hidden_by_random_current(base, tests, best, beside=of_short)]
    listed = {id(item.candidate) for item in certain}
    multiplicity = {id(item.candidate): item.multiplicity for item in tests}
    others = [
        replace(item, multiplicity=multiplicity[id(item.candidate)])
        for item in of_short
        if id(item.candidate) not in listed
    ]
    return start_in_short_windows(short_fit, [*certain, *others], len(certain), beside), True


def _never_left_out(shortlist: Sequence[ScoreTest]) -> list[ScoreTest]:
    """The best candidate of the first causes, and of all whose statistic is about as large as the largest."""
    first: dict[str, ScoreTest] = {}
    for item in shortlist:
        first.setdefault(item.candidate.cause, item)
    largest = max((item.statistic for item in shortlist), default=0.0)
    return [
        item
        for place, item in enumerate(first.values())
        if place < CERTAIN or item.statistic > ABOUT_AS_LIKELY * largest
    ]


def _explained_share(tests: tuple[ScoreTest, ...], base: Fit) -> float:
    """Share of the remainder that the best candidate explains."""
    rows = int(np.isfinite(base.sensitivities.error).sum())
    return max((item.statistic for item in tests), default=0.0) / rows


def _hidden_by_random_current(
    base: Fit, tests: tuple[ScoreTest, ...], listed: Sequence[ScoreTest], *, beside: Sequence[ScoreTest] = ()
) -> list[ScoreTest]:
    """A steady current that a large random current may have absorbed; few runs cannot distinguish the two.

    A wind that nobody measured needs more numbers for what such a current does, so a current is always tried beside it.

    Args:
        base: gives the random current.
        listed: candidates that are fitted, to which a current is added.
        beside: others that may be.
    """
    windy = any(item.candidate.imitates for item in (*listed, *beside))
    if base.noise.current_std_mps < TUNING.large_current_mps and not windy:
        return []
    known = {id(item.candidate) for item in listed}
    return [item for item in tests if item.candidate.cause == "current" and id(item.candidate) not in known]


def listed_causes(tests: tuple[ScoreTest, ...]) -> int:
    """How many causes have candidates that are worth a fit."""
    return len({test.candidate.cause for test in _shortlist(tests)})


def _shortlist(tests: tuple[ScoreTest, ...]) -> list[ScoreTest]:
    """The best candidates of the best causes."""
    ranked = sorted(tests, key=lambda item: TUNING.price * item.candidate.size - item.statistic)
    largest = max((item.statistic for item in ranked), default=0.0)
    least = TUNING.least_statistic_share * largest - TUNING.statistic_margin
    found: list[ScoreTest] = []
    count: dict[str, int] = {}
    for test in ranked:
        cause = test.candidate.cause
        if not test.is_worth_a_fit or test.statistic < least:
            continue
        if cause not in count and len(count) == TUNING.shortlist:
            continue
        if count.get(cause, 0) < PER_CAUSE:
            found.append(test)
            count[cause] = count.get(cause, 0) + 1
    return found
