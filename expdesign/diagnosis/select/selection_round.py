"""One round of forward selection: test all candidates, fit the best of them, choose one."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from expdesign.diagnosis.causes import CAUSES, Candidate, Situation
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import CrossValidation, Fit, held_out_gain, judged, leads_away
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.select.fitted_candidate import (
    FittedCandidate,
    Rival,
    fit_candidate,
    fit_to_convergence,
    kind_of,
    ranked_by_gain,
    with_noise_begun_anew,
    with_profile_estimate,
)
from expdesign.diagnosis.select.score_tests import ScoreTest, score_tests
from expdesign.diagnosis.select.selection import Step, wald_p_value
from expdesign.diagnosis.select.shortlist import ABOUT_AS_LIKELY, starting_points
from expdesign.diagnosis.select.starting_point import (
    StartingPoint,
    starting_point,
)
from expdesign.diagnosis.select.tuning import TUNING
from expdesign.processes import in_order
from expdesign.progress import Estimated, silent

# share of the likelihood gain of the chosen candidate from which on another may be equivalent, where runs differ so
# that the difference counts less
RIVAL_SHARE = 0.5
FIRST_STEPS = 3  # Gauss-Newton steps of every candidate
LEADING_SHARE = 0.6  # candidates that then gain less than this share of the best are dropped
SIMPLE_SHARE = 0.3  # the same of those with fewer numbers than the best
RIVALS = 3  # candidates with fewer numbers that are compared with the best on held-out data, at most
# share of the gain of a candidate that imitates many causes which one with fewer numbers needs to come first
NEARLY_AS_MUCH = 0.7
TESTS_WORK = 18.0  # time of the tests of a round, and of a round, in simulations of all data
ROLL_WORK = 15.0  # time of a simulation with roll, which is stepped through, in simulations without


# The work of a search: counted, limited, what is expected to be left of it, and what it leaves untried.


@dataclass(kw_only=True)
class Work:
    """Simulations of all data in fits of candidates, spent by the search that owns it."""

    simulations: int = 0  # so far
    suspected: tuple[str, ...] = ()  # effects that were named before, whose tests need no allowance for others
    untried: list[str] = field(default_factory=list)  # what was left out once the limit was reached, in order
    rounds_left: int = TUNING.first_rounds  # expected after the present one
    # of the search and of what follows, in simulations of all data without roll
    progress: Estimated = field(default_factory=lambda: Estimated(silent))
    _fits: tuple[Fit | None, dict[Hashable, Any]] = field(default_factory=lambda: (None, {}), repr=False)

    def fits_beside(self, base: Fit) -> dict[Hashable, Any]:
        """Fits of candidates beside this one, for another round from it; those beside others are forgotten."""
        if self._fits[0] is not base:
            self._fits = base, {}
        return self._fits[1]

    def spend(self, simulations: int, each: float = 1.0) -> None:
        """Count some, each with the work of so many without roll."""
        self.simulations += simulations
        self.progress.done += simulations * each

    def tell(self, activity: str, left: float) -> None:
        """What is done next, and the work left in this round."""
        self.progress.tell(activity, left + self.rounds_left * TUNING.round_work)

    def allows(self, what: str) -> bool:
        """Whether the limit allows more; otherwise that is noted as untried."""
        if self.simulations < TUNING.most_simulations:
            return True
        if what not in self.untried:
            self.untried.append(what)
        return False


def work_of_simulation(ship: ExtendedModel) -> float:
    """Of all data, beside one without roll."""
    return 1.0 if ship.roll is None else ROLL_WORK


FURTHER = "further causes"
"""What is left untried once no round is allowed any more."""


def selection_round(
    base: Fit,
    windows: Windows,
    rejected: Sequence[Candidate],
    rng: np.random.Generator,
    work: Work,
    validation: CrossValidation,
    *,
    most: int = 99,
) -> tuple[Step | None, tuple[ScoreTest, ...]]:
    """Test and fit the candidates, and choose the best; None where none is significant.

    Args:
        base: the fit of the findings so far.
        rejected: candidates that are not tried again.
        rng: of the null distribution.
        most: effects that a candidate may have.
    """
    tests = round_tests(base, windows, rejected, rng, work, most=most)
    return best_step(base, windows, tests, work, validation), tests


def round_tests(
    base: Fit,
    windows: Windows,
    rejected: Sequence[Candidate],
    rng: np.random.Generator,
    work: Work,
    *,
    most: int = 99,
) -> tuple[ScoreTest, ...]:
    """Score tests of a round, with arguments as in `selection_round`."""
    work.tell("testing causes", TUNING.round_work)
    work.fits_beside(base)  # before the tests, which need the memory of others
    candidates = [
        c for c in open_candidates(base, windows) if not same_effects_as_any(c, rejected) and len(c.free) <= most
    ]
    tests = _asked_first(score_tests(base, candidates, rng), work.suspected)
    work.progress.done += TESTS_WORK
    return tests


def _asked_first(tests: tuple[ScoreTest, ...], suspected: Sequence[str]) -> tuple[ScoreTest, ...]:
    """The tests with those of one effect that was named before in front: each is one question among no others."""

    def named(test: ScoreTest) -> bool:
        return len(test.candidate.free) == 1 and not test.candidate.fixed and set(test.candidate.free) <= {*suspected}

    return (
        *(replace(test, multiplicity=1.0) for test in tests if named(test)),
        *(test for test in tests if not named(test)),
    )


def same_effects_as_any(candidate: Candidate, others: Sequence[Candidate]) -> bool:
    """Whether another candidate has the same cause and effects, with any first guess."""
    return any(candidate.cause == other.cause and set(candidate.free) == set(other.free) for other in others)


def has_rivals(candidate: Candidate, tests: Sequence[ScoreTest]) -> bool:
    """Whether another candidate's statistic is a good share of this one's, so that it may gain more once fitted."""
    own = [test.statistic for test in tests if same_effects_as_any(test.candidate, [candidate])]
    others = [test.statistic for test in tests if not same_effects_as_any(test.candidate, [candidate])]
    least = LEADING_SHARE * max(own, default=0.0) - TUNING.statistic_margin
    return max(others, default=0.0) > least


def open_candidates(base: Fit, windows: Windows) -> list[Candidate]:
    """Every candidate of the catalogue that these data can show and the fit does not have."""
    situation = Situation(ship=base.ship, windows=windows)
    return [
        candidate
        for cause in CAUSES
        for candidate in cause.candidates(situation)
        if not set(candidate.free) & set(base.free_keys)
    ]


def best_step(
    base: Fit, windows: Windows, tests: tuple[ScoreTest, ...], work: Work, validation: CrossValidation
) -> Step | None:
    """The best candidate of a round's tests, fitted; None where none is significant."""
    if not work.allows(FURTHER):
        return None
    points, far = starting_points(base, windows, tests, work.fits_beside(base))
    rough = _rough_fits(base, windows, points, work, far=far)
    possible = [item for item in rough if _is_possible(item)]
    astray = leads_away(validation.of(base))
    fitted = _significant(base, windows, ranked_by_gain(base, possible), work, all_of_them=astray)
    accepted = [item for item in fitted if item.p_value <= TUNING.accepted_p_value and _is_possible(item)]
    if not accepted:
        return None
    first = simplest(accepted)
    chosen = _best_on_held_out(first, accepted, validation, astray=astray)
    outranked = () if chosen is first else (first.candidate,)
    worse = set() if first.candidate.imitates else {one.cause for one in outranked}
    others = [item for item in fitted if item.candidate.cause not in worse]
    return Step(
        chosen=with_profile_estimate(with_noise_begun_anew(base, windows, chosen), base),
        p_value=chosen.p_value,
        alternatives=_alternatives(chosen, others),
        before=base,
        tests=tests,
        outranked=outranked,
    )


