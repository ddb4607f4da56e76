"""How a sensor is tilted, where nobody measured it.

A sensor whose bow end is up takes yaw for roll. In the equation that looks like another added mass and another moment
by yaw, and the sum of squares has a narrow valley at the true tilt beside a wide plain of wrong ones: a search from a
level sensor may end there, with all intervals short and the moments by sway and yaw far off. So the sum of squares is
looked at over all tilts. Where the plain is about as good as the valley, as in waves, nothing tells the tilt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.roll.instruments import Weighted
from expdesign.roll.problem import RollProblem, solved
from expdesign.roll.runs import EFFECTS
from expdesign.values import Array

MOST_RAD, STEP_RAD = 0.052, 0.004  # of the tilts that are tried
NARROW_RAD = 0.009  # beside a tilt, that counts as the same valley
CLEAR = 12.0  # sum of squares by which one of so many tilts is better than the others not by chance
VALLEYS = 3  # that are searched again from the parameters without more tilt
REFINING = 10  # tries between two tilts
ROUGHLY = 1e-4  # share of a sum of squares within which it is found
TILT = tuple(EFFECTS).index("tilt")


@dataclass(frozen=True, eq=False)
class Tilts:
    """What the sum of squares is at its best beside each tilt."""

    best_rad: float  # more than what the problem has
    # gain, lead: by which that is better than no more tilt, and than all tilts that are not near it, in mean squares
    gain: float
    lead: float
    theta: Array  # (9,) parameters with it

    @property
    def other(self) -> bool:
        """Whether data show another tilt, and none of the others instead."""
        return min(self.gain, self.lead) > CLEAR

    @property
    def told(self) -> bool:
        """Whether data tell that the tilt is the one that the problem has."""
        return self.lead > CLEAR >= self.gain


def tilts_of(problem: RollProblem, weighted: Sequence[Weighted], theta: Array, held: Sequence[str], by: Array) -> Tilts:
    """The sum of squares over all tilts, each with the parameters and other effects (`by`, (q, 3)) that it makes best.

    The search at a tilt begins with the parameters of the tilt beside it; in the deepest valleys it is tried as well
    from the parameters without more tilt, as there may be several.
    """
    beside = np.linalg.qr(np.delete(by, TILT, axis=1))[0]
    found: dict[float, tuple[float, Array]] = {}  # tilt -> least sum of squares, parameters

    def cost(more: float, begin: Array) -> float:
        tilted = [
            replace(
                part,
                top=part.top + more * part.effects[:, TILT, 0],
                slope=part.slope + more * part.effects[:, TILT, 1:],
            )
            for part in weighted
        ]
        values, _, left = solved(problem, tilted, begin, held, beside=beside, within=ROUGHLY)
        now = float(left @ left), values
        found[more] = min(found.get(more, now), now, key=lambda one: one[0])
        return found[more][0]

    cost(0.0, theta)
    away = np.arange(STEP_RAD, MOST_RAD + STEP_RAD / 2, STEP_RAD)
    for tried in (away.tolist(), (-away).tolist()):
        begin = found[0.0][1]
        for more in tried:
            cost(more, begin)
            begin = found[more][1]
    tilts = np.sort([*-away, 0.0, *away])
    costs = np.array([found[more][0] for more in tilts.tolist()])
    around = np.pad(costs, 1, constant_values=np.inf)
    valleys = np.flatnonzero((costs <= around[:-2]) & (costs <= around[2:]))
    for place in valleys[np.argsort(costs[valleys])][:VALLEYS]:
        costs[place] = cost(float(tilts[place]), found[0.0][1])
    best = float(tilts[np.argmin(costs)])
    scipy.optimize.minimize_scalar(
        lambda more: cost(float(more), found[best][1]), bounds=(best - STEP_RAD, best + STEP_RAD), method="bounded",
        options={"maxiter": REFINING},
    )  # fmt: skip
    here = min(found, key=lambda more: found[more][0])
    least, values = found[here]
    # what the model misses is in all sums of squares
    size = max(1.0, least / max(sum(len(part.top) for part in weighted) - len(problem.free), 1))
    lead = float(costs[np.abs(tilts - here) > NARROW_RAD].min()) - least
    return Tilts(here, (found[0.0][0] - least) / size, lead / size, values)
