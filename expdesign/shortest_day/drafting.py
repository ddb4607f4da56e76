"""Days drafted and judged by the information of their whole track, and with runs left out while the rest tells enough.

The choice of runs foresees what another day tells to a fifth or so, as all runs are placed anew. Where one is left out
here, the others stay where they are, and only the leg past it is planned: nothing is foreseen but which to try first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.durations import DurationDesign, with_repeats
from expdesign.errors import NotInformative
from expdesign.plan.checked import drawn_lateness_s
from expdesign.plan.solve import Draft, draft_trial, find_legs, redrafted
from expdesign.plan.values import Placement, PlanProblem, SailedTrial
from expdesign.plan.verify import expected_errors, track_information
from expdesign.processes import in_order
from expdesign.progress import Progress
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.cheapest import CHOICE_GAP
from expdesign.shortest_day.prices import DraftedDay, fewest_runs, lost_s, with_legs
from expdesign.values import Array

LEFT_OUT = 4  # runs that are tried to be left out of a day, one at a time, before none is
FORESEEN = 0.1  # shortfall of the margin that is expected of a day without a run, up to which it is tried


@dataclass(frozen=True, kw_only=True, eq=False)
class Drafting:
    """Drafts days."""

    problem: PlanProblem  # gives the dictionary, the limits on runs and the water; the runs of its design are not used
    accuracy: Accuracy  # to be reached by the whole track, legs included
    fullest: bool = False  # whether the accuracy is to be as large as can be, instead of the day as short

    def with_another(self, days: Sequence[DraftedDay], repeats: Sequence[int], progress: Progress) -> list[DraftedDay]:
        """Days with that of these runs; the water and the transitions of the day before are not worked out again.

        Where it reaches the accuracy and the shortest day is sought, the shorter day without runs that it does not need
        follows. Drawn trials tell how late the first day is; others are taken to be as late, second for second. Where a
        draft is all that is asked for, no runs are left out, and no trials are drawn.
        """
        like = days[-1].draft if days else None
        day = self._judged(repeats, draft_trial(self._of(repeats), like=like, progress=progress))
        if self.problem.settings.draft:
            return [*days, day]
        trials = replace(self._of(repeats), area=day.draft.area), day.draft.water, day.draft.sailed
        late = in_order(drawn_lateness_s, trials, () if _late_share(days) is not None else ((),))  # begun now
        reached = day.margin >= 0 and not self.fullest
        shorter = self.without_spare_runs(day) if reached else day
        drawn = [day.late(late_s) for late_s in late] or [day]
        return _alike_late([*days, *drawn, *([] if shorter is day else [shorter])])

    def without_spare_runs(self, day: DraftedDay) -> DraftedDay:
        """The day, or a shorter one with fewer of its runs that reaches the accuracy too."""
        while True:
            fewer = _with_one_fewer(day, self.accuracy)
            find_legs(self._of(day.repeats), day.draft, fewer)
            drafts = (self._redrafted(day.draft, rest) for rest in fewer)
            shorter = (other for other in drafts if other and other.margin >= 0 and other.day_s < day.day_s)
            found = next(shorter, None)
            if found is None:
                return day
            day = found

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

    def _redrafted(self, draft: Draft, placements: Sequence[Placement]) -> DraftedDay | None:
        """The day of a draft with runs at given places alone; None where they are too few, or a leg is not found."""
        names = [item.primitive for item in placements]
        repeats = [names.count(name) for name in self.problem.design.problem.names]
        if (repeats < fewest_runs(self.problem)).any():
            return None
        other = redrafted(self._of(repeats), draft, placements)
        return None if other is None else self._judged(repeats, other)


def _alike_late(days: list[DraftedDay]) -> list[DraftedDay]:
    """Days as late as the one that trials were drawn of, second for second."""
    share = _late_share(days)
    return [day if day.drawn or share is None else day.taken_late(share) for day in days]


def _late_share(days: Sequence[DraftedDay]) -> float | None:
    """How late drawn trials were, as a share of the day; None where none were drawn, or none ended at the goal."""
    return next((day.expected_s / day.day_s - 1.0 for day in days if day.drawn and np.isfinite(day.expected_s)), None)


def _with_one_fewer(day: DraftedDay, accuracy: Accuracy) -> list[list[Placement]]:
    """The runs of the day but one, for each that might be left out; those first that save most for what they tell."""
    draft, told, lost = day.draft, with_legs(day), lost_s(day.draft)
    are_runs = np.array([leg.kind == "primitive" for leg in draft.sailed.legs])
    runs = np.flatnonzero(are_runs).tolist()
    if len(runs) < 2:
        return []
    saved_s = (lost + np.convolve(np.where(are_runs, 0.0, lost), [0.5, 0.0, 0.5], "same"))[runs]
    spare = day.margin - accuracy.margin(day.whole)
    margins = np.array([accuracy.margin(day.whole - told[place]) + spare for place in runs])
    placed = list(draft.sailed.placements)
    worth = saved_s / np.maximum(day.margin - margins, CHOICE_GAP)
    order = [row for row in np.argsort(-worth).tolist() if margins[row] > -FORESEEN and saved_s[row] > 0]
    return [placed[:row] + placed[row + 1 :] for row in order[:LEFT_OUT]]
