"""Score tests of every candidate at once, and what chance alone would make of so many.

A candidate's score is what the whitened error, less what parameters, wandering current and initial states can explain,
has in common with the answer to it. All scores together are Gaussian when nothing is wrong, with a covariance that is
known; drawing from it tells how small the smallest of all p-values gets by chance, however much candidates resemble
each other. Every cause of the catalogue gets the same share of false alarms: a cause with one candidate does not pay
for another that has to be looked for at many times and places.

Sources: C. R. Rao (1948) for the score test; P. H. Westfall and S. S. Young, Resampling-Based Multiple Testing (1993);
C. R. Genovese, K. Roeder and L. Wasserman, Biometrika 93 (2006), 509-524, for shares of the level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.fit.gauss_newton import Fit
from expdesign.diagnosis.fit.linear_model import build_columns, grams, marginal, step_of
from expdesign.diagnosis.model import Extended, Linear, Push, push_of
from expdesign.values import Array

DRAWS = 2000
LEVEL = 0.05
LEAST_OWN = 1e-5
"""Share of a candidate's answer that nothing else in the model can imitate, at least, for it to be tested."""
TINY = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Scored:
    """A candidate with its test.

    Attributes:
        candidate: which.
        statistic: chi-squared with `candidate.size` degrees of freedom when nothing is wrong.
        p_value: of this candidate alone.
        step: (size,) the linear estimate of its free effects; for finite ones the share of the first guess.
        tests: what its p-value is to be multiplied with, for all that was tried.
    """

    candidate: Candidate
    statistic: float
    p_value: float
    step: Array
    tests: float = 1.0

    @property
    def corrected(self) -> float:
        """The p-value for all that was tried."""
        return min(1.0, self.p_value * self.tests)


def screen(base: Fit, candidates: Sequence[Candidate], rng: np.random.Generator | None = None) -> tuple[Scored, ...]:
    """Tests of every candidate against the fit without it, best first; without `rng` not corrected for their number."""
    pushes = [push_of(base.linear, base.ship.having({k: base.ship.get(k) + d}), d) for k in base.keys
              for d in [step_of(base.ship, k)]]  # fmt: skip
    shared: dict[object, int] = {}
    place: list[list[int]] = []
    for candidate in candidates:
        rows = []
        for tag, push in _pushes(base.linear, candidate):
            if tag not in shared:
                shared[tag] = len(pushes)
                pushes.append(push())
            rows.append(shared[tag])
        place.append(rows)
    columns = build_columns(base.linear, pushes, wander=base.noise.wander_mps > 0)
    m = marginal(grams(columns, base.noise), columns, base.noise)
    c = len(base.keys)
    now = np.array([base.ship.get(key) for key in base.keys])
    A, s = m.A.copy(), m.s.copy()
    own = A[:c, :c] + np.diag(base.precision)
    if c:
        solved = np.linalg.lstsq(own, np.column_stack([A[:c, c:], s[:c] - base.precision * now]), rcond=None)[0]
        s = s[c:] - A[c:, :c] @ solved[:, -1]
        A = A[c:, c:] - A[c:, :c] @ solved[:, :-1]
    scored, halves = [], []
    size = np.sqrt(np.maximum(np.diag(m.A)[c:], 1e-300))
    for candidate, rows in zip(candidates, place, strict=True):
        index = np.array(rows) - c
        block = A[np.ix_(index, index)] / np.outer(size[index], size[index])
        values, vectors = np.linalg.eigh(block)
        if values[0] < LEAST_OWN or not np.isfinite(block).all():
            continue  # the data cannot show it beside what the model already has
        half = vectors / np.sqrt(values)
        z = half.T @ (s[index] / size[index])
        statistic = float(z @ z)
        scored.append(
            Scored(
                candidate=candidate,
                statistic=statistic,
                p_value=float(chi2.sf(statistic, len(index))),
                step=(half @ z) / size[index],
            )
        )
        halves.append((index, half / size[index][:, None]))
    if scored and rng is not None:
        tests = _effective_tests(A, halves, [item.candidate.cause.split(":")[0] for item in scored], rng)
        scored = [replace(item, tests=number) for item, number in zip(scored, tests, strict=True)]
    return tuple(sorted(scored, key=lambda item: item.p_value * item.tests))


