"""The shortest day by turns: choose runs at the prices learnt so far, plan the day, learn the prices anew.

Every day planned is judged by the information of its whole track, so none is called accurate because an estimate of
prices says so. The prices decide only what is tried next.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from expdesign.errors import NoAnswer, NoPlan, NoRoom
from expdesign.plan.drafts import Draft
from expdesign.plan.solve import plan_drafted, with_advice
from expdesign.plan.values import Plan, PlanProblem, SailedTrial
from expdesign.processes import in_order
from expdesign.progress import Progress, in_phases, never_falling, of_part, silent
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.bounds import day_bound, fastest_mps, way_bound_s
from expdesign.shortest_day.cheapest import Choice, cheapest_runs, fullest_level, shares_costs_s
from expdesign.shortest_day.drafting import Drafting
from expdesign.shortest_day.prices import DraftedDay, Offer, Prices, first_prices, learnt_prices, near_day, offered
from expdesign.shortest_day.values import DayBound, DayParts, DayTried, ShortestDay
from expdesign.values import Array

ROUNDS = 5  # most days that are planned in search of the shortest
ENOUGH = 2  # days planned that reach the accuracy, or are made to, after which the shortest is taken

NEAREST = 3  # days to the accuracy, from which the next is sought
# margin that is asked for besides where the cheapest runs were tried already, at most so many times
LEVEL_STEP, LEVEL_STEPS = 0.05, 10
# margin that the nearest days have to promise of runs on average while no day reaches the accuracy; spare runs are left
# out afterwards
PROMISED = 0.1
LEAST_SAVING = 0.01  # share of the shortest day that reaches the accuracy, for which another is drafted
# information, in shares of what is needed, for which the day is estimated
CURVE_SHARES = (0.4, 0.5, 0.65, 0.8, 1.0, 1.25, 1.6, 2.0)


def shortest_day(
    problem: PlanProblem,
    accuracy: Accuracy,
    *,
    added: Sequence[str] = (),
    most_s: float | None = None,
    progress: Progress = silent,
) -> ShortestDay:
    """The shortest day found that reaches an accuracy, planned and verified.

    Args:
        problem: gives the dictionary, the limits on runs and the water; the runs of its design are not used. Where it
            asks for a draft, the first day is the answer, whatever it reaches.
        accuracy: to be reached by the whole track, legs included.
        added: runs that the day may have although the durations exclude them.
        most_s: longest day allowed [s].

    Raises:
        NoAnswer: no runs within the limits reach it, or no day found does within `most_s`.
        NoPlan: no day was found at all.
    """
    search = _Search(problem=problem, accuracy=accuracy, added=tuple(added))
    days, last, planning = search.rounds(search.untried, progress)
    if problem.settings.draft:
        return search.draft(days, last, planning)
    reached = sorted((day for day in days if day.margin >= 0), key=lambda day: day.expected_s)
    allowed = [day for day in reached if most_s is None or day.day_s <= most_s]
    if reached and not allowed and most_s is not None:
        raise NoAnswer(search.too_long(days, most_s))
    with suppress(NoAnswer):  # limits on runs may allow no more than days near those drafted have
        last = search.cheapest(days)
    curve = search.curve(days, allowed)
    found = search.planned(allowed, days, last, planning, good=lambda _, margin: margin >= 0)
    if found is None:
        raise NoPlan(search.falls_short(days))
    return replace(found, curve=curve(found.design.repeats))


def fullest_day(
    problem: PlanProblem,
    accuracy: Accuracy,
    day_s: float,
    *,
    added: Sequence[str] = (),
    progress: Progress = silent,
) -> ShortestDay:
    """The day found that tells most in a given length, planned and verified.

    Runs are those that reach the largest margin at the prices learnt so far; so the margin takes the place of the cost.

    Args:
        problem, added, progress: as of `shortest_day`.
        accuracy: its margin is made as large as can be.
        day_s: length of the day as planned, at most [s].

    Raises:
        NoAnswer: every day found takes longer.
        NoPlan: no day was found at all.
    """
    search = _Search(problem=problem, accuracy=accuracy, added=tuple(added), fullest=True)
    days, last, planning = search.rounds(partial(search.filling, day_s), progress)
    if problem.settings.draft:
        return replace(search.draft(days, last, planning), most_s=day_s)
    allowed = sorted((day for day in days if day.day_s <= day_s), key=lambda day: -day.margin)
    if not allowed:
        least_s = min(day.day_s for day in days)
        raise NoAnswer(
            f"design.day_s is {day_s:g}: the shortest of {len(days)} days found, with runs in it, takes "
            f"{least_s:.0f} s; a larger day_s, or shorter manoeuvres, would do"
        )
    curve = search.curve(days, allowed)
    found = search.planned(allowed, days, last, planning, good=lambda plan, _: plan.commands.duration_s <= day_s)
    if found is None:
        raise NoPlan(f"no day within design.day_s = {day_s:g} was planned as it was drafted; a larger day_s would do")
    return replace(found, most_s=day_s, curve=curve(found.design.repeats))


def check_way_fits(problem: PlanProblem, day_s: float) -> None:
    """Raise NoAnswer where the way to the goal alone takes longer than a day [s]."""
    speed_mps = fastest_mps(problem)
    if (way_s := way_bound_s(problem, speed_mps)) > day_s:
        raise NoAnswer(
            f"design.day_s is {day_s:g}: the way to the goal alone takes at least {way_s:.0f} s at {speed_mps:.3g} "
            "m/s; a larger day_s, or a nearer goal, would do"
        )


@dataclass(frozen=True)
class _Foreseen:
    """Runs that another day might have."""

    choice: Choice  # of them
    expected_s: float  # the day with them, go-arounds included
    margin: float  # that they should reach


@dataclass(frozen=True, kw_only=True, eq=False)
class _Search:
    """What all rounds share."""

    # problem, accuracy, added: as of `shortest_day`
    problem: PlanProblem
    accuracy: Accuracy
    added: tuple[str, ...]
    fullest: bool = False  # whether the accuracy is to be as large as can be, instead of the day as short
    # runs found to have no place in the water, to be unstable for drawn ships, or to be reached by no leg in the time
    # budget; grows
    placeless: set[str] = field(default_factory=set)

    @property
    def drafting(self) -> Drafting:
        """How days are drafted."""
        return Drafting(problem=self.problem, accuracy=self.accuracy, fullest=self.fullest)

    def rounds(
        self, choose: Callable[[Prices, Sequence[DraftedDay], Sequence[Choice]], Choice | None], progress: Progress
    ) -> tuple[list[DraftedDay], Choice, Progress]:
        """Days drafted by turns, the runs chosen last, and the progress of what is left.

        Args:
            choose: runs not tried yet by prices, days and choices so far; None for none.
            progress: of all rounds, and of what is left.

        Raises:
            NoPlan: no day was found at all.
        """
        prices, days, choices = first_prices(self.problem), list[DraftedDay](), list[Choice]()
        count = 1 if self.problem.settings.draft else ROUNDS
        *told, last = in_phases(never_falling(progress), *np.ones(count + 1))
        rounds = [of_part(one, f"day {number} of at most {count}") for number, one in enumerate(told, start=1)]
        refused = NoPlan("no day was planned")
        enough = np.inf if self.fullest else ENOUGH
        while rounds and enough and (choice := choose(prices, days, choices)) is not None:
            choices.append(choice)
            try:
                before, days = len(days), self.drafting.with_another(days, choice.repeats, rounds[0])
                enough -= any(day.margin >= 0 and np.isfinite(day.expected_s) for day in days[before:])
                prices = self.prices(days)
            except NoPlan as error:  # other runs may find their places
                refused = error
                if fresh := _impossible(error) - self.placeless:
                    self.placeless.update(fresh)
                    if error.what != "sailing":
                        continue  # soon found, and no reason to try fewer days
            rounds = rounds[1:]
        if not days:
            raise refused
        return days, choices[-1], last

    def filling(
        self, day_s: float, prices: Prices, days: Sequence[DraftedDay], tried: Sequence[Choice]
    ) -> Choice | None:
        """Runs not tried yet that tell most and should fit into a day; the next best where they do not fit."""
        offer = self.offer(prices)
        left_s = day_s - prices.way_s - self.late_s(days, prices)
        level, spare = fullest_level(self.accuracy, offer, left_s), list[Choice]()
        for step in range(LEVEL_STEPS):
            choice = cheapest_runs(self.accuracy, offer, level=level - step * LEVEL_STEP)
            if all(choice.repeats != earlier.repeats for earlier in tried):
                if choice.cost_s <= left_s:
                    return choice
                spare.append(choice)
        return spare[-1] if spare else None

    def untried(self, prices: Prices, days: Sequence[DraftedDay], tried: Sequence[Choice]) -> Choice | None:
        """The cheapest runs not tried yet that should reach the accuracy, by some margin; else those that come nearest.

        None where no day is expected to be much shorter than the shortest that reaches it, go-arounds included.

        Raises:
            NoAnswer: by the first prices, no runs within the limits reach it.
        """
        reached_s = min((day.expected_s for day in days if day.margin >= 0), default=np.inf)
        least = 0.0 if np.isfinite(reached_s) else PROMISED
        known, short = {other.repeats for other in tried} | {day.repeats for day in days}, list[_Foreseen]()
        for step in range(LEVEL_STEPS):
            try:
                found = self.choices(prices, days, margin=step * LEVEL_STEP)
            except NoAnswer:
                if not tried:
                    raise
                break  # the limits allow no more
            fresh = [one for one in found if one.choice.repeats not in known]
            if enough := [one for one in fresh if one.margin >= least]:
                best = min(enough, key=lambda one: one.expected_s)
                shorter = np.isinf(reached_s) or best.expected_s < (1 - LEAST_SAVING) * reached_s
                return best.choice if shorter else None
            short += fresh
        if np.isfinite(reached_s) or not short:
            return None
        return max(short, key=lambda one: one.margin).choice

    def choices(self, prices: Prices, days: Sequence[DraftedDay], *, margin: float) -> list[_Foreseen]:
        """The cheapest runs that reach a margin by the prices.

        Once days have been drafted, runs differ by few from one of those nearest to the accuracy, and what tells and
        what it takes is counted from there. The cheapest are those of which a day promises too much: the margin
        foreseen is that on average of what these days promise.

        Raises:
            NoAnswer: none within the limits do.
        """
        offer, names, found = self.offer(prices), self.problem.design.problem.names, list[tuple[Choice, float]]()
        around = [
            (day, near_day(offer, prices.runs, day, names), self.accuracy.margin(day.whole) - day.margin)
            for day in sorted(days, key=lambda day: abs(day.margin))[:NEAREST]
        ]
        for day, near, beyond in around:
            with suppress(NoAnswer):
                choice = cheapest_runs(self.accuracy, near, level=margin + beyond)
                saved_s = offer.total_s(np.array(day.repeats, dtype=float)) - choice.cost_s
                found.append((choice, day.expected_s - saved_s))
        if not found:
            choice = cheapest_runs(self.accuracy, offer, level=prices.level + margin)
            return [_Foreseen(choice, -np.inf, np.inf)]  # nothing to compare with

        def promised(choice: Choice) -> float:
            runs = np.array(choice.repeats, dtype=float)
            margins = [self.accuracy.margin(near.information(runs)) - beyond for _, near, beyond in around]
            return float(np.mean(margins))

        return [_Foreseen(choice, expected_s, promised(choice)) for choice, expected_s in found]

    def cheapest(self, days: Sequence[DraftedDay]) -> Choice:
        """The cheapest runs of the whole dictionary by the prices learnt."""
        prices = self.prices(days)
        return cheapest_runs(self.accuracy, self.offer(prices), level=prices.level)

    def offer(self, prices: Prices) -> Offer:
        """What runs cost and tell with their legs, by the prices."""
        return offered(self.problem, prices, free=self.added, placeless=self.placeless)

    def prices(self, days: Sequence[DraftedDay]) -> Prices:
        """Prices by the days so far; the level is what they promise where the accuracy is just reached."""
        prices = learnt_prices(self.problem, days)
        promised = [
            self.accuracy.margin(self.offer(prices).information(np.array(day.repeats, dtype=float))) for day in days
        ]
        return replace(prices, level=promised_at_zero(promised, [day.margin for day in days]))

    def draft(self, days: Sequence[DraftedDay], last: Choice, progress: Progress) -> ShortestDay:
        """The only day, whatever it reaches."""
        found = self.planned(days, days, last, progress, good=lambda *_: True)
        assert found is not None  # a refusal is raised
        return found

    def planned(
        self,
        best: Sequence[DraftedDay],
        days: Sequence[DraftedDay],
        last: Choice,
        progress: Progress,
        *,
        good: Callable[[Plan, float], bool],
    ) -> ShortestDay | None:
        """The first good one of the best days, with its verification and its drawn trials.

        Args:
            best: to be planned, the best first.
            days: all that were drafted.
            last: the runs chosen last.
            good: whether a plan with this margin is what was asked for.

        Raises:
            NoPlan: none is good, and what was planned last was refused.
        """
        refused: tuple[PlanProblem, NoPlan] | None = None
        for day in best:
            problem = replace(self.problem, design=(design := self.drafting.design(day.repeats)))
            bound = self.bound(day.draft.sailed)
            try:
                plan = plan_drafted(problem, day.draft, progress=progress)
            except NoPlan as error:  # a longer day may be less risky
                refused = problem, error
                continue
            if good(plan, margin := self.drafting.told_by(plan.sailed)[2]):
                return ShortestDay(
                    plan=plan,
                    design=design,
                    tried=tuple(self._told(item) for item in days),
                    cost_s=last.cost_s,
                    cost_bound_s=last.bound_s,
                    information=float(np.exp(margin)),
                    parts=_parts(day.draft, plan),
                    bound=next(bound if plan.trajectory is day.draft.sailed.trajectory else self.bound(plan), None),
                )
        if refused is not None:
            raise with_advice(*refused, progress)
        return None

    def bound(self, day: Plan | SailedTrial) -> Iterator[DayBound]:
        """The bound on days like this one, begun beside its drawn trials where there are other processes.

        None where a draft is all that is asked for.
        """
        asked = () if self.problem.settings.draft else ((day,),)
        return in_order(day_bound, (self.problem, self.accuracy), asked)

    def falls_short(self, days: Sequence[DraftedDay]) -> str:
        """That no day reaches the accuracy, the best that is possible, and what would help."""
        return (
            f"no day found reaches design.accuracy; {self._best(days)}; less accuracy, or manoeuvres that need less "
            "room, would do"
        )

    def _best(self, days: Sequence[DraftedDay]) -> str:
        """What the most accurate of days tells, and by how much better sensors it would be enough."""
        best = max(days, key=lambda day: day.margin)
        lacks = self.accuracy.lacking(best.whole, best.covariance)
        noise = f"sensors with {np.exp(best.margin / 2):.2g} of the noise would do then"
        return (
            f"the best of {len(days)}, of {best.day_s:.0f} s, tells {np.exp(best.margin):.0%} of what is needed"
            f"{': ' if lacks else ''}{lacks}{'; ' + noise if best.margin > -np.inf else ''}"
        )

    def curve(self, days: Sequence[DraftedDay], best: Sequence[DraftedDay]) -> Callable[[Sequence[int]], Array]:
        """A function of the runs of a day: (k, 2) day [s] and information of the cheapest choices, as that day is.

        They cost by the prices learnt; what that day takes and tells beside these, all are taken to. For the best day
        this is begun now, where there are other processes.
        """
        offer = self.offer(self.prices(days))

        def costs_s(day: DraftedDay) -> Iterator[Array]:
            level = self.accuracy.margin(offer.information(np.array(day.repeats, dtype=float))) - day.margin
            levels = (level + np.log(CURVE_SHARES)).tolist()
            return in_order(shares_costs_s, (self.accuracy, offer), ((levels,),))

        begun = {day.repeats: costs_s(day) for day in best[:1]}

        def curve(repeats: Sequence[int]) -> Array:
            day = next(day for day in days if day.repeats == tuple(repeats))
            beside_s = day.day_s - offer.total_s(np.array(day.repeats, dtype=float))
            points = np.column_stack([beside_s + next(begun.get(day.repeats) or costs_s(day)), CURVE_SHARES])
            return np.asarray(points[np.isfinite(points[:, 0])])

        return curve

    def late_s(self, days: Sequence[DraftedDay], prices: Prices) -> float:
        """How much longer days are than their prices say, on average [s]."""
        offer = self.offer(prices)
        predicted = [prices.way_s + offer.total_s(np.array(day.repeats, dtype=float)) for day in days]
        return float(np.mean([day.day_s for day in days]) - np.mean(predicted)) if days else 0.0

    def _told(self, day: DraftedDay) -> DayTried:
        names = self.problem.design.problem.names
        return DayTried(
            runs={name: count for name, count in zip(names, day.repeats, strict=True) if count},
            day_s=day.day_s,
            expected_s=day.expected_s,
            informative_s=day.draft.sailed.seconds("primitive"),
            information=float(np.exp(day.margin)),
            told=self.accuracy.told(day.covariance),
        )

    def too_long(self, days: Sequence[DraftedDay], most_s: float) -> str:
        """That days which reach the accuracy take longer than allowed, and the best that is possible in that time."""
        reached_s = min(day.day_s for day in days if day.margin >= 0)
        short = [day for day in days if day.day_s <= most_s]
        within = f"within most_s {self._best(short)}" if short else "none of those found is within most_s"
        return (
            f"design.accuracy.most_s is {most_s:g}: the shortest day found that reaches the accuracy takes "
            f"{reached_s:.0f} s; {within}; a larger most_s or less accuracy would do"
        )


def promised_at_zero(promised: Sequence[float], margins: Sequence[float]) -> float:
    """The promise of a day whose margin is zero: between the nearest days that reach it and that do not.

    Where all days are on one side, the nearest one's promise less its margin.
    """
    order = np.argsort(np.abs(margins), kind="stable").tolist()
    short, enough = ([k for k in order if (margins[k] >= 0) == reached] for reached in (False, True))
    if not (short and enough):
        return float(promised[order[0]] - margins[order[0]])
    low, high = short[0], enough[0]
    share = -margins[low] / (margins[high] - margins[low])
    return float(promised[low] + share * (promised[high] - promised[low]))


def _impossible(error: NoPlan) -> set[str]:
    """Runs that a refusal names as its cause, by themselves."""
    if isinstance(error, NoRoom):
        return set(error.lacking)
    return {error.which} if error.which and error.what in ("unstable", "sailing") else set()


def _parts(draft: Draft, plan: Plan) -> DayParts:
    """Where the time of a plan goes; runs are those of its draft, and legs may have been planned anew."""
    runs_s = draft.runs_beyond_s
    return DayParts(way_s=draft.direct_s, runs_s=runs_s, legs_s=plan.commands.duration_s - draft.direct_s - runs_s)