def _rough_fits(
    base: Fit, windows: Windows, points: Sequence[StartingPoint], work: Work, *, far: bool
) -> list[FittedCandidate]:
    """Fits of few steps from these points; those of an earlier round from the same base are not made again."""
    known = work.fits_beside(base)
    keys = [(far, point.keys, tuple(sorted(point.effects.items()))) for point in points]
    waiting = {key: point for key, point in zip(keys, points, strict=True) if key not in known}
    efforts = [(FIRST_STEPS + 1) * work_of_simulation(base.ship.with_effects(p.effects)) for p in waiting.values()]
    results = in_order(_rough_fit, (base, windows, far), [(point,) for point in waiting.values()])
    for index, (key, point) in enumerate(waiting.items()):
        work.tell(f"fitting {point.test.candidate.cause}", sum(efforts[index:]))
        if not work.allows(f"{point.test.candidate.cause} beside {len(base.free_keys)} effects"):
            continue  # nor will it allow the others
        candidate = known[key] = next(results)
        if candidate is not None:
            work.spend(candidate.fit.simulations, work_of_simulation(candidate.fit.ship))
    fitted = [(known.get(key), point.test) for key, point in zip(keys, points, strict=True)]
    return [
        replace(one, candidate=test.candidate, multiplicity=test.multiplicity)
        for one, test in fitted
        if one is not None
    ]


