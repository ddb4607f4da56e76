"""What the equation of roll lacks: damping by the square, and a sensor beside midships or not level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.roll.instruments import Weighted, spread_of
from expdesign.roll.model import PARAMETERS
from expdesign.roll.problem import Moments, RollProblem, moments_of, sampled, surprise_of
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
