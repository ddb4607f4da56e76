"""Forward search: add the cause that explains most, as long as chance does not explain as much."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from expdesign.diagnosis.causes import CAUSES, Candidate, Situation
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import LEVEL, Fit, Scored, fit, screen
from expdesign.diagnosis.model import Extended
from expdesign.diagnosis.select.contenders import (
    PRICE,
    Contender,
    Opening,
    contend,
    finished,
    gain_over,
    judged,
    opened_closely,
    opening,
    seen_closely,
)
from expdesign.diagnosis.select.profile_likelihood import middle, sharpened
from expdesign.diagnosis.select.search_state import Search, Step, superfluous, wald, without
from expdesign.values import Array

Progress = Callable[[str, float], None]
SHORTLIST = 7
PER_CAUSE = 2
AS_GOOD = 5.0
"""Twice the log likelihood by which the runner-up may trail and still count as not distinguishable: a wrong cause that
truly trails by d comes out ahead by more than this with a probability below Phi(-sqrt(AS_GOOD))."""
CLEARLY_LESS, MARGIN = 0.4, 20.0
"""Candidates with less than this share of the largest statistic, and by more than this, are not fitted."""
ALARM = 0.025
"""Corrected p-value up to which a cause is believed: half the share of false alarms promised, as p-values are right
only for long data."""
FIRST_STEPS, LEADING = 3, 0.6
"""Gauss-Newton steps after which candidates that gain less than this share of the most are given up."""
STRONG = 0.15
"""Share of the remainder from which on an effect is large, and looked at in short windows, too."""
CERTAIN = 2
"""Candidates that are fitted in long windows whatever short ones say of them."""
LARGE_WANDER_MPS = 0.1
"""Standard deviation of a wandering current from which on it may be a steady one rather, and that is fitted, too."""
MOST_FINDINGS = 6
SETTLING = 12
"""Gauss-Newton steps, at most, before anything is tested."""
MOST_RETURNS = 4
"""How often the search goes back to take an addition out that later ones made superfluous."""
MOST_EXCHANGES = 2
"""How often a cause is exchanged for what is worth more beside those found after it."""


def search(ship: Extended, windows: Windows, starts: Array, rng: np.random.Generator, progress: Progress) -> Search:
    """Add causes until nothing significant is left; take those out again that later ones made superfluous.

    A cause that only stood in for another loses its worth once that is found. The search then returns to where it was
    added and goes on without it, so that what is left does not depend on it. Many parameters at once explain nearly
    anything: before they are added, fewer numbers are given the chance to explain as much one after the other.
    When nothing more is found, whatever was chosen before others were known has to hold its place beside them.
    """
    progress = _onward(progress)
    base = first = settled(ship, windows, starts)
    steps: list[Step] = []
    refused: list[Candidate] = []
    rounds = exchanges = 0
    while True:
        rounds += 1
        share = 1.0 - 0.7**rounds
        progress(f"testing causes, round {rounds}", share)
        step, found = _round(base, windows, refused, rng, _within(progress, share))
        if step is None and exchanges < MOST_EXCHANGES:
            exchanges += 1
            other = _exchanged(steps, windows, refused, rng, _within(progress, share))
            if other is not None:
                steps, base = other, other[-1].chosen.fit
                continue
        if step is None or len(steps) == MOST_FINDINGS:
            steps = _settled_together(steps)
            return Search(steps=tuple(steps), first=first, last=base, final_screening=found).with_steps(tuple(steps))
        steps += _fewer(step, windows, refused, rng, _within(progress, share)) if _is_block(step.chosen) else [step]
        del steps[MOST_FINDINGS:]
        base = steps[-1].chosen.fit
        idle = superfluous(steps, windows) if len(refused) < MOST_RETURNS else None
        if idle is not None:
            refused.append(steps[idle].chosen.candidate)
            base = steps[idle].before
            del steps[idle:]


def _round(
    base: Fit,
    windows: Windows,
    refused: list[Candidate],
    rng: np.random.Generator,
    progress: Progress,
    *,
    most: int = 99,
) -> tuple[Step | None, tuple[Scored, ...]]:
    """Test and fit candidates of no more than so many numbers."""
    candidates = [c for c in _candidates(base, windows) if not _same_as_any(c, refused) and len(c.free) <= most]
    found = screen(base, candidates, rng)
    return _step(base, windows, found, progress), found


def _is_block(chosen: Contender) -> bool:
    """Several parameters at once."""
    return chosen.candidate.cause == "parameters" and len(chosen.keys) > 1


def _fewer(
    block: Step, windows: Windows, refused: list[Candidate], rng: np.random.Generator, progress: Progress
) -> list[Step]:
    """Causes of fewer numbers, one after the other, that are worth more than a block of parameters; or the block."""
    size, base, path, numbers = len(block.chosen.keys), block.before, list[Step](), 0
    while numbers < size and len(path) < MOST_FINDINGS:
        step, _ = _round(base, windows, refused, rng, progress, most=size - 1)
        if step is None:
            break
        path.append(step)
        numbers += len(step.chosen.candidate.free)
        base = step.chosen.fit
    if all(step.chosen.candidate.cause == "parameters" for step in path):
        return [block]
    whole, other = block.chosen.fit, base
    worth = max(gain_over(whole, other, judge) for judge in (whole, other)) - PRICE * (numbers - size)
    return path if worth > 0 else [block]


def _exchanged(
    steps: list[Step], windows: Windows, refused: list[Candidate], rng: np.random.Generator, progress: Progress
) -> list[Step] | None:
    """The steps with one of them given up for what is worth more beside all others; None where each holds its place."""
    for index, old in enumerate(steps[:-1]):
        rest = without(steps, index, windows)
        if rest is None:
            continue
        new, _ = _round(rest[-1].chosen.fit, windows, refused, rng, progress)
        if new is not None and _is_worth_more(new.chosen, old.chosen, steps[-1].chosen.fit):
            return [*rest, new]
    return None


def _is_worth_more(new: Contender, old: Contender, whole: Fit) -> bool:
    """Whoever judges the noise; `whole` is the fit with the old one in it."""
    if _same_as_any(new.candidate, [old.candidate]):
        return False
    dearer = (new.gain - new.worth) - (old.gain - old.worth)
    return min(gain_over(whole, new.fit, judge) for judge in (whole, new.fit)) > dearer


def _settled_together(steps: list[Step]) -> list[Step]:
    """Numbers that are found by trying values are found anew beside what was added after them."""
    for index, step in enumerate(steps[:-1]):
        if step.chosen.searched is None or not step.chosen.searched[1] > 0:
            continue
        key, std = step.chosen.searched
        *others, last = steps
        found, std = middle(last.chosen.fit, key, std)
        others[index] = replace(step, chosen=replace(step.chosen, searched=(key, std)))
        steps = [*others, replace(last, chosen=replace(last.chosen, fit=found))]
    return steps


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


def _onward(progress: Progress) -> Progress:
    """Never less than was told before: rounds that look at something again begin anew."""
    most = 0.0

    def tell(what: str, share: float) -> None:
        nonlocal most
        most = max(most, share)
        progress(what, most)

    return tell


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


def _step(base: Fit, windows: Windows, found: tuple[Scored, ...], progress: Progress) -> Step | None:
    openings, far = _openings(base, windows, found)
    contenders: list[Contender] = []
    for index, first in enumerate(openings):
        progress(f"fitting {first.scored.candidate.cause}", index / len(openings))
        contender = contend(base, windows, first, far=far, steps=FIRST_STEPS)
        if contender is not None:
            contenders.append(contender)
    contenders = _standing(base, windows, judged(base, contenders))
    chosen = next((item for item in contenders if item.p_value <= ALARM), None)
    if chosen is None:
        return None
    rivals: dict[str, Contender] = {}
    for other in contenders:
        if other.candidate.cause != chosen.candidate.cause and chosen.worth - other.worth < AS_GOOD:
            rivals.setdefault(other.candidate.cause, other)
    return Step(
        chosen=sharpened(chosen, base),
        p_value=chosen.p_value,
        rivals=tuple(rivals.values()),
        before=base,
        screening=found,
    )


def _standing(base: Fit, windows: Windows, rough: list[Contender]) -> list[Contender]:
    """The best, fitted to the end; those that end at nothing, because the data pull beyond it, make way for others."""
    while rough:
        most = max(item.gain for item in rough)
        ending = [item for item in rough if item.gain > LEADING * most - MARGIN]
        ended = [finished(base, windows, item) for item in ending]
        standing = [item for item in ended if wald(item, item.fit) <= LEVEL]
        if standing or not ending:  # nothing gains anything
            return judged(base, standing)
        rough = [item for item in rough if item not in ending]
    return []


def _openings(base: Fit, windows: Windows, found: tuple[Scored, ...]) -> tuple[list[Opening], bool]:
    """What to fit, and whether it is far from the model as it stands: then short windows tell where to begin."""
    shortlist = [*_shortlist(found), *_hidden_by_wander(base, found)]
    closely = seen_closely(base, windows)
    near = None if closely is None else screen(closely, [item.candidate for item in found])
    if closely is None or near is None or _share(near, closely) < STRONG:
        return [opening(base, scored) for scored in shortlist], False
    certain = shortlist[:CERTAIN]
    seen = {id(item.candidate) for item in certain}
    tests = {id(item.candidate): item.tests for item in found}
    others = [
        replace(item, tests=tests[id(item.candidate)]) for item in _shortlist(near) if id(item.candidate) not in seen
    ]
    return opened_closely(closely, [*certain, *others], len(certain)), True


def _share(found: tuple[Scored, ...], base: Fit) -> float:
    """Share of the remainder that the best candidate explains."""
    rows = int(np.isfinite(base.columns.error).sum())
    return max((item.statistic for item in found), default=0.0) / rows


def _hidden_by_wander(base: Fit, found: tuple[Scored, ...]) -> list[Scored]:
    """A steady current that the wandering one has taken up: in few runs a large one tells nothing against it."""
    if base.noise.wander_mps < LARGE_WANDER_MPS:
        return []
    listed = {id(item.candidate) for item in _shortlist(found)}
    return [item for item in found if item.candidate.cause == "current" and id(item.candidate) not in listed]


def _shortlist(found: tuple[Scored, ...]) -> list[Scored]:
    """The best candidates of the best causes."""
    ranked = sorted(found, key=lambda item: PRICE * item.candidate.size - item.statistic)
    kept: list[Scored] = []
    count: dict[str, int] = {}
    least = CLEARLY_LESS * max((item.statistic for item in ranked), default=0.0) - MARGIN
    for scored in ranked:
        cause = scored.candidate.cause
        if scored.p_value * scored.tests > 1.0 or scored.statistic < least:
            continue
        if cause not in count and len(count) == SHORTLIST:
            continue
        if count.get(cause, 0) < PER_CAUSE:
            kept.append(scored)
            count[cause] = count.get(cause, 0) + 1
    return kept
