"""What remains beside all causes: terms to add to the model, one after the other, or the kind of what it is."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import AXES
from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import (
    CrossValidation,
    Fit,
    FitOptions,
    HeldOut,
    build_sensitivities,
    continuing,
    counting_runs,
    deviations_of,
    directions_between_runs,
    effect_disturbances,
    fit,
    gram_matrices,
    held_out_gain,
    in_groups,
    judged,
    log_likelihood_gain,
    of_several,
    on_common_units,
    runs_of,
    tail,
    window_information,
)
from expdesign.diagnosis.motion import exogenous_inputs, initial_states, term_disturbances
from expdesign.diagnosis.remainder.kinds import Kind, kinds
from expdesign.diagnosis.remainder.stability_selection import (
    MOST_TERMS,
    Chosen,
    UnitInformation,
    stable_selection,
    term_dictionary,
)
from expdesign.diagnosis.select import (
    FittedCandidate,
    Selection,
    Step,
    p_value_between_runs,
    redundant_step,
    without_step,
)
from expdesign.estimation.solve import Dispersion, few_runs_factor
from expdesign.own_units import covariance_of, solution_of
from expdesign.values import Array
from expdesign.vessel import Term

WINDOW_S, FEWEST_SAMPLES = 30.0, 20  # length of the windows that the search simulates
STEPS = 3  # of the fit in these
WHOLE = (0.6, 1.4)  # sizes between which an effect counts as there or not is there
REGRESSORS = 300  # about so many are tried, by which p-values are multiplied
MOST_UNITS = 200  # that one or two runs are divided into
LEVEL = 0.025  # of the p-value of a size, adjusted for the number of regressors
LEAST_SHARE = 0.02  # of the whitened squared error of held-out data that a kind of effect must take away to be named
AS_GOOD = 0.8  # share of the likelihood gained by causes from which on a kind of effect is named beside them
LEAST_REDUCTION = 0.05  # share by which the error of some output must fall on held-out data


@dataclass(frozen=True, kw_only=True, eq=False)
class Missing:
    """Something that no cause explains and the data surely show."""

    words: str  # what it looks like
    unit: str  # of its size
    # value, std: its size by the linear model of the fit
    value: float
    std: float
    chosen: Chosen  # how sure it is
    share: float  # of the whitened squared error of held-out units that it takes away
    term: Term | None  # to add to the model; None where a vessel file cannot hold it


def missing_effects(base: Fit, windows: Windows, rng: np.random.Generator) -> tuple[Missing, ...]:
    """A sparse sum of terms and of kinds of effects that explains what a fit leaves, best first; empty for noise.

    Long windows show small effects, short ones large effects, which would lead a long simulation away from the ship.
    """
    tried = [_missing_from(item, rng) for item in (base, _begun_anew(base, windows))]
    return max(tried, key=lambda found: found[0].chosen.statistic if found else 0.0)


def _missing_from(base: Fit, rng: np.random.Generator) -> tuple[Missing, ...]:
    """Missing effects in the windows of a fit."""
    windows, ship = base.linear.motion.windows, base.ship
    terms = term_dictionary(ship.model, ship.library)
    wider = replace(ship, library={**ship.library, **terms})
    keys = [f"term:{name}" for name in (*ship.library, *terms) if f"term:{name}" not in base.keys]
    others, unit, size, names = kinds(base.linear), _units(windows), 0.0, list[str]()
    sums: tuple[Array, Array] | None = None
    for mask, linear in in_groups(base.linear, len(base.keys) + len(keys) + len(others)):
        motion = linear.motion
        motion = replace(motion, ship=wider, exogenous=exogenous_inputs(wider, motion.windows))
        steady = term_disturbances(replace(linear, motion=motion), keys)
        names = [key.removeprefix("term:") for key in steady]
        disturbances = [
            *effect_disturbances(linear, base.keys),
            *steady.values(),
            *(kind.disturbance(linear) for kind in others),
        ]
        found = build_sensitivities(linear, disturbances, random_current=base.noise.current_std_mps > 0)
        grams = gram_matrices(found, base.noise)
        parts, size = window_information(grams, found, base.noise), size + float(grams.ee.sum())
        sums = _added_by_unit(sums, parts, unit[mask], int(unit.max()) + 1)
    assert sums is not None
    given = UnitInformation(A=sums[0], s=sums[1], precision=base.precision, offset=deviations_of(ship, base.keys))
    chosen = stable_selection(_without(given, _impossible(given, len(names), others)), rng)
    sizes = _sizes(given, [item.index for item in chosen])
    known = _between_units(given, [item.index for item in chosen])
    listed, surely = [wider.library[name] for name in names], list[Missing]()
    for item, (value, std) in zip(chosen, sizes, strict=True):
        factor, freedom = known.alone
        p_value = of_several(tail(item.statistic, 1, factor, freedom), REGRESSORS)
        if not p_value <= LEVEL:
            break  # what was chosen later stands beside this
        wider_std = std * float(np.sqrt(factor) * few_runs_factor(freedom))
        surely.append(_missing(listed, others, item, value, wider_std, size))
    return tuple(surely)


def _between_units(given: UnitInformation, chosen: Sequence[int]) -> Dispersion:
    """How much the sizes of regressors differ between units, beside those that are chosen."""
    n = len(given.precision)
    c = n + len(chosen)
    order = [*range(n), *(n + place for place in chosen)]
    order += [place for place in range(given.A.shape[1]) if place not in set(order)]
    A, s = given.A[:, order][:, :, order], given.s[:, order]
    precision = np.zeros((c, c))
    precision[:n, :n] = given.precision
    score = s.sum(axis=0)[:c]
    score[:n] -= given.precision @ given.offset
    step = solution_of(A.sum(axis=0)[:c, :c] + precision, score)
    left = s - A[:, :, :c] @ step
    parts = A[:, :c, :c], A[:, :c, c:], np.diagonal(A, axis1=1, axis2=2)[:, c:]
    return Dispersion.of(directions_between_runs(parts, (left[:, :c], left[:, c:]), precision))


def _begun_anew(base: Fit, windows: Windows) -> Fit:
    """The fit in windows of `WINDOW_S`: simulated from what is measured, the path stays near the ship's own."""
    short = windows.cut_shorter(max(FEWEST_SAMPLES, round(WINDOW_S / windows.sample_s)))
    starts = initial_states(short, base.ship.states)
    try:
        return fit(base.ship, short, base.free_keys, starts=starts, options=FitOptions(steps=STEPS))
    except (FloatingPointError, np.linalg.LinAlgError):
        return base


