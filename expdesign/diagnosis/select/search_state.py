"""What the search has found so far, and how a cause is taken out of it again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import LEVEL, Fit, Scored, fit
from expdesign.diagnosis.select.contenders import PRICE, Contender, gain_over

SHAPE = ("roll:period", "roll:damping")
"""Numbers that are estimated along and say of what kind an effect is, not how large."""


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
    screening: tuple[Scored, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Search:
    """The whole search: its steps, the fit before and after, and the round that found nothing more."""

    steps: tuple[Step, ...]
    first: Fit
    last: Fit
    final_screening: tuple[Scored, ...]

    def with_steps(self, steps: tuple[Step, ...]) -> Search:
        """The same, had it found these only: where they are the first ones, the next round's tests are its last."""
        last = steps[-1].chosen.fit if steps else self.first
        cut = len(steps) < len(self.steps) and steps == self.steps[: len(steps)]
        screening = self.steps[len(steps)].screening if cut else self.final_screening
        return replace(self, steps=steps, last=last, final_screening=screening)


def superfluous(steps: list[Step], windows: Windows) -> int | None:
    """The earliest addition without which the last fit is as good as chance makes it."""
    whole = steps[-1].chosen.fit
    for index, step in enumerate(steps[:-1]):
        less = _less(whole, step, windows)
        if less is None:
            continue
        lost, numbers = gain_over(less, whole, whole), len(_own(step))
        if step.chosen.tests * float(chi2.sf(max(lost, 0.0), max(1, numbers))) > LEVEL or lost < PRICE * numbers:
            return index
    return None


def without(steps: list[Step], index: int, windows: Windows) -> list[Step] | None:
    """The other steps, those after it fitted anew; None where one of them cannot be."""
    kept, before = steps[:index], steps[index].before
    for step in steps[index + 1 :]:
        less = _less(step.chosen.fit, steps[index], windows)
        if less is None:
            return None
        kept = [*kept, replace(step, chosen=replace(step.chosen, fit=less), before=before)]
        before = less
    return kept


def _own(step: Step) -> set[str]:
    """Effects that came with a step."""
    return {*step.chosen.keys, *step.chosen.candidate.free, *step.chosen.candidate.fixed}


def _less(whole: Fit, step: Step, windows: Windows) -> Fit | None:
    """A later fit without the effects of a step, all others estimated anew."""
    own = _own(step)
    kept = tuple(key for key in whole.keys[: whole.free] if key not in own)
    try:
        return fit(whole.ship.without(own), windows, kept, starts=whole.starts, noise=whole.noise,
                   colour_order=whole.noise.order, near=whole.linear)  # fmt: skip
    except (FloatingPointError, np.linalg.LinAlgError):
        return None


def like_nothing(steps: tuple[Step, ...], last: Fit) -> int | None:
    """The step whose estimate says least, if it might as well be nothing; every other one is estimated beside it.

    Args:
        steps: of the search.
        last: the joint fit of all of them, with the standard errors that are reported.

    Source: A. Wald, Transactions of the American Mathematical Society 54 (1943), 426-482.
    """
    p_values = [wald(step.chosen, last) for step in steps]
    worst = int(np.argmax(p_values)) if p_values else 0
    return worst if p_values and p_values[worst] > LEVEL else None


def wald(chosen: Contender, last: Fit) -> float:
    """p-value of the joint estimate of a cause's sizes against zero, or against what the vessel file states."""
    stated = last.ship.stated
    sized = [key for key in chosen.keys if key in last.keys and (key not in SHAPE or key in stated)]
    places = [last.keys.index(key) for key in sized]
    values = np.array([last.value(key) - stated.get(key, 0.0) for key in sized])
    statistic = float(values @ np.linalg.lstsq(last.covariance[np.ix_(places, places)], values, rcond=None)[0])
    freedom = len(sized)
    if chosen.searched is not None and chosen.searched[0] in chosen.candidate.free:
        key, error = chosen.searched
        moved = last.value(key) - stated.get(key, 0.0)
        statistic, freedom = statistic + (moved / error) ** 2, freedom + 1
    if not np.isfinite(statistic):  # an error that could not be told: the estimate says nothing
        return 1.0
    return float(chi2.sf(statistic, freedom)) if freedom else 0.0