def _is_possible(item: FittedCandidate) -> bool:
    return item.candidate.is_possible(item.fit.value) and item.fit.ship.is_possible(item.candidate.free)


def _best_on_held_out(
    first: FittedCandidate, accepted: Sequence[FittedCandidate], validation: CrossValidation, *, astray: bool = False
) -> FittedCandidate:
    """The best candidate, or one with fewer numbers that simulates data held out of the fit better.

    One that imitates many causes has to be clearly better itself; else it remains among the alternatives. So does one
    that others with fewer numbers are about as likely as. Many numbers explain errors of the model's structure in the
    data that they are fitted to, and in no others. Where the simulation of whole units leads away from the ship,
    likelihoods tell little, and the best candidates of all other causes are compared. Where it does so only with
    another cause, that one is no rival. Any other cause has to be much better, and any that is less likely with no
    fewer numbers for certain: likelihoods tell more than a few runs do. One that imitates many causes is a rival only
    of another such one.
    """
    astray = astray or leads_away(validation.of(first.fit))
    alike = [item for item in accepted if first.candidate.imitates or not item.candidate.imitates]
    near, every = _rivals(first, alike, any_number=astray), _rivals(first, alike, any_number=True)
    taken = {item.candidate.cause for item in near}
    rivals = [*near, *(item for item in every if item.candidate.cause not in taken)]
    rivals = [item for item in rivals if astray or not leads_away(validation.of(item.fit))]
    if not rivals:
        return first
    held = judged([validation.of(item.fit) for item in (first, *rivals)], first=0)
    own, *others = held
    better: list[tuple[float, FittedCandidate]] = []
    for other, rival in zip(others, rivals, strict=True):
        fewer = rival.numbers < first.numbers
        simpler = fewer and (first.candidate.imitates or _is_about_as_likely(rival, first))
        least = TUNING.clear_gain_points if rival in near else TUNING.much_better_share * own.left
        is_better = other.mean_fit > own.mean_fit + (-TUNING.clear_gain_points if simpler and not astray else least)
        if is_better and (fewer or astray or held_out_gain(own, other, 0)[1][0] > 0.0):
            better.append((other.mean_fit, rival))
    return max(better, key=lambda pair: pair[0])[1] if better else first


def _is_about_as_likely(rival: FittedCandidate, first: FittedCandidate) -> bool:
    return rival.likelihood_gain > ABOUT_AS_LIKELY * first.likelihood_gain


def _rivals(first: FittedCandidate, accepted: Sequence[FittedCandidate], *, any_number: bool) -> list[FittedCandidate]:
    """The best candidate of each other cause with fewer numbers, or as many if it is about as likely.

    And one of the same cause with fewer numbers that is about as likely, such as one parameter of a block.
    """
    found: dict[str, FittedCandidate] = {}
    for item in accepted:
        likely, other = _is_about_as_likely(item, first), item.candidate.cause != first.candidate.cause
        most = first.numbers if likely and other else first.numbers - 1
        if ((any_number and other) or item.numbers <= most) and (likely or other):
            found.setdefault(item.candidate.cause, item)
    return [*found.values()][: TUNING.shortlist if any_number else RIVALS]


