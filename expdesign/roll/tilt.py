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
REFINING = 10  # tries between two tilts
ROUGHLY = 1e-7  # share of a sum of squares within which it is found
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


def tilts_of(problem: RollProblem, weighted: Sequence[Weighted], theta: Array, held: Sequence[str]) -> Tilts:
    """The sum of squares over all tilts, each with the parameters that it makes best."""

    def at(more: float) -> tuple[Array, float]:
        tilted = [
            replace(
                part,
                top=part.top + more * part.effects[:, TILT, 0],
                slope=part.slope + more * part.effects[:, TILT, 1:],
                follows=part.follows,
            )
            for part in weighted
        ]
        found, _, left = solved(problem, tilted, theta, held, within=ROUGHLY)
        return found, float(left @ left)

    def cost(more: float) -> float:
        return at(more)[1]

    tried = np.arange(-MOST_RAD, MOST_RAD + STEP_RAD / 2, STEP_RAD)
    costs = np.array([cost(more) for more in tried.tolist()])
    best = float(tried[np.argmin(costs)])
    fine = scipy.optimize.minimize_scalar(
        cost, bounds=(best - STEP_RAD, best + STEP_RAD), method="bounded", options={"maxiter": REFINING}
    )
    here = float(fine.x) if fine.fun < costs.min() else best
    found, least = at(here)
    # what the model misses is in all sums of squares
    size = max(1.0, least / max(sum(len(part.top) for part in weighted) - len(problem.free), 1))
    lead = float(costs[np.abs(tried - here) > NARROW_RAD].min()) - least
    return Tilts(here, (cost(0.0) - least) / size, lead / size, found)