def as_good_as_causes(first: Fit, last: Fit, windows: Windows, rng: np.random.Generator) -> tuple[Missing, ...]:
    """The kind of effect that explains about as much as all causes between two fits, if there is one.

    Whatever is not in the catalogue may be imitated by causes that are.
    """
    found = missing_effects(first, windows, rng)
    if not found or found[0].term is not None:
        return ()
    gain = log_likelihood_gain(_begun_anew(first, windows), _begun_anew(last, windows))
    return found[:1] if found[0].chosen.statistic > AS_GOOD * gain else ()


def _impossible(given: UnitInformation, terms: int, others: tuple[Kind, ...]) -> list[int]:
    """Places of kinds that act as a whole or not at all, and whose size is far from one."""
    A, s = given.beside_nuisance(np.ones(len(given.A), dtype=bool))
    sizes = s / np.maximum(np.diag(A), 1e-300)
    low, high = WHOLE
    return [terms + at for at, kind in enumerate(others) if kind.whole and not low < sizes[terms + at] < high]


def _without(given: UnitInformation, places: list[int]) -> UnitInformation:
    """The information without that about some regressors, so that they are never chosen."""
    A, s = given.A.copy(), given.s.copy()
    rows = [len(given.precision) + place for place in places]
    A[:, rows], A[:, :, rows], s[:, rows] = 0.0, 0.0, 0.0
    return replace(given, A=A, s=s)


def _units(windows: Windows) -> NDArray[np.int64]:
    """(w,) unit of every window: its run, where there are enough runs; else windows, or a few in a row where many."""
    runs = np.unique(windows.batch)
    if len(runs) >= 3:
        return np.searchsorted(runs, windows.batch)
    count = len(windows.batch)
    return np.arange(count) * min(count, MOST_UNITS) // count


