"""Forward search: add the cause that explains most, as long as chance does not explain as much."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from expdesign.diagnosis.candidate import Candidate, Situation
from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.extended import Extended
from expdesign.diagnosis.joint import Fit, fit, profile_cost
from expdesign.diagnosis.screening import LEVEL, Scored, Screening, screen
from expdesign.diagnosis.windows import Windows
from expdesign.values import Array

Progress = Callable[[str, float], None]
SHORTLIST = 7
FINER = 11
PER_CAUSE = 2
PRICE = 5.0
"""Of every estimated number, in units of twice the log likelihood: a cause with fewer numbers is to be preferred."""
AS_GOOD = 5.0
"""Twice the log likelihood by which the runner-up may trail and still count as not distinguishable: a wrong cause that
truly trails by d comes out ahead by more than this with a probability below Phi(-sqrt(AS_GOOD))."""
CLEARLY_LESS, MARGIN = 0.4, 20.0
"""Candidates with less than this share of the largest statistic, and by more than this, are not fitted."""
MOST_FINDINGS = 6
SETTLING = 12
"""Gauss-Newton steps, at most, before anything is tested."""
MOST_RETURNS = 4
"""How often the search goes back to take an addition out that later ones made superfluous."""


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
    """

    candidate: Candidate
    fit: Fit
    gain: float
    worth: float
    keys: tuple[str, ...]
    searched: tuple[str, float] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """One round of the search.

    Attributes:
        chosen: what was added.
        p_value: corrected for everything that was tried.
        rivals: contenders of other causes that explain as much, best first.
        before: the fit without it.
        screening: all tests of the round.
    """

    chosen: Contender
    p_value: float
    rivals: tuple[Contender, ...]
    before: Fit
    screening: Screening


@dataclass(frozen=True, kw_only=True, eq=False)
class Search:
    """The whole search: its steps, the fit before and after, and the round that found nothing more."""

    steps: tuple[Step, ...]
    first: Fit
    last: Fit
    final_screening: Screening


def search(ship: Extended, windows: Windows, starts: Array, rng: np.random.Generator, progress: Progress) -> Search:
    """Add causes until nothing significant is left; take those out again that later ones made superfluous.

    A cause that only stood in for another loses its worth once that is found. The search then returns to where it was
    added and goes on without it, so that what is left does not depend on it.
    """
    base = first = settled(ship, windows, starts)
    steps: list[Step] = []
    refused: list[Candidate] = []
    rounds = 0
    while True:
        rounds += 1
        share = 1.0 - 0.7**rounds
        progress(f"testing causes, round {rounds}", share)
        found = screen(base, [c for c in _candidates(base, windows) if not _same_as_any(c, refused)], rng)
        step = _step(base, windows, found, _within(progress, share))
        if step is None or len(steps) == MOST_FINDINGS:
            return Search(steps=tuple(steps), first=first, last=base, final_screening=found)
        steps.append(step)
        base = step.chosen.fit
        idle = superfluous(steps, windows, found.tests) if len(refused) < MOST_RETURNS else None
        if idle is not None:
            refused.append(steps[idle].chosen.candidate)
            base = steps[idle].before
            del steps[idle:]


def settled(ship: Extended, windows: Windows, starts: Array) -> Fit:
    """The model in use at the likeliest values of its uncertain parameters, the colour found where they settled.

    Far from there the remainder is a poor guide to the noise, and any cause that lets the fit go on looks true.
    """
    found = fit(ship, windows, (), starts=starts, steps=SETTLING)
    if not found.keys:
        return found
    return fit(found.ship, windows, (), starts=found.starts, noise=found.noise, steps=SETTLING,
               near=found.linear)  # fmt: skip


def _same_as_any(candidate: Candidate, others: list[Candidate]) -> bool:
    """The same effects, whatever their first guess."""
    return any(candidate.cause == other.cause and set(candidate.free) == set(other.free) for other in others)


def superfluous(steps: list[Step], windows: Windows, tests: float) -> int | None:
    """The earliest addition without which the last fit is as good as chance makes it."""
    whole = steps[-1].chosen.fit
    for index, step in enumerate(steps[:-1]):
        own = {*step.chosen.keys, *step.chosen.candidate.free, *step.chosen.candidate.fixed}
        kept = tuple(key for key in whole.keys[: whole.free] if key not in own)
        ship = replace(whole.ship, effects={key: v for key, v in whole.ship.effects.items() if key not in own})
        try:
            less = fit(ship, windows, kept, starts=whole.starts, noise=whole.noise, colour_order=whole.noise.order,
                       near=whole.linear)  # fmt: skip
        except (FloatingPointError, np.linalg.LinAlgError):
            continue
        lost = _gain(less, whole, whole)
        if tests * float(chi2.sf(max(lost, 0.0), max(1, len(own)))) > LEVEL or lost < PRICE * len(own):
            return index
    return None


