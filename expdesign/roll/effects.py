"""What the equation of roll lacks: damping by the square, and a sensor beside midships or not level.

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

from expdesign.roll.instruments import Weighted, spread_of
from expdesign.roll.model import PARAMETERS
from expdesign.roll.problem import Moments, RollProblem, moments_of, sampled, solved, surprise_of
from expdesign.roll.regression import MOST_SURPRISE
from expdesign.roll.runs import EFFECTS, Run
from expdesign.values import Array

SEEN = 3.0  # standard deviations of an effect, from which it is estimated
EXPLAINED = 0.1  # of the sum of squares that is left without it, that it takes away at least
STAYS, MOST_TRIES = 2.5, 2  # standard deviations, below which it is left out again, and times after which for good
# most of them: damping by the square over the linear one at the rms rate, lengths of 0.3 beams or heights of the load,
# an angle
MOST_BENT, MOST_LENGTHS, MOST_TILT_RAD = 5.0, 8.0, 0.5
EFFECT_NAMES = tuple(EFFECTS)


def with_effects(problem: RollProblem, added: Sequence[int], more: Array) -> RollProblem:
    """The problem with some effects (numbers in `EFFECT_NAMES`) larger, within what is sought."""
    change, most = np.zeros(len(EFFECT_NAMES)), most_effects(problem)
    change[list(added)] = more

    def changed(run: Run) -> Run:
        return replace(run, effects=tuple(np.clip(np.array(run.effects) + change, -most, most).tolist()))

    cases = [replace(case, runs=tuple(map(changed, case.runs))) for case in problem.cases]
    return replace(problem, cases=tuple(cases))


def without_effects(problem: RollProblem, places: Sequence[int]) -> RollProblem:
    """The problem with some effects zero."""
    now = problem.cases[0].runs[0].effects
    return with_effects(problem, places, np.array([-now[place] for place in places])) if places else problem


def unseen_effects(problem: RollProblem, added: Sequence[int], std: Array) -> list[int]:
    """Effects that better weights show to be none."""
    now = problem.cases[0].runs[0].effects
    small = [abs(now[place]) < STAYS * error for place, error in zip(added, std.tolist(), strict=True)]
    return [place for place, none in zip(added, small, strict=True) if none and now[place]]


def most_effects(problem: RollProblem) -> Array:
    """(3,) beyond which no effect is sought."""
    rms = np.sqrt(np.mean(np.concatenate([run.signals[:, 0] for case in problem.cases for run in case.runs]) ** 2))
    length = float(problem.scale[PARAMETERS.index("z_m")])
    return np.array([MOST_BENT / max(float(rms), 1e-12), MOST_LENGTHS * length, MOST_TILT_RAD])


def by_effects(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> Array:
    """(q, 3) derivatives of the weighted residuals by the effects, less the part that goes with them by chance."""
    by = zip(weighted, sampled(problem, theta), moments_of(problem, weighted, theta), strict=True)
    return np.concatenate([_by_effects(part, np.concatenate([[1.0], -values]), own) for part, values, own in by])


def _by_effects(part: Weighted, by: Array, own: Moments) -> Array:
    slopes = own.inverse @ (part.effects @ by)
    if part.spread is None:
        return np.asarray(slopes)
    noise = [one.reshape(len(one), 4, 6) @ by for one in part.hidden]  # of the residuals, and of what each effect adds
    with_left = own.inverse @ spread_of(part.basis, noise, rows=1)[0, 1:].swapaxes(1, 2) @ own.inverse.T
    return np.asarray(slopes - (with_left @ own.residuals).T)


def missing_sizes(
    problem: RollProblem, by: Array, sensed: Array, left: Array, places: Sequence[int]
) -> tuple[Array, Array]:
    """By how much some effects are too small, and their standard deviations, beside all parameters.

    Args:
        problem: with the effects as they are.
        by: (q, 3) derivatives of the weighted residuals by the effects.
        sensed: (q, p) the same by the free parameters.
        left: (q,) residuals.
        places: of the effects.
    """
    own = by[:, list(places)]
    across = own - _onto(sensed * problem.scale[problem.places], own)
    inverse = np.linalg.pinv(across, rcond=1e-10)
    return -inverse @ left, np.sqrt(np.diag(inverse @ inverse.T))


def missed_effects(
    problem: RollProblem, by: Array, sensed: Array, left: Array, added: Sequence[int], banned: Sequence[int]
) -> list[int]:
    """The effect that data show most clearly of those not among the parameters yet; all where much is missed."""
    rest = [place for place in range(len(EFFECT_NAMES)) if place not in (*added, *banned)]
    if not added and not banned and surprise_of(left, len(problem.free)) > MOST_SURPRISE:
        return rest  # which of them it is shows when none is missing
    scores = []
    for place in rest:
        more, std = missing_sizes(problem, by, sensed, left, [*added, place])
        scores.append((abs(more[-1]) / max(std[-1], 1e-300), place))
    best = max(scores, default=(0.0, 0))
    return [best[1]] if best[0] > SEEN and best[0] ** 2 > EXPLAINED * float(left @ left) else []


def _onto(columns: Array, vector: Array) -> Array:
    """The part of vectors (q, n) in the span of columns (q, p)."""
    return np.asarray(columns @ (np.linalg.pinv(columns, rcond=1e-10) @ vector))


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