def _added_by_unit(
    sums: tuple[Array, Array] | None, parts: tuple[Array, Array], unit: NDArray[np.int64], units: int
) -> tuple[Array, Array]:
    """Sums of window information by units, with those of more windows, given the unit (w,) of each."""
    A, s = (np.zeros((units, *part.shape[1:])) for part in parts) if sums is None else sums
    for number in np.unique(unit):
        A[number] += parts[0][unit == number].sum(axis=0)
        s[number] += parts[1][unit == number].sum(axis=0)
    return A, s


def _sizes(given: UnitInformation, chosen: list[int]) -> list[tuple[float, float]]:
    """Values and standard errors of a sum of regressors."""
    A, s = given.beside_nuisance(np.ones(len(given.A), dtype=bool))
    block = A[np.ix_(chosen, chosen)]
    values, std = solution_of(block, s[chosen]), np.sqrt(np.diag(covariance_of(block)))
    return list(zip(values.tolist(), std.tolist(), strict=True))


def _missing(
    terms: list[Term], others: tuple[Kind, ...], chosen: Chosen, value: float, std: float, whole: float
) -> Missing:
    if chosen.index < len(terms):
        term = terms[chosen.index]
        words, unit = f"a term like {term.expression} in {AXES[term.equation]}", ""
    else:
        kind, term = others[chosen.index - len(terms)], None
        words, unit = kind.words, kind.unit
    share = chosen.held_out / whole
    return Missing(words=words, unit=unit, value=value, std=std, chosen=chosen, share=share, term=term)


def with_term(base: Fit, windows: Windows, missing: Missing) -> tuple[Fit, str, float] | None:
    """The fit with a term added, its effect and its likelihood ratio; None where it is no term or cannot be fitted."""
    if missing.term is None:
        return None
    term = replace(missing.term, name=_name(missing.term, {*base.ship.model.names, *base.ship.library}))
    key = f"term:{term.name}"
    ship = replace(base.ship, library={**base.ship.library, term.name: term}).with_effects({key: 0.0})
    try:
        found = fit(ship, windows, (*base.free_keys, key), starts=base.starts, options=continuing(base))
    except (FloatingPointError, np.linalg.LinAlgError):
        return None
    return found, key, log_likelihood_gain(base, found)


def _name(term: Term, taken: set[str]) -> str:
    """X, Y or N and what the term reads; a library term keeps its name."""
    if term.name in taken and "_more_" not in term.name:
        return term.name
    text = re.sub(r"[^A-Za-z0-9]+", "_", term.expression).strip("_")
    name = f"{term.name[0]}_{text}"
    return name if name not in taken else f"{name}_found"


PARAMETERS = "parameters"
UNLISTED = "unlisted_term"  # kind of such causes; the rest of their name says what they look like


@dataclass(frozen=True, kw_only=True, eq=False)
class Remainder:
    """What was found beside the causes of the catalogue."""

    kept: Selection  # the selection with the terms that were added, and without causes that these make redundant
    held: list[HeldOut]  # errors on held-out units, of the model before any cause and after every one
    kinds: tuple[Missing, ...]  # what is missing and cannot be added, surest first
    instead: tuple[Missing, ...]  # what explains about as much as the causes, and cannot be added


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
        held: errors on held-out units of the model before any cause, then after every one.
        rejected: fits of causes that are significant and improve nothing on held-out data, first ones first: what is
            missing may show beside the cause that imitates it. What shows only without that cause may imitate it, and
            is as uncertain.
    """
    rng = np.random.default_rng(seed)
    instead = as_good_as_causes(kept.first, kept.last, windows, rng) if kept.steps else ()
    result = Remainder(kept=kept, held=[*held], kinds=(), instead=_visible(instead))
    result = _with_terms_for_parameters(result, windows, validation, rng, seed)
    for _ in range(MOST_TERMS):
        found = missing_effects(result.kept.last, windows, rng)
        if rejected and not result.kept.steps:
            beside = missing_effects(rejected[0], windows, rng)
            found = _surer(found, beside) if beside else tuple(item for item in found[:1] if item.term is not None)
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
        multiplicity=float(REGRESSORS),
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
    return other if statistic < AS_GOOD * other[0].chosen.statistic else found


def _visible(found: Sequence[Missing]) -> tuple[Missing, ...]:
    """Kinds that take a visible share off the error of held-out data."""
    return tuple(item for item in found if item.term is None and item.share > LEAST_SHARE)


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
    return low > 0.0 and bool((left <= (1.0 - LEAST_REDUCTION) ** 2 * lost).any())
