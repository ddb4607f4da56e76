"""Terms beyond the catalogue added to a selection, as long as they improve the simulation of held-out data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import (
    CrossValidation,
    Fit,
    HeldOut,
    counting_runs,
    held_out_gain,
    judged,
    log_likelihood_gain,
    on_common_units,
    runs_of,
)
from expdesign.diagnosis.remainder.search import Missing, as_good_as_causes, missing_effects, with_term
from expdesign.diagnosis.remainder.tuning import TUNING
from expdesign.diagnosis.select import (
    FittedCandidate,
    Selection,
    Step,
    p_value_between_runs,
    redundant_step,
    without_step,
)

PARAMETERS = "parameters"
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
    kept: Selection,
    held: Sequence[HeldOut],
    windows: Windows,
    validation: CrossValidation,
    seed: int,
    rejected: Sequence[Fit] = (),
) -> Remainder:
    """Add terms that no cause is, one after the other; end where the next is no term, or gains nothing for certain.

    Other values of parameters imitate terms of another form. So first each such cause is compared with such a term.

    Args:
        kept: the causes of the catalogue.
        held: errors on held-out units of the model before any cause, then after every one.
        windows: data.
        validation: of fits.
        seed: of draws and intervals.
        rejected: fits of causes that are significant and improve nothing on held-out data, first ones first: what is
            missing may show beside the cause that imitates it.
    """
    rng = np.random.default_rng(seed)
    instead = as_good_as_causes(kept.first, kept.last, windows, rng) if kept.steps else ()
    result = Remainder(kept=kept, held=[*held], kinds=(), instead=_visible(instead))
    result = _with_terms_for_parameters(result, windows, validation, rng, seed)
    for _ in range(TUNING.most_terms):
        found = missing_effects(result.kept.last, windows, rng)
        if rejected and not result.kept.steps:
            found = _surer(found, missing_effects(rejected[0], windows, rng))
        if not found:
            break
        if found[0].term is None:
            return replace(result, kinds=_visible(found))
        more = _added(result, found[0], windows, validation, seed)
        if more is None:
            break
        result = more
    return result


def _with_terms_for_parameters(
    result: Remainder, windows: Windows, validation: CrossValidation, rng: np.random.Generator, seed: int
) -> Remainder:
    """Other values of parameters exchanged for a term that is likelier and simulates held-out data better for certain.

    The term takes one number, the parameters at least as many.
    """
    kept = result.kept
    for index, step in enumerate(kept.steps):
        others = without_step([*kept.steps], index, windows) if step.chosen.candidate.cause == PARAMETERS else None
        if others is None:
            continue
        base = others[-1].chosen.fit if others else kept.first
        found = missing_effects(base, windows, rng)
        if not found or found[0].term is None or found[0].term.name in base.ship.library:
            continue
        before = replace(result, kept=replace(kept, steps=tuple(others), last=base))
        more = _added(before, found[0], windows, validation, seed)
        if more is not None and log_likelihood_gain(kept.last, more.kept.last) > 0.0:
            return more
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
    p_value = p_value_between_runs(chosen, None, kept.dispersion)
    step = Step(chosen=chosen, p_value=p_value, alternatives=(), before=kept.last, tests=())
    steps, before = _without_redundant([*kept.steps, step], windows), result.held[-1]
    for order in (list[Step], partial(_last_one_first, windows)):
        ordered = order(steps)
        errors = judged([result.held[0], *(validation.of(item.chosen.fit) for item in ordered)])
        if ordered and before.in_stretches == errors[-1].in_stretches and _clear_gain(before, errors[-1], seed):
            last = counting_runs(ordered[-1].chosen.fit, runs_of(windows), kept.dispersion)
            return replace(result, kept=replace(kept, steps=tuple(ordered), last=last), held=errors)
    return None


def _last_one_first(windows: Windows, steps: list[Step]) -> list[Step]:
    """The same model with its last step taken first; none where that cannot be fitted.

    Where a term takes the place of others, those that are left may lead away from the ship without it.
    """
    *others, term = steps
    fits = [term.chosen.fit]
    for step in reversed(others):
        less = without_step([step, replace(term, chosen=replace(term.chosen, fit=fits[0]))], 0, windows)
        if less is None:
            return []
        fits.insert(0, less[0].chosen.fit)
    befores = [steps[0].before, *fits]
    return [
        replace(step, chosen=replace(step.chosen, fit=found), before=before)
        for step, found, before in zip((term, *others), fits, befores, strict=False)
    ]


def _surer(found: tuple[Missing, ...], other: tuple[Missing, ...]) -> tuple[Missing, ...]:
    """What else is missing, where it is no term and much surer."""
    if not other or other[0].term is not None:
        return found
    statistic = found[0].chosen.statistic if found else 0.0
    return other if statistic < TUNING.as_good * other[0].chosen.statistic else found


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
