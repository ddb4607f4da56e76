"""Terms beyond the catalogue added to a selection, as long as they improve the simulation of held-out data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import CrossValidation, HeldOut, cluster_robust, held_out_gain, judged, on_common_units
from expdesign.diagnosis.remainder.search import Missing, as_good_as_causes, missing_effects, with_term
from expdesign.diagnosis.remainder.tuning import TUNING
from expdesign.diagnosis.select import FittedCandidate, Selection, Step, redundant_step, without_step

UNLISTED = "unlisted_term"
"""Kind of such causes; the rest of their name says what they look like."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Remainder:
    """What was found beside the causes of the catalogue.

    Attributes:
        kept: the selection with the terms that were added, and without causes that these make redundant.
        held: errors on held-out units, of the model before any cause and after every one.
        kinds: what is missing and cannot be added, surest first.
        instead: what explains about as much as the causes, and cannot be added.
    """

    kept: Selection
    held: list[HeldOut]
    kinds: tuple[Missing, ...]
    instead: tuple[Missing, ...]


def with_unlisted_terms(
    kept: Selection, held: Sequence[HeldOut], windows: Windows, validation: CrossValidation, seed: int
) -> Remainder:
    """Add terms that no cause is, one after the other; end where the next is no term, or gains nothing for certain.

    Args:
        kept: the causes of the catalogue.
        held: errors on held-out units of the model before any cause, then after every one.
        windows: data.
        validation: of fits.
        seed: of draws and intervals.
    """
    rng = np.random.default_rng(seed)
    instead = as_good_as_causes(kept.first, kept.last, windows, rng) if kept.steps else ()
    result = Remainder(kept=kept, held=[*held], kinds=(), instead=_visible(instead))
    for _ in range(TUNING.most_terms):
        found = missing_effects(result.kept.last, windows, rng)
        if not found:
            break
        if found[0].term is None:
            return replace(result, kinds=_visible(found))
        more = _added(result, found[0], windows, validation, seed)
        if more is None:
            break
        result = more
    return result


def _added(
    result: Remainder, missing: Missing, windows: Windows, validation: CrossValidation, seed: int
) -> Remainder | None:
    """One term more, without the causes that it makes redundant; None where it does not gain enough."""
    kept = result.kept
    fitted = with_term(kept.last, windows, missing)
    if fitted is None:
        return None
    found, key, statistic = fitted
    chosen = FittedCandidate(
        candidate=Candidate(cause=f"{UNLISTED}:{missing.words}", free={key: 0.0}),
        fit=found,
        likelihood_gain=statistic,
        penalised_gain=statistic,
        keys=(key,),
        multiplicity=float(TUNING.regressors),
    )
    p_value = min(1.0, TUNING.regressors * float(scipy.stats.chi2.sf(max(statistic, 0.0), 1)))
    step = Step(chosen=chosen, p_value=p_value, alternatives=(), before=kept.last, tests=())
    steps = _without_redundant([*kept.steps, step], windows)
    errors = judged([result.held[0], *(validation.of(item.chosen.fit) for item in steps)])
    before = result.held[-1]
    after = errors[-1]
    if before.in_stretches != after.in_stretches or not _clear_gain(before, after, seed):
        return None
    last = cluster_robust(steps[-1].chosen.fit, windows.batch)
    return replace(result, kept=replace(kept, steps=tuple(steps), last=last), held=errors)


def _visible(found: Sequence[Missing]) -> tuple[Missing, ...]:
    """Kinds that take a visible share off the error of held-out data."""
    return tuple(item for item in found if item.term is None and item.share > TUNING.least_share)


def _without_redundant(steps: list[Step], windows: Windows) -> list[Step]:
    """The steps without those that the last one makes redundant."""
    while (index := redundant_step(steps, windows)) is not None:
        others = without_step(steps, index, windows)
        if others is None:
            break
        steps = others
    return steps


def _clear_gain(before: HeldOut, after: HeldOut, seed: int) -> bool:
    """Whether the interval of the gain excludes zero and the error of some output falls visibly."""
    _, (low, _) = held_out_gain(before, after, seed)
    one, other = on_common_units(before, after)
    lost, left = one.squared_error.sum(axis=0), other.squared_error.sum(axis=0)
    return low > 0.0 and bool((left <= (1.0 - TUNING.least_reduction) ** 2 * lost).any())
