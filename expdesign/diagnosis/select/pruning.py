"""Which of the causes found are worth telling: those that mend something on runs that were not used to fit them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import HeldOut, gained, on_same, widened
from expdesign.diagnosis.select.search_state import Search, Step, like_nothing, without

LEAST_GAIN, PLAIN_GAIN = 0.1, 1.0
"""Points of simulated fit on held-out runs, mean over outputs: what causes beside the first must gain at least, and
what suffices even when its interval, of few runs perhaps, reaches zero."""
MOST_HARM = 0.5
"""Points that the first may cost at the lower end of its interval, if it costs anything in any output."""


def kept(
    found: Search, windows: Windows, measured: Callable[[Search], list[HeldOut]], seed: int
) -> tuple[Search, list[HeldOut]]:
    """What is told of a search: causes that are worth while, none of which might as well be nothing beside the others.

    Args:
        found: the search.
        windows: data.
        measured: errors on held-out runs of the model before any cause, then after every step.
        seed: of the gains' intervals.

    Returns:
        The search with its last fit's standard errors as they are reported, and the errors that belong to it.
    """
    judged_late: list[Candidate] = []
    while True:
        held = measured(found)
        good = mending(found, held, seed)
        later = _put_last(found, good, windows, judged_late)
        if later is not None:
            found = later
            continue
        found = worthwhile(found, good)
        last = widened(found.last, windows.batch)
        idle = like_nothing(found.steps, last)
        rest = None if idle is None else without(list(found.steps), idle, windows)
        if rest is None:
            return replace(found, last=last), held
        found = found.with_steps(tuple(rest))


def only_moves(step: Step, found: Search) -> bool:
    """It is of parameters that are free to move anyhow: it says that they moved too far, which gains nothing more."""
    return set(step.chosen.keys) <= set(found.first.keys)


def _put_last(found: Search, good: Sequence[bool], windows: Windows, judged_late: list[Candidate]) -> Search | None:
    """A cause that mends too little before others are known, put after them, once each; None where there is no such.

    A misaligned sensor may seem to mend nothing as long as its distance from amidships is not known either.
    """
    steps = list(found.steps)
    for index, step in enumerate(steps):
        candidate = step.chosen.candidate
        if good[index] or not any(good[index + 1 :]) or any(candidate is other for other in judged_late):
            continue
        judged_late.append(candidate)
        rest = without(steps, index, windows)
        if rest is not None:
            last = replace(step, chosen=replace(step.chosen, fit=found.last), before=rest[-1].chosen.fit)
            return found.with_steps((*rest, last))
    return None


def worthwhile(found: Search, good: Sequence[bool]) -> Search:
    """Up to the first cause that mends nothing."""
    return found.with_steps(found.steps[: int(np.argmin([*good, False]))])


def mending(found: Search, held: Sequence[HeldOut], seed: int) -> list[bool]:
    """Which causes mend something where they were not fitted, and not so little that it may be nothing.

    The first cause is sure by its test, which sees more than a simulation shows, unless it makes things worse, or may
    by more than a little and makes some output worse on average: where no model is right, as with real ships, something
    is always significant. Currents that vary make intervals of few runs wide, whatever the cause. For others
    significance alone is not enough: once a large error is mended, what is left shows every small difference between
    any model and a ship. Little gains count when their interval leaves zero out. Parameters that are free to move
    anyhow gain nothing by being named, and must not cost.
    """
    results = [gained(one, other, seed) for one, other in pairwise(held)]
    return [
        _mends(index == 0 or only_moves(step, found), _harmless(*held[index : index + 2]), gain, low, high)
        for index, (step, (gain, (low, high))) in enumerate(zip(found.steps, results, strict=True))
    ]


def _harmless(before: HeldOut, after: HeldOut) -> bool:
    """No output is simulated worse on average."""
    before, after = on_same(before, after)
    return bool(len(before.lost) and (np.nan_to_num(after.fit - before.fit) >= 0.0).all())


def _mends(sure: bool, harmless: bool, gain: float, low: float, high: float) -> bool:
    if sure and high >= 0.0 and (low > -MOST_HARM or harmless):
        return True
    return gain > LEAST_GAIN and (gain > PLAIN_GAIN or low > 0.0)