def _within(progress: Progress, share: float) -> Progress:
    """Progress of a round that begins when a share of the search is done."""
    return lambda what, part: progress(what, share + 0.2 * part * (1 - share))


def _candidates(base: Fit, windows: Windows) -> list[Candidate]:
    situation = Situation(ship=base.ship, windows=windows)
    return [
        candidate
        for cause in CAUSES
        for candidate in cause.candidates(situation)
        if not set(candidate.free) & set(base.keys[: base.free])
    ]


def _step(base: Fit, windows: Windows, found: Screening, progress: Progress) -> Step | None:
    shortlist = _shortlist(found)
    contenders: list[Contender] = []
    for index, scored in enumerate(shortlist):
        progress(f"fitting {scored.candidate.cause}", index / len(shortlist))
        contender = contend(base, windows, scored)
        if contender is not None:
            contenders.append(contender)
    contenders = _judged(base, contenders)
    for chosen in contenders[:1]:
        p_value = min(1.0, found.tests * float(chi2.sf(max(chosen.gain, 0.0), max(1, len(chosen.keys)))))
        if p_value > LEVEL:
            return None
        rivals: dict[str, Contender] = {}
        for other in contenders[1:]:
            apart = chosen.worth - other.worth
            if other.candidate.cause != chosen.candidate.cause and apart < AS_GOOD:
                rivals.setdefault(other.candidate.cause, other)
        return Step(chosen=chosen, p_value=p_value, rivals=tuple(rivals.values()), before=base, screening=found)
    return None


def _shortlist(found: Screening) -> list[Scored]:
    """The best candidates of the best causes."""
    ranked = sorted(found.scored, key=lambda item: PRICE * item.candidate.size - item.statistic)
    kept: list[Scored] = []
    count: dict[str, int] = {}
    least = CLEARLY_LESS * max((item.statistic for item in ranked), default=0.0) - MARGIN
    for scored in ranked:
        cause = scored.candidate.cause
        if (scored.p_value * found.tests > 1.0 or scored.statistic < least) and kept:
            continue
        if cause not in count and len(count) == SHORTLIST:
            continue
        if count.get(cause, 0) < PER_CAUSE:
            kept.append(scored)
            count[cause] = count.get(cause, 0) + 1
    return kept


def contend(base: Fit, windows: Windows, scored: Scored) -> Contender | None:
    """Fit a candidate together with everything found before."""
    candidate, searched = scored.candidate, (None if scored.candidate.grid is None else _searched(base, scored))
    fixed = dict(candidate.fixed) if searched is None else {**candidate.fixed, searched[0]: searched[1]}
    start = dict(candidate.free) if candidate.finite else {key: base.ship.get(key) for key in candidate.free}
    extra = tuple(key for key in ("roll:period",) if key in candidate.fixed)
    keys = tuple(key for key in (*candidate.free, *extra) if searched is None or key != searched[0])
    before = tuple(key for key in base.keys[: base.free] if key not in keys)
    try:
        found = fit(base.ship.having({**start, **fixed}), windows, (*before, *keys), starts=base.starts,
                    noise=base.noise, colour_order=base.noise.order, near=base.linear)  # fmt: skip
        gain = _gain(base, found, found)
    except (FloatingPointError, np.linalg.LinAlgError):
        return None
    counted = len(keys) + (searched is not None)
    return Contender(
        candidate=candidate,
        fit=found,
        gain=gain,
        worth=gain - PRICE * counted,
        keys=keys,
        searched=None if searched is None else (searched[0], searched[2]),
    )


def _searched(base: Fit, scored: Scored) -> tuple[str, float, float]:
    """Key, best value and standard error of the effect that is found by trying values."""
    assert scored.candidate.grid is not None
    key, values = scored.candidate.grid
    best, std, width = values[0], float("nan"), 0.0
    for _ in range(2):
        tried = [_at(scored.candidate, key, value) for value in values]
        results = {_value(item.candidate, key): item.statistic for item in screen(base, tried).scored}
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


def _gain(base: Fit, found: Fit, judge: Fit) -> float:
    """Fall of twice the negative log likelihood, both fits under the noise of a third."""
    return profile_cost(base, judge.noise) - profile_cost(found, judge.noise)


def _judged(base: Fit, contenders: list[Contender]) -> list[Contender]:
    """Contenders by worth, all under the noise of the best."""
    if not contenders:
        return []
    judge = max(contenders, key=lambda item: item.worth).fit
    without = profile_cost(base, judge.noise)
    judged = []
    for item in contenders:
        gain = without - profile_cost(item.fit, judge.noise)
        judged.append(replace(item, gain=gain, worth=gain - (item.gain - item.worth)))
    contenders = judged
    return sorted(contenders, key=lambda item: -item.worth)
