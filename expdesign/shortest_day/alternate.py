"""The shortest day by turns: choose runs at the prices learnt so far, plan the day, learn the prices anew.

Every day planned is judged by the information of its whole track, so none is called accurate because an estimate of
prices says so. The prices decide only what is tried next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.durations import DurationDesign, with_repeats
from expdesign.errors import NoAnswer, NoPlan, NotInformative
from expdesign.memory import recalled
from expdesign.plan.problem import PlanProblem
from expdesign.plan.solve import draft_trial, plan_trial
from expdesign.plan.values import SailedTrial
from expdesign.plan.verify import track_information
from expdesign.progress import Progress, in_phases, silent
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.cheapest import Choice, Offer, cheapest_runs
from expdesign.shortest_day.prices import DraftedDay, Prices, first_prices, learnt_prices, offered
from expdesign.shortest_day.tuning import TUNING
from expdesign.shortest_day.values import DayTried, ShortestDay
from expdesign.values import Array


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
        problem: gives the dictionary, the limits on runs and the water; the runs of its design are not used.
        accuracy: to be reached by the whole track, legs included.
        added: runs that the day may have although the durations exclude them.
        most_s: longest day allowed [s].
        progress: of all rounds.

    Raises:
        NoAnswer: no runs within the limits reach it, or no day found does within `most_s`.
        NoPlan: no day was found at all.
    """
    search = _Search(problem=problem, accuracy=accuracy, added=tuple(added))
    prices, days, choices = first_prices(problem), list[DraftedDay](), list[Choice]()
    *rounds, last = in_phases(progress, *np.ones(TUNING.rounds + 1))
    refused = NoPlan("no day was planned")
    for told in rounds:
        choice = search.untried(prices, choices)
        if choice is None:
            break
        choices.append(choice)
        try:
            days.append(search.drafted(choice, told))
        except NoPlan as error:  # other runs may find their places
            refused = error
            continue
        prices = search.prices(days)
    if not days:
        raise refused
    return search.best(days, choices[-1], most_s, last)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Search:
    """What all rounds share.

    Attributes:
        problem, accuracy, added: as of `shortest_day`.
    """

    problem: PlanProblem
    accuracy: Accuracy
    added: tuple[str, ...]

    def untried(self, prices: Prices, tried: Sequence[Choice]) -> Choice | None:
        """The cheapest runs not tried yet that should reach the accuracy with their legs, by some margin.

        Raises:
            NoAnswer: by the first prices, no runs within the limits reach it.
        """
        for step in range(TUNING.level_steps):
            try:
                choice = self.chosen(prices, level=prices.level + step * TUNING.level_step)
            except NoAnswer:
                if not tried:
                    raise
                return None  # the limits allow no more than what was tried
            if all(choice.repeats != earlier.repeats for earlier in tried):
                return choice
        return None

    def chosen(self, prices: Prices, *, level: float) -> Choice:
        """The cheapest runs that with their legs reach this margin by the prices."""
        return cheapest_runs(self.accuracy, self.offer(prices), level=level)

    def offer(self, prices: Prices) -> Offer:
        """What runs cost and tell with their legs, by the prices."""
        return offered(self.problem, prices, free=self.added)

    def drafted(self, choice: Choice, progress: Progress) -> DraftedDay:
        """The day with these runs."""
        problem = replace(self.problem, design=self.design(choice.repeats))
        draft = recalled(draft_trial, problem, progress=progress)
        information = self._information(draft.sailed)
        margin = self.accuracy.margin(information.sum(axis=0))
        return DraftedDay(repeats=choice.repeats, draft=draft, information=information, margin=margin)

    def _information(self, sailed: SailedTrial) -> Array:
        durations, weather = self.problem.design.problem, self.problem.environment
        return track_information(self.problem.vessel, durations, weather, sailed)

    def prices(self, days: Sequence[DraftedDay]) -> Prices:
        """Prices by the days so far; the level is raised by what they promised too much on average."""
        prices = learnt_prices(self.problem.primitives, days)
        promised = [
            self.accuracy.margin(self.offer(prices).information(np.array(day.repeats, dtype=float))) for day in days
        ]
        short = np.mean([more - day.margin for more, day in zip(promised, days, strict=True)])
        return replace(prices, level=float(short))

    def design(self, repeats: Sequence[int]) -> DurationDesign:
        """The reference with other runs; together with legs they may tell what they cannot alone."""
        try:
            return with_repeats(self.problem.design, repeats)
        except NotInformative:
            return replace(self.problem.design, repeats=tuple(repeats), efficiency_repeats=0.0, note="")

    def best(self, days: Sequence[DraftedDay], last: Choice, most_s: float | None, progress: Progress) -> ShortestDay:
        """The shortest day that reaches the accuracy, planned with its verification and its risk."""
        refused: NoPlan | None = None
        reached = sorted((day for day in days if day.margin >= 0), key=lambda day: day.expected_s)
        allowed = [day for day in reached if most_s is None or day.day_s <= most_s]
        if reached and not allowed and most_s is not None:
            raise NoAnswer(self._too_long(min(reached, key=lambda day: day.day_s), most_s))
        for day in allowed:
            design = self.design(day.repeats)
            try:
                plan = recalled(plan_trial, replace(self.problem, design=design), progress=progress)
            except NoPlan as error:  # a longer day may be less risky
                refused = error
                continue
            if (margin := self.accuracy.margin(self._information(plan.sailed).sum(axis=0))) >= 0:
                return ShortestDay(
                    plan=plan,
                    design=design,
                    tried=tuple(self._told(item) for item in days),
                    cost_s=last.cost_s,
                    cost_bound_s=last.bound_s,
                    information=float(np.exp(margin)),
                )
        if refused is not None:
            raise refused
        short = max(days, key=lambda day: day.margin)
        name = self.accuracy.scarcest(short.information.sum(axis=0))
        about = f", {name} being the furthest from what is asked" if name else ""
        raise NoPlan(
            f"no day found reaches design.accuracy; the best of {len(days)} tells {np.exp(short.margin):.0%} of what "
            f"is needed{about}; less accuracy, or manoeuvres that need less room, would do"
        )

    def _told(self, day: DraftedDay) -> DayTried:
        names = self.problem.design.problem.names
        return DayTried(
            runs={name: count for name, count in zip(names, day.repeats, strict=True) if count},
            day_s=day.day_s,
            expected_s=day.expected_s,
            informative_s=day.draft.sailed.seconds("primitive"),
            information=float(np.exp(day.margin)),
        )

    def _too_long(self, day: DraftedDay, most_s: float) -> str:
        name = self.accuracy.scarcest(day.information.sum(axis=0))
        about = f"; {name} needs most of it" if name else ""
        return (
            f"design.accuracy.most_s is {most_s:g}: the shortest day found that reaches the accuracy takes "
            f"{day.day_s:.0f} s{about}; a larger most_s or less accuracy would do"
        )
