"""Forward selection: add the best cause until none is significant."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import (
    CrossValidation,
    Fit,
    FitOptions,
    HeldOut,
    fit,
    held_out_gain,
    judged,
    leads_away,
    log_likelihood_gain,
)
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import fitted_start
from expdesign.diagnosis.select.fitted_candidate import FittedCandidate, profile_estimate
from expdesign.diagnosis.select.score_tests import ScoreTest
from expdesign.diagnosis.select.selection import Selection, Step, redundant_step, without_step
from expdesign.diagnosis.select.selection_round import (
    NEARLY_AS_MUCH,
    Work,
    best_step,
    has_rivals,
    round_tests,
    same_effects_as_any,
    selection_round,
)
from expdesign.diagnosis.select.shortlist import listed_causes
from expdesign.diagnosis.select.starting_point import nearer_in_short_windows
from expdesign.diagnosis.select.tuning import TUNING
from expdesign.progress import Estimated
from expdesign.values import Array

NUISANCE_STEPS = 12  # Gauss-Newton steps of the fit before anything is tested, at most
MOST_FINDINGS = 6  # causes, at most
MOST_REJECTED = 4  # causes that are removed again, at most
MOST_EXCHANGES = 2  # of a cause for another that gains more beside the rest, at most


def select_forward(
    ship: ExtendedModel,
    windows: Windows,
    starts: Array,
    rng: np.random.Generator,
    progress: Estimated,
    validation: CrossValidation,
    suspected: Sequence[str] = (),
) -> Selection:
    """Add causes until nothing significant is left, and take out those that later ones make redundant.

    A cause that approximated another one becomes redundant once that one is found. The selection then continues without
    it, with later causes fitted without it, of which others may become redundant. Many parameters at once explain
    nearly any data. So before such a block is added, causes with fewer effects are tried one after the other. Many
    numbers may also make a right cause redundant that simulates held-out data better; then they are taken out
    themselves. At the end, causes are compared once more with their best replacement, where another one beside them
    improves the simulation of held-out data too, and a test leaves room for it.
    The search ends where a cause after the first improves nothing on held-out data: no model of a real ship is exact,
    and tests always find more.
    """
    base = first = fit_nuisance(ship, windows, starts)
    steps: list[Step] = []
    rejected: list[Candidate] = []
    exchanges, work = 0, Work(progress=progress, suspected=tuple(suspected))
    while True:
        search = _Search(windows=windows, rejected=tuple(rejected), rng=rng, work=work, validation=validation)
        gains = _gains([first, *(step.chosen.fit for step in steps)], validation)
        idle = not all(gains[-1:])
        step, tests = (None, search.tests(base)) if idle else search.round(base)
        work.rounds_left = listed_causes(tests) + len(steps)  # each step is compared with others at the end
        if (
            step is None
            and sum(gains) > 1
            and exchanges < MOST_EXCHANGES
            and (len(steps) < 2 or work.allows("exchanges of causes"))
        ):
            exchanges += 1
            useful = steps[: max(place + 1 for place, one in enumerate(gains) if one)]
            exchanged = _exchange(useful, steps[len(useful)].tests if idle else tests, search)
            if exchanged is not None:
                steps, base = exchanged, exchanged[-1].chosen.fit
                continue
        if step is None or len(steps) == MOST_FINDINGS:
            steps = _with_joint_profiles(steps)
            found = Selection(steps=tuple(steps), first=first, last=base, last_tests=tests, untried=tuple(work.untried))
            return found.with_steps(tuple(steps))
        steps += _smaller_causes(step, search) if step.chosen.is_block else [step]
        del steps[MOST_FINDINGS:]
        base = steps[-1].chosen.fit
        while steps and len(rejected) < MOST_REJECTED and (redundant := _to_reject(steps, search)) is not None:
            rejected.append(steps[redundant].chosen.candidate)
            without, before = without_step(steps, redundant, windows), steps[redundant].before
            steps = steps[:redundant] if without is None else without
            base = steps[-1].chosen.fit if steps else before


def _gains(fits: Sequence[Fit], validation: CrossValidation) -> list[bool]:
    """Which fits improve on the one before them in simulations of held-out data; of one cause alone it is not asked.

    Where these simulations are short stretches, because whole ones lead away, a gain counts if its interval excludes
    zero.
    """
    if len(fits) < 3:
        return [True] * (len(fits) - 1)
    held = judged([validation.of(item) for item in fits])
    gains = [held_out_gain(*pair, 0) for pair in pairwise(held)]
    least = TUNING.least_gain_points
    return [not (gain <= least or (held[0].in_stretches and low <= 0.0)) for gain, (low, _) in gains]


def _gains_last(first: Fit, steps: Sequence[Step], validation: CrossValidation) -> bool:
    """Whether the last step improves on those before it, or is the first."""
    return all(_gains([first, *(step.chosen.fit for step in steps)], validation)[-1:])


def to_take_out(steps: Sequence[Step], redundant: int) -> int:
    """The step to take out where one is redundant: the last one, if that only imitates what the other explains.

    A cause with many numbers makes simpler ones redundant whether or not it acts. It has to gain more than they do, and
    to simulate held-out data better.
    """
    simple, last = steps[redundant].chosen, steps[-1].chosen
    if same_effects_as_any(last.candidate, steps[redundant].outranked):
        return len(steps) - 1
    if not last.candidate.imitates or simple.candidate.imitates or len(simple.keys) >= len(last.keys):
        return redundant
    both = simple.likelihood_gain + last.likelihood_gain
    return len(steps) - 1 if simple.likelihood_gain >= NEARLY_AS_MUCH * both else redundant


def _to_reject(steps: list[Step], search: _Search) -> int | None:
    """The step to take out: one that is redundant, or the last one; None where all are needed."""
    last = len(steps) - 1
    if last and leads_away(search.held(steps[last])) and not leads_away(search.held(steps[last - 1])):
        return last
    redundant = redundant_step(steps, search.windows)
    if redundant is None:
        return None
    redundant = to_take_out(steps, redundant)
    return last if redundant < last and _leaves_worse(steps, redundant, search) else redundant


def _leaves_worse(steps: list[Step], redundant: int, search: _Search) -> bool:
    """Whether the others without a redundant step simulate held-out data clearly worse than those without the last."""
    others = without_step(steps, redundant, search.windows)
    if others is None:
        return False
    held = judged([search.held(item[-1]) for item in (steps[:-1], others)], first=0)
    without_last, without_redundant = (item.mean_fit for item in held)
    return without_last > without_redundant + TUNING.clear_gain_points


@dataclass(frozen=True, kw_only=True, eq=False)
class _Search:
    """The arguments that all rounds of a stage share."""

    windows: Windows
    rejected: tuple[Candidate, ...]
    rng: np.random.Generator
    work: Work
    validation: CrossValidation

    def held(self, step: Step) -> HeldOut:
        """Errors on held-out data of the model with a step and those before it."""
        return self.validation.of(step.chosen.fit)

    def tests(self, base: Fit) -> tuple[ScoreTest, ...]:
        """Tests of what is left."""
        return round_tests(base, self.windows, self.rejected, self.rng, self.work)

    def exchanged(self, base: Fit, old: Candidate) -> Step | None:
        """The best cause beside a fit; None where that can only be the one that was taken out, or there is none."""
        tests = self.tests(base)
        if not has_rivals(old, tests):
            return None
        return best_step(base, self.windows, tests, self.work, self.validation)

    def round(self, base: Fit, *, most: int = 99) -> tuple[Step | None, tuple[ScoreTest, ...]]:
        """One round from a fit, with candidates of at most so many effects."""
        return selection_round(base, self.windows, self.rejected, self.rng, self.work, self.validation, most=most)


def fit_nuisance(ship: ExtendedModel, windows: Windows, starts: Array) -> Fit:
    """The model in use at the likeliest values of its uncertain parameters, with the noise estimated there.

    Far from there the remainder overestimates the noise, and any cause that lets the fit continue seems significant.
    Noise that was estimated on the way holds some of what the parameters explain since, as a random current or slow
    noise that hides causes; so it is estimated from white noise on, too, and the likelier one kept. What runs away from
    where else a fit may begin is no answer, and the first one stays.
    """
    found = fit(ship, windows, (), starts=starts, options=FitOptions(steps=NUISANCE_STEPS))
    if not found.keys:
        return found
    options = FitOptions(noise=found.noise, steps=NUISANCE_STEPS, warm_start=found)
    found = fit(found.ship, windows, (), starts=found.starts, options=options)
    begin = nearer_in_short_windows(ship, windows, found) or found.ship
    anew, afresh = FitOptions(steps=NUISANCE_STEPS, warm_start=found), FitOptions(steps=NUISANCE_STEPS)
    fits = [found]
    with suppress(FloatingPointError, np.linalg.LinAlgError):
        fits.append(fit(found.ship, windows, (), starts=found.starts, options=anew))
    with suppress(FloatingPointError, np.linalg.LinAlgError):
        fits.append(fit(begin, windows, (), starts=fitted_start(begin, windows), options=afresh))
    return min(fits, key=_deviance)


def _deviance(item: Fit) -> float:
    return item.deviance


def _smaller_causes(block: Step, search: _Search) -> list[Step]:
    """Causes with fewer effects, one after the other, if they gain more than a block of parameters; else the block.

    They end, as the search does, where one after the first improves nothing on held-out data.
    """
    size, base, path, count = len(block.chosen.keys), block.before, list[Step](), 0
    while count < size and len(path) < MOST_FINDINGS and _gains_last(block.before, path, search.validation):
        step, _ = search.round(base, most=size - 1)
        if step is None:
            break
        path.append(step)
        count += len(step.chosen.candidate.free)
        base = step.chosen.fit
    if all(step.chosen.candidate.cause == "parameters" for step in path):
        return [block]
    return path if log_likelihood_gain(block.chosen.fit, base) - TUNING.price * (count - size) > 0 else [block]


def _exchange(steps: list[Step], tests: Sequence[ScoreTest], search: _Search) -> list[Step] | None:
    """The steps with one of them exchanged for a cause that gains more beside the others; None where there is none.

    Args:
        tests: of what is left beside all of them.
    """
    for index, old in enumerate(steps[:-1]):
        if not _could_gain_more(tests, old.chosen):
            continue
        others = without_step(steps, index, search.windows)
        if others is None:
            continue
        search.work.rounds_left = len(steps) - 2 - index
        new = search.exchanged(others[-1].chosen.fit, old.chosen.candidate)
        if new is not None and _gains_more(new.chosen, old.chosen, steps[-1].chosen.fit):
            return [*others, new]
    return None


def _could_gain_more(tests: Sequence[ScoreTest], old: FittedCandidate) -> bool:
    """Whether a candidate may gain more in place of another one: by no more than it does beside that, which tests tell.

    One with fewer numbers may gain less and take its place.
    """
    return any(
        test.candidate.size < len(old.keys)
        or test.is_beyond_noise(TUNING.price * (test.candidate.size - len(old.keys)))
        for test in tests
    )


def _gains_more(new: FittedCandidate, old: FittedCandidate, whole: Fit) -> bool:
    """Whether the new cause gains more; `whole` is the fit with the old one."""
    if same_effects_as_any(new.candidate, [old.candidate]):
        return False
    extra_price = (new.likelihood_gain - new.penalised_gain) - (old.likelihood_gain - old.penalised_gain)
    return log_likelihood_gain(whole, new.fit) > extra_price


def _with_joint_profiles(steps: list[Step]) -> list[Step]:
    """Profiled effects are estimated again beside the causes that were added after them."""
    for index, step in enumerate(steps[:-1]):
        if step.chosen.profiled is None or not step.chosen.profiled[1] > 0:
            continue
        key, std = step.chosen.profiled
        *others, last = steps
        found, std = profile_estimate(last.chosen.fit, key, std)
        others[index] = replace(step, chosen=replace(step.chosen, profiled=(key, std)))
        steps = [*others, replace(last, chosen=replace(last.chosen, fit=found))]
    return steps
