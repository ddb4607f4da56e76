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
from expdesign.plan.solve import Draft, draft_trial, plan_trial
from expdesign.plan.verify import track_information
from expdesign.progress import Progress, silent, within
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.cheapest import Choice, cheapest_runs
from expdesign.shortest_day.prices import Prices, first_prices, learnt_prices
from expdesign.shortest_day.tuning import TUNING
from expdesign.shortest_day.values import DayTried, ShortestDay
from expdesign.values import Array


def shortest_day(
    problem: PlanProblem, accuracy: Accuracy, *, most_s: float | None = None, progress: Progress = silent
) -> ShortestDay:
    """The shortest day found that reaches an accuracy, planned and verified.

    Args:
        problem: gives the dictionary, the limits on runs and the water; the runs of its design are not used.
        accuracy: to be reached by the whole track, legs included.
        most_s: longest day allowed [s].
        progress: of all rounds.

    Raises:
        NoAnswer: no runs within the limits reach it, or no day found does within `most_s`.
        NoPlan: no day was found at all.
    """
    search = _Search.of(problem, accuracy)
    prices, tried, choices = first_prices(search.run_s, len(accuracy.prior)), list[_Day](), list[Choice]()
    for number in range(TUNING.rounds):
        share = number / (TUNING.rounds + 1)
        choice = search.chosen(prices)
        choices.append(choice)
        if any(choice.repeats == day.repeats for day in tried):
            break
        day = search.planned(choice, within(progress, share, share + 1 / (TUNING.rounds + 1)))
        tried.append(day)
        prices = search.prices(day)
    return search.best(tried, choices, most_s, within(progress, TUNING.rounds / (TUNING.rounds + 1), 1.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Day:
    """A day as drafted, and the information (d, d) of its runs and of its whole track."""

    repeats: tuple[int, ...]
    draft: Draft
    runs: Array
    whole: Array
    margin: float


@dataclass(frozen=True, kw_only=True, eq=False)
class _Search:
    """What all rounds share.

    Attributes:
        problem, accuracy: as of `shortest_day`.
        matrices: (q, d, d) information of one whole run, summed over its samples.
        run_s: (q,) duration of one.
        fewest, most: (q,) limits on runs.
    """

    problem: PlanProblem
    accuracy: Accuracy
    matrices: Array
    run_s: Array
    fewest: Array
    most: Array

    @staticmethod
    def of(problem: PlanProblem, accuracy: Accuracy) -> _Search:
        durations, sample_s = problem.design.problem, problem.vessel.sample_time_s
        limits, names = durations.constraints, durations.names
        least_s = np.array([limits.least_s.get(name, 0.0) for name in names])
        most_s = np.array([0.0 if name in limits.excluded else limits.most_s.get(name, np.inf) for name in names])
        required = np.array([float(name in limits.required) for name in names])
        return _Search(
            problem=problem,
            accuracy=accuracy,
            matrices=durations.matrices * (durations.run_s / sample_s)[:, None, None],
            run_s=durations.run_s,
            fewest=np.maximum(np.ceil(least_s / durations.run_s), required),
            most=np.minimum(np.floor(most_s / durations.run_s), TUNING.most_runs),
        )

    def chosen(self, prices: Prices) -> Choice:
        """The cheapest runs that should reach the accuracy with their legs."""
        return cheapest_runs(
            self.accuracy,
            self.matrices + prices.leg,
            prices.cost_s,
            known=prices.leg,
            fewest=self.fewest,
            most=self.most,
            level=prices.informed,
        )

    def planned(self, choice: Choice, progress: Progress) -> _Day:
        """The day with these runs."""
        problem = replace(self.problem, design=self.design(choice.repeats))
        draft = recalled(draft_trial, problem, progress=progress)
        vessel, durations = self.problem.vessel, self.problem.design.problem
        runs, whole = track_information(vessel, durations, self.problem.environment, draft.sailed)
        return _Day(repeats=choice.repeats, draft=draft, runs=runs, whole=whole, margin=self.accuracy.margin(whole))

    def prices(self, day: _Day) -> Prices:
        """Prices by a day."""
        legs = day.whole - day.runs
        expected = np.tensordot(np.array(day.repeats, dtype=float), self.matrices, axes=1) + legs
        return learnt_prices(
            self.problem.primitives,
            day.repeats,
            day.draft,
            legs=legs,
            informed=self.accuracy.margin(expected) - day.margin,
        )

    def design(self, repeats: Sequence[int]) -> DurationDesign:
        """The reference with other runs; together with legs they may tell what they cannot alone."""
        try:
            return with_repeats(self.problem.design, repeats)
        except NotInformative:
            return replace(self.problem.design, repeats=tuple(repeats), efficiency_repeats=0.0, note="")

    def best(
        self, tried: Sequence[_Day], choices: Sequence[Choice], most_s: float | None, progress: Progress
    ) -> ShortestDay:
        """The shortest day that reaches the accuracy, planned with its verification and its risk."""
        reached = sorted((day for day in tried if day.margin >= 0), key=lambda day: day.draft.sailed.day_s)
        for day in reached:
            if most_s is not None and day.draft.sailed.day_s > most_s:
                raise NoAnswer(self._too_long(day, most_s))
            design = self.design(day.repeats)
            plan = recalled(plan_trial, replace(self.problem, design=design), progress=progress)
            _, whole = track_information(self.problem.vessel, design.problem, self.problem.environment, plan.sailed)
            if (margin := self.accuracy.margin(whole)) >= 0:
                return ShortestDay(
                    plan=plan,
                    design=design,
                    tried=tuple(self._told(item) for item in tried),
                    cost_s=choices[-1].cost_s,
                    cost_bound_s=choices[-1].bound_s,
                    information=float(np.exp(margin)),
                )
        short = max(tried, key=lambda day: day.margin)
        raise NoPlan(
            f"no day found reaches design.accuracy; the best of {len(tried)} tells {np.exp(short.margin):.0%} of what "
            "is needed"
        )

    def _told(self, day: _Day) -> DayTried:
        names = self.problem.design.problem.names
        return DayTried(
            runs={name: count for name, count in zip(names, day.repeats, strict=True) if count},
            day_s=day.draft.sailed.day_s,
            informative_s=day.draft.sailed.seconds("primitive"),
            information=float(np.exp(day.margin)),
        )

    def _too_long(self, day: _Day, most_s: float) -> str:
        name = self.accuracy.scarcest(day.whole)
        about = f"; {name} needs most of it" if name else ""
        return (
            f"design.accuracy.most_s is {most_s:g}: the shortest day found that reaches the accuracy takes "
            f"{day.draft.sailed.day_s:.0f} s{about}; a larger most_s or less accuracy would do"
        )
