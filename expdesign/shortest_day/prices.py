"""What one more run costs and tells, its leg included, learnt from the days that were planned.

A run takes its own time, and a share of the repositioning that plans have beyond the direct way, less the time that its
way made good saves. The leg that leads to a run tells, too; where no day had the run, it is taken to tell nothing.
These are estimates for the next plan; the next plan itself says what is true.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.plan.solve import Draft
from expdesign.shortest_day.tuning import TUNING
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class Prices:
    """Costs and information at the margin.

    Attributes:
        cost_s: (q,) of one more whole run.
        legs: (q, d, d) information of the leg that leads to it.
        goal: (d, d) information of the leg to the goal.
        level: margin of the accuracy that runs and legs must reach by these estimates.
    """

    cost_s: Array
    legs: Array
    goal: Array
    level: float = 0.0

    def __post_init__(self) -> None:
        seal(self, cost_s="q", legs="q d d", goal="d d")


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftedDay:
    """A day as drafted.

    Attributes:
        repeats: (q,) runs.
        draft: the day.
        information: (legs, d, d) of each leg of its track.
        margin: of the accuracy, by the whole track.
    """

    repeats: tuple[int, ...]
    draft: Draft
    information: Array
    margin: float

    @property
    def day_s(self) -> float:
        """Everything between start and goal [s]."""
        return self.draft.sailed.day_s


def first_prices(run_s: Array, dimension: int) -> Prices:
    """Prices before any day was planned."""
    return Prices(
        cost_s=run_s + TUNING.first_leg_s,
        legs=np.zeros((len(run_s), dimension, dimension)),
        goal=np.zeros((dimension, dimension)),
        level=float(np.log(TUNING.first_share)),
    )


def learnt_prices(primitives: Sequence[Primitive], days: Sequence[DraftedDay]) -> Prices:
    """Prices by all days so far; `level` is left at 0.

    Args:
        primitives: of the dictionary.
        days: one at least.
    """
    names = [item.name for item in primitives]
    told = np.zeros((len(names), *days[0].information.shape[1:]))
    found = np.zeros(len(names))
    goal = np.mean([day.information[-1] for day in days], axis=0)
    for day in days:
        for leg, matrix in zip(day.draft.sailed.legs[:-1], day.information, strict=False):
            if leg.kind == "reposition":
                told[names.index(leg.name)] += matrix
                found[names.index(leg.name)] += 1
    return Prices(cost_s=_cost_s(primitives, days), legs=told / np.maximum(found, 1)[:, None, None], goal=goal)


def _cost_s(primitives: Sequence[Primitive], days: Sequence[DraftedDay]) -> Array:
    """(q,) cost of one more whole run [s]."""
    draft, run_s = days[0].draft, np.array([item.duration_s for item in primitives])
    made_good_s = np.array([_displacement_m(item) for item in primitives]) / draft.transit_mps
    runs = np.array([day.repeats for day in days], dtype=float)
    usable = min(1.0, draft.direct_s / max(float((runs @ made_good_s).mean()), 1e-9))
    saved_s = usable * made_good_s
    beyond_s = sum(day.draft.sailed.seconds("reposition") - draft.direct_s for day in days)
    leg_s = (beyond_s + float((runs @ saved_s).sum())) / float(runs.sum())
    return np.asarray(np.maximum(run_s + leg_s - saved_s, TUNING.least_price * run_s))


def _displacement_m(primitive: Primitive) -> float:
    track = primitive.trajectory.pose[:, :2]
    return float(np.hypot(*(track[-1] - track[0])))