def _rough_fit(base: Fit, windows: Windows, far: bool, point: StartingPoint) -> FittedCandidate | None:
    """A fit of few steps; from where the base is, where one that begins far away ends worse than the base."""
    found = fit_candidate(base, windows, point, far=far, steps=FIRST_STEPS)
    if not far or (found is not None and found.likelihood_gain > 0):
        return found
    return fit_candidate(base, windows, starting_point(base, point.test), steps=FIRST_STEPS) or found


def simplest(accepted: list[FittedCandidate]) -> FittedCandidate:
    """The best candidate, or the best with fewer numbers that explains nearly as much as one that imitates many causes.

    No model of a real ship is exact, and a few free coefficients always explain some of its errors too. The candidate
    that imitates remains among the alternatives.
    """
    first = accepted[0]
    if not first.candidate.imitates:
        return first
    enough = NEARLY_AS_MUCH * first.likelihood_gain
    simple = [item for item in accepted[1:] if len(item.keys) < len(first.keys) and not item.candidate.imitates]
    return next((item for item in simple if item.likelihood_gain >= enough), first)


def _alternatives(chosen: FittedCandidate, fitted: list[FittedCandidate]) -> tuple[Rival, ...]:
    """The best candidate of every other kind that explains the data as well, or a good share as much."""
    found: dict[object, Rival] = {}
    most = max(TUNING.equivalent_within, (1.0 - RIVAL_SHARE) * chosen.likelihood_gain)
    for other in fitted:
        trails_by = chosen.penalised_gain - other.penalised_gain
        if kind_of(other.candidate) != kind_of(chosen.candidate) and trails_by < most:
            rival = Rival(candidate=other.candidate, ship=other.fit.ship, trails_by=trails_by)
            found.setdefault(kind_of(other.candidate), rival)
    return tuple(found.values())


def _significant(
    base: Fit, windows: Windows, rough: list[FittedCandidate], work: Work, *, all_of_them: bool = False
) -> list[FittedCandidate]:
    """The best candidates, or all of them, fitted to convergence and significant by a Wald test.

    A candidate may converge to zero in the nonlinear fit. Then the next best are fitted.
    """
    while rough:
        leading = rough if all_of_them else _leading(rough)
        converged = _converged(base, windows, leading, work)
        significant = [item for item in converged if wald_p_value(item, item.fit) <= TUNING.level]
        if significant or not leading:  # nothing gains anything
            return ranked_by_gain(base, significant)
        rough = [item for item in rough if item not in leading]
    return []


def _converged(base: Fit, windows: Windows, rough: Sequence[FittedCandidate], work: Work) -> list[FittedCandidate]:
    """Fits continued to convergence; those of an earlier round from the same base are not made again."""
    known = work.fits_beside(base)
    waiting = [item for item in rough if not item.fit.converged and item.fit not in known]
    for old, new in zip(
        waiting, in_order(fit_to_convergence, (base, windows), [(item,) for item in waiting]), strict=True
    ):
        known[old.fit] = new
        work.spend(new.fit.simulations, work_of_simulation(new.fit.ship))
    continued = [(item, None if item.fit.converged else known[item.fit]) for item in rough]
    return [
        item if new is None else replace(new, candidate=item.candidate, multiplicity=item.multiplicity)
        for item, new in continued
    ]


def _leading(rough: list[FittedCandidate]) -> list[FittedCandidate]:
    """Those that gain nearly as much as the best, and those with fewer numbers that gain a good share of it."""
    best = max(rough, key=lambda item: item.likelihood_gain)
    return [
        item
        for item in rough
        if item.likelihood_gain
        > (SIMPLE_SHARE if item.numbers < best.numbers else LEADING_SHARE) * best.likelihood_gain
        - TUNING.statistic_margin
    ]


def leading_candidates(base: Fit, windows: Windows, tests: tuple[ScoreTest, ...]) -> tuple[FittedCandidate, ...]:
    """Candidates of the causes with the smallest p-values, one of each, fitted: the best that are not certain."""
    best: dict[str, ScoreTest] = {}
    for test in sorted(tests, key=lambda item: item.p_value * item.multiplicity):
        best.setdefault(test.candidate.cause, test)
    points = [starting_point(base, test) for test in [*best.values()][: TUNING.leads]]
    return tuple(item for point in points if (item := fit_candidate(base, windows, point)) is not None)
