"""Days drafted and judged by the information of their whole track, with runs left out and put in one at a time.

The choice of runs foresees what another day tells to a fifth or so, as all runs are placed anew. Where one is left out
or put in here, the others stay where they are, and only the legs beside it are planned: nothing is foreseen but which
to try first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.durations import DurationDesign, with_repeats
from expdesign.errors import NotInformative
from expdesign.plan.checked import drawn_lateness_s
from expdesign.plan.drafts import Draft, find_legs, redrafted
from expdesign.plan.solve import draft_trial
from expdesign.plan.values import Placement, PlanProblem, SailedTrial
from expdesign.plan.verify import expected_errors, track_information
from expdesign.progress import Progress
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.cheapest import CHOICE_GAP
from expdesign.shortest_day.more_runs import Grown, enough_s, with_more
from expdesign.shortest_day.prices import DraftedDay, fewest_runs, lost_s, with_legs
from expdesign.values import Array

LEFT_OUT = 4  # runs that are tried to be left out of a day, one at a time, before none is
FORESEEN = 0.1  # shortfall of the margin that is expected of a day without a run, up to which it is tried
MADE_GOOD = 0.4  # most that a day's margin lacks for it to be made good by runs put in
PUT_IN = 8  # days with runs put in that are planned, at most
LEAST_SHORTER = 0.003  # share by which such a day has to promise to be shorter than the shortest
NEARLY = 3  # days that fall short, those first that promise most, in which places for other runs are sought at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class Drafting:
    """Drafts days."""

    problem: PlanProblem  # gives the dictionary, the limits on runs and the water; the runs of its design are not used
    accuracy: Accuracy  # to be reached by the whole track, legs included
    fullest: bool = False  # whether the accuracy is to be as large as can be, instead of the day as short

    def with_another(self, days: Sequence[DraftedDay], repeats: Sequence[int], progress: Progress) -> list[DraftedDay]:
        """Days with that of these runs; the water and the transitions of the day before are not worked out again.

        Where the shortest day is sought, a day near it follows that reaches the accuracy where it does not, or is
        shorter. Drawn trials tell how late the first day is; others are taken to be as late, run for run. Where a draft
        is all that is asked for, no other day follows, and no trials are drawn.
        """
        like = days[-1].draft if days else None
        day = self._judged(repeats, draft_trial(self._of(repeats), like=like, progress=progress))
        if self.problem.settings.draft:
            return [*days, day]
        late_run_s = _late_run_s(days)
        if late_run_s is None:
            problem = replace(self._of(repeats), area=day.draft.area)
            day = day.late(drawn_lateness_s(problem, day.draft.water, day.draft.sailed))
        else:
            day = day.taken_late(late_run_s)
        lost = not np.isfinite(day.expected_s)  # no drawn trial ends at the goal: those near it are as bad
        near = day if self.fullest or lost else self.shortest_near(day, day.late_run_s)
        return [*days, day, *([] if near is day else [near])]

    def shortest_near(self, day: DraftedDay, late_run_s: float) -> DraftedDay:
        """The shortest day found that reaches the accuracy with runs left out or put in; the day where none does.

        Days that fall short, the day itself or it without some run, get further runs that cost less.

        Args:
            day: to begin with, and what is returned where no day near it reaches the accuracy.
            late_run_s: by which drawn trials are late for each run [s].
        """
        best, short = self.without_spare_runs(day, late_run_s) if day.margin >= 0 else (day, [day])
        grown = list[Grown]()
        for _ in range(PUT_IN):
            most_s = (1.0 - LEAST_SHORTER) * best.expected_s if best.margin >= 0 else np.inf
            near = sorted(short, key=lambda other: enough_s(other, other.margin))
            short = [other for other in near if other.margin > -MADE_GOOD and enough_s(other, other.margin) < most_s]
            more = (with_more(self._of(other.repeats), self.accuracy, other, late_run_s) for other in short[:NEARLY])
            grown = sorted(
                (one for one in (*grown, *more) if one and one.enough_s < most_s), key=lambda one: one.enough_s
            )
            if not grown:
                break
            first, *grown = grown
            short, other = short[NEARLY:], self._redrafted(first.day.draft, first.placements, late_run_s)
            if other is not None and other.margin < 0:
                short.append(other)
            elif other is not None and other.expected_s < most_s:
                best, others = self.without_spare_runs(other, late_run_s)
                short += others
        return best

    def without_spare_runs(self, day: DraftedDay, late_run_s: float) -> tuple[DraftedDay, list[DraftedDay]]:
        """The day, or a shorter one with fewer runs that reaches the accuracy too; and shorter ones that do not."""
        short = list[DraftedDay]()
        while True:
            fewer = _with_one_fewer(day, self.accuracy)
            find_legs(self._of(day.repeats), day.draft, fewer)
            drafts = (self._redrafted(day.draft, rest, late_run_s) for rest in fewer)
            for other in (other for other in drafts if other and other.expected_s < day.expected_s):
                if other.margin >= 0:
                    day = other
                    break
                short.append(other)
            else:
                return day, short

    def told_by(self, sailed: SailedTrial) -> tuple[Array, Array | None, float]:
        """(legs, d, d) of each leg, or (legs, d + 2, d + 2); (p, p) covariance of the whole track; and its margin."""
        problem = self.problem
        of_track = problem.vessel, problem.design.problem, problem.environment, sailed
        information, covariance = track_information(*of_track), expected_errors(*of_track)
        return information, covariance, self.accuracy.margin_of_track(information.sum(axis=0), covariance)

    def design(self, repeats: Sequence[int]) -> DurationDesign:
        """The reference with other runs; together with legs they may tell what they cannot alone."""
        try:
            return with_repeats(self.problem.design, repeats)
        except NotInformative:
            return replace(self.problem.design, repeats=tuple(repeats), efficiency_repeats=0.0, note="")

    def _of(self, repeats: Sequence[int]) -> PlanProblem:
        """The trial with these runs."""
        return replace(self.problem, design=self.design(repeats))

    def _judged(self, repeats: Sequence[int], draft: Draft) -> DraftedDay:
        """A draft with what its track tells."""
        information, covariance, margin = self.told_by(draft.sailed)
        return DraftedDay(
            repeats=tuple(repeats), draft=draft, information=information, margin=margin, covariance=covariance
        )

    def _redrafted(self, draft: Draft, placements: Sequence[Placement], late_run_s: float) -> DraftedDay | None:
        """The day of a draft with runs at given places alone; None where they are too few, or a leg is not found."""
        names = [item.primitive for item in placements]
        repeats = [names.count(name) for name in self.problem.design.problem.names]
        if (repeats < fewest_runs(self.problem)).any():
            return None
        other = redrafted(self._of(repeats), draft, placements)
        return None if other is None else self._judged(repeats, other).taken_late(late_run_s)


def _late_run_s(days: Sequence[DraftedDay]) -> float | None:
    """How late drawn trials were for each run [s]; None where none were drawn, or none ended at the goal."""
    return next((day.late_run_s for day in days if day.drawn and np.isfinite(day.expected_s)), None)


def _with_one_fewer(day: DraftedDay, accuracy: Accuracy) -> list[list[Placement]]:
    """The runs of the day but one, for each that might be left out; those first that save most for what they tell."""
    draft, told, lost = day.draft, with_legs(day), lost_s(day.draft)
    are_runs = np.array([leg.kind == "primitive" for leg in draft.sailed.legs])
    runs = np.flatnonzero(are_runs).tolist()
    if len(runs) < 2:
        return []
    lost += np.convolve(np.where(are_runs, 0.0, lost), [0.5, 0.0, 0.5], "same")
    saved_s = lost[runs] + day.late_run_s
    spare = day.margin - accuracy.margin(day.whole)
    margins = np.array([accuracy.margin(day.whole - told[place]) + spare for place in runs])
    placed = list(draft.sailed.placements)
    worth = saved_s / np.maximum(day.margin - margins, CHOICE_GAP)
    order = [row for row in np.argsort(-worth).tolist() if margins[row] > -FORESEEN and saved_s[row] > 0]
    return [placed[:row] + placed[row + 1 :] for row in order[:LEFT_OUT]]
