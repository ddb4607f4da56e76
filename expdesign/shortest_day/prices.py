"""What one more run costs and tells, legs included, learnt from a day that was planned.

A run takes its own time, and its share of the repositioning that the plan has beyond the direct way, less the time that
its way made good saves. Legs tell, too: their information is shared evenly among the runs and the way to the goal.
These are estimates of the next plan; the next plan itself says what is true.
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
        leg: (d, d) information of the legs that one more run brings, and of those without any run.
        informed: margin of the accuracy by which runs as placed tell less than the dictionary says.
    """

    cost_s: Array
    leg: Array
    informed: float = 0.0

    def __post_init__(self) -> None:
        seal(self, cost_s="q", leg="d d")


def first_prices(run_s: Array, dimension: int) -> Prices:
    """Prices before any day was planned."""
    return Prices(
        cost_s=run_s + TUNING.first_leg_s,
        leg=np.zeros((dimension, dimension)),
        informed=float(np.log(TUNING.first_share)),
    )


def learnt_prices(
    primitives: Sequence[Primitive], repeats: Sequence[int], draft: Draft, *, legs: Array, informed: float
) -> Prices:
    """Prices by a day as drafted.

    Args:
        primitives: of the dictionary.
        repeats: (q,) runs of the day.
        draft: the day.
        legs: (d, d) information of all its legs.
        informed: see `Prices`.
    """
    runs, count = np.array(repeats), max(sum(repeats), 1)
    made_good_s = np.array([_displacement_m(item) for item in primitives]) / draft.transit_mps
    usable = min(1.0, draft.direct_s / max(float(runs @ made_good_s), 1e-9))
    saved_s = usable * made_good_s
    leg_s = (draft.sailed.seconds("reposition") - draft.direct_s + float(runs @ saved_s)) / count
    run_s = np.array([item.duration_s for item in primitives])
    cost_s = np.maximum(run_s + leg_s - saved_s, TUNING.least_price * run_s)
    return Prices(cost_s=cost_s, leg=legs / (count + 1), informed=informed)


def _displacement_m(primitive: Primitive) -> float:
    track = primitive.trajectory.pose[:, :2]
    return float(np.hypot(*(track[-1] - track[0])))