def _effective_tests(
    A: Array, halves: list[tuple[Array, Array]], causes: Sequence[str], rng: np.random.Generator
) -> list[float]:
    """How many times likelier it is that some p-value of a cause, and of any cause, falls below a level than one."""
    size = np.sqrt(np.maximum(np.diag(A), 1e-300))  # sizes may span more digits than numbers have
    values, vectors = np.linalg.eigh((A + A.T) / 2 / np.outer(size, size))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    drawn = rng.standard_normal((DRAWS, len(A))) @ root.T * size
    largest: dict[tuple[str, int], Array] = {}
    for cause, (index, half) in zip(causes, halves, strict=True):
        statistic, key = ((drawn[:, index] @ half) ** 2).sum(axis=1), (cause, len(index))
        largest[key] = np.maximum(largest[key], statistic) if key in largest else statistic
    smallest: dict[str, Array] = {}
    for (cause, freedom), statistic in largest.items():
        p_values = chi2.sf(statistic, freedom)
        smallest[cause] = np.minimum(smallest[cause], p_values) if cause in smallest else p_values
    own = {cause: _times_likelier(p_values) for cause, p_values in smallest.items()}
    every = _times_likelier(np.min([own[cause] * p_values for cause, p_values in smallest.items()], axis=0))
    return [own[cause] * every for cause in causes]


def _times_likelier(smallest: Array) -> float:
    """How many times likelier a smallest p-value is to fall below the level than a single one."""
    return float(max(1.0, LEVEL / max(float(np.quantile(smallest, LEVEL)), TINY)))


def _pushes(linear: Linear, candidate: Candidate):  # type: ignore[no-untyped-def]
    """(tag, how to make it) of every column of a candidate; candidates share columns of the same tag."""
    ship = linear.motion.ship
    fixed = tuple(sorted(candidate.fixed.items()))
    if "roll:period" in candidate.fixed:
        for key in candidate.free:
            yield (key, fixed), lambda key=key: _roll_push(linear, candidate, key)
        return
    if candidate.finite:
        whole = tuple(sorted(candidate.free.items()))
        yield (whole, fixed), lambda: push_of(linear, ship.having({**candidate.fixed, **candidate.free}), 1.0)
        return
    for key in candidate.free:
        yield (key, fixed), lambda key=key: _smooth_push(linear, ship, candidate, key)


def _smooth_push(linear: Linear, ship: Extended, candidate: Candidate, key: str) -> Push:
    size = step_of(ship, key)
    return push_of(linear, ship.having({**candidate.fixed, key: ship.get(key) + size}), size)


def _roll_push(linear: Linear, candidate: Candidate, key: str) -> Push:
    """Acceleration by a roll angle that the simulated path itself excites."""
    motion = linear.motion
    slopes = linear.slopes.mean(axis=0)
    middle = (motion.states[:, :-1] + motion.states[:, 1:]) / 2
    side = slopes[..., 1] + middle[..., 0] * middle[..., 2]
    w0, damping = 2 * np.pi / candidate.fixed["roll:period"], candidate.fixed["roll:damping"]
    h = motion.windows.step_s
    step = np.array([[0.0, 1.0, 0.0], [-(w0**2), -2 * damping * w0, w0**2], [0.0, 0.0, 0.0]]) * h
    onward = np.eye(3)
    power = np.eye(3)
    for order in range(1, 16):
        power = power @ step / order
        onward = onward + power
    roll = np.zeros_like(side)
    x = np.stack([side[:, 0], np.zeros(len(side))])
    for index in range(side.shape[1]):
        following = onward[:2, :2] @ x + onward[:2, 2:] * side[:, index]
        roll[:, index] = (x[0] + following[0]) / 2
        x = following
    force = np.zeros((*side.shape, motion.states.shape[-1]))
    force[..., 1 if key == "roll:sway" else 2] = roll
    return Push(force=force, sensor=None)
