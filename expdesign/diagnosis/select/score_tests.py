"""Score tests of every candidate at once, with p-values adjusted for their number.

A score is the inner product of the whitened error with a candidate's sensitivity, after projecting out parameters,
random current and initial states. If the model is correct, all scores together are Gaussian with a known covariance.
Draws from that distribution give the distribution of the smallest p-value, including the correlation of candidates.
Every cause of the catalogue gets the same share of false alarms, so a cause with one candidate is not penalised for
another with many.

Sources: C. R. Rao (1948) for the score test; P. H. Westfall and S. S. Young, Resampling-Based Multiple Testing (1993);
C. R. Genovese, K. Roeder and L. Wasserman, Biometrika 93 (2006), 509-524, for shares of the level.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import scipy
from scipy.linalg.lapack import dtbtrs

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.fit import (
    NOISE_ALONE,
    Fit,
    build_sensitivities,
    deviations_of,
    difference_step,
    directions_between_runs,
    effect_disturbances,
    gram_matrices,
    in_groups,
    of_several,
    runs_of,
    tail,
    window_information,
)
from expdesign.diagnosis.motion import Disturbance, LinearisedMotion, disturbance_of
from expdesign.diagnosis.select.tuning import TUNING
from expdesign.estimation.solve import Dispersion, Spread
from expdesign.own_units import pseudo_inverse_of
from expdesign.values import Array

DRAWS = 2000  # of the null distribution, for adjusted p-values
# share of a candidate's sensitivity that nothing else in the model can imitate, at least, for it to be tested
LEAST_OWN_SHARE = 1e-5


# Disturbances of a candidate along a simulated path, per unit of each of its effects.


def candidate_disturbances(
    linear: LinearisedMotion, candidate: Candidate
) -> Iterator[tuple[object, Callable[[], Disturbance]]]:
    """(tag, function) of every disturbance of a candidate; candidates share those with the same tag."""
    ship = linear.motion.ship
    fixed = tuple(sorted(candidate.fixed.items()))
    if "roll:period" in candidate.fixed:
        for key in candidate.free:
            yield (key, fixed), partial(_roll_disturbance, linear, candidate, key)
    elif candidate.finite:
        whole = ship.with_effects({**candidate.fixed, **candidate.free})
        yield (tuple(sorted(candidate.free.items())), fixed), partial(disturbance_of, linear, whole, 1.0)
    else:
        for key in candidate.free:
            yield (key, fixed), partial(_smooth_disturbance, linear, candidate, key)


def _smooth_disturbance(linear: LinearisedMotion, candidate: Candidate, key: str) -> Disturbance:
    """Per unit of one effect; beside fixed effects that the path lacks by a finite difference."""
    if not candidate.fixed:
        return effect_disturbances(linear, [key])[0]
    ship = linear.motion.ship
    size = difference_step(ship, key)
    return disturbance_of(linear, ship.with_effects({**candidate.fixed, key: ship.get(key) + size}), size)


def _roll_disturbance(linear: LinearisedMotion, candidate: Candidate, key: str) -> Disturbance:
    """Acceleration by a roll angle that the simulated path itself excites."""
    motion = linear.motion
    rates = linear.mean_rates
    middle = (motion.states[:, :-1] + motion.states[:, 1:]) / 2
    side = rates[..., 1] + middle[..., 0] * middle[..., 2]
    w0, damping = 2 * np.pi / candidate.fixed["roll:period"], candidate.fixed["roll:damping"]
    roll = _oscillator_response(side, w0, damping, motion.windows.step_s)
    force = np.zeros((*side.shape, motion.states.shape[-1]))
    force[..., 1 if key == "roll:sway" else 2] = roll
    return Disturbance(force=force, sensor=None)


def _oscillator_response(drive: Array, w0: float, damping: float, step_s: float) -> Array:
    """(w, k) mean over each step of x in x'' + 2 damping w0 x' + w0^2 x = w0^2 drive, the drive (w, k) held."""
    step = np.array([[0.0, 1.0, 0.0], [-(w0**2), -2 * damping * w0, w0**2], [0.0, 0.0, 0.0]]) * step_s
    transition, power = np.eye(3), np.eye(3)
    for order in range(1, 16):
        power = power @ step / order
        transition = transition + power
    (keep, of_rate), (of_roll, keep_rate) = transition[:2, :2]
    near, far = transition[0, 2], of_rate * transition[1, 2] - keep_rate * transition[0, 2]
    behind = np.array([1.0, -keep - keep_rate, keep * keep_rate - of_rate * of_roll])
    first = drive[:, :1]  # where the angle begins, at rest
    forced = np.pad(near * (drive - first), ((0, 0), (1, 0)))
    forced[:, 2:] += far * (drive - first)[:, :-1]
    angle = _recursion(behind, forced) + first
    return np.asarray((angle[:, :-1] + angle[:, 1:]) / 2)


def _recursion(coefficients: Array, forced: Array) -> Array:
    """(w, k) x with coefficients . (x_k, x_k-1, ...) = forced_k, the first coefficient one, zero before the first."""
    band = np.repeat(coefficients[:, None], forced.shape[1], axis=1)
    return np.asarray(dtbtrs(band, forced.T, uplo="L", diag="U")[0].T)


TINY = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoreTest:
    """A candidate with its test."""

    candidate: Candidate  # the candidate
    statistic: float  # chi-squared with `candidate.size` degrees of freedom if the model is correct
    p_value: float  # of this candidate alone
    step: Array  # (size,) the linear estimate of its free effects; for finite ones the share of the first guess
    multiplicity: float = 1.0  # number of independent tests that all of its round are worth, for its p-value
    # factor, freedom: of its variance, by how runs differ
    factor: float = 1.0
    freedom: float = math.inf

    @property
    def adjusted(self) -> float:
        """The p-value adjusted for multiple tests."""
        return of_several(self.p_value, self.multiplicity)

    @property
    def is_worth_a_fit(self) -> bool:
        """Whether noise alone gives less than one as large in a round.

        How runs differ does not count yet: without a large cause its own effect is most of that. It counts once the
        cause is in the model, when its size is tested.

        Source: J. Fan and J. Lv, Journal of the Royal Statistical Society B 70 (2008), 849-911: a screen must keep.
        """
        return bool(self._by_noise(self.statistic) * self.multiplicity <= 1.0)

    def is_beyond_noise(self, price: float) -> bool:
        """Whether a statistic less by a price is larger than the largest of a round that noise alone gives."""
        return of_several(self._by_noise(self.statistic - price), self.multiplicity) <= TUNING.level

    def _by_noise(self, statistic: float) -> float:
        return float(_p_value(max(statistic, 0.0), self.candidate.size, positive=self.candidate.positive))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Scores:
    """Scores of all distinct disturbances, beside everything in the fit."""

    A: Array  # (m, m) information, s: (m,) scores
    s: Array
    size: Array  # (m,) norms of the disturbances before anything is projected out of them
    index: tuple[Array, ...]  # per candidate, its rows
    spread: Spread  # of the (m,) estimates, between runs


def score_tests(
    base: Fit, candidates: Sequence[Candidate], rng: np.random.Generator | None = None
) -> tuple[ScoreTest, ...]:
    """Tests of every candidate against the fit without it, best first; without `rng` not adjusted for their number."""
    return scored_between_runs(base, candidates, rng)[0]


def scored_between_runs(
    base: Fit, candidates: Sequence[Candidate], rng: np.random.Generator | None = None
) -> tuple[tuple[ScoreTest, ...], Dispersion]:
    """The same, and how much the estimates of all candidates differ between runs beside everything in the fit."""
    scores = _scores(base, candidates)
    known = Dispersion.of(scores.spread) if len(np.unique(runs_of(base.linear.motion.windows))) > 1 else NOISE_ALONE
    factors, freedoms = known.beside(scores.spread)
    tests, roots = [], []
    for candidate, index in zip(candidates, scores.index, strict=True):
        size = scores.size[index]
        block = scores.A[np.ix_(index, index)] / np.outer(size, size)
        values, vectors = np.linalg.eigh(block)
        if values[0] < LEAST_OWN_SHARE or not np.isfinite(block).all():
            continue  # indistinguishable from the effects that the model already has
        root = vectors / np.sqrt(values)
        z = root.T @ (scores.s[index] / size)
        step = (root @ z) / size
        against = candidate.positive and step[0] < 0.0
        impossible = not candidate.is_possible(partial(_stepped, base, candidate, step))
        factor, freedom = float(factors[index].mean()), float(freedoms[index].min())
        beyond = tail(float(z @ z), len(index), factor, freedom) / (2.0 if candidate.positive else 1.0)
        tests.append(
            ScoreTest(
                candidate=candidate,
                statistic=0.0 if against or impossible else float(z @ z),
                p_value=1.0 if impossible else 1.0 - beyond if against else beyond,
                step=step,
                factor=factor,
                freedom=freedom,
            )
        )
        roots.append((index, root / size[:, None]))
    if tests and rng is not None:
        multiplicity = _effective_tests(scores.A, roots, [item.candidate for item in tests], rng)
        tests = [replace(item, multiplicity=number) for item, number in zip(tests, multiplicity, strict=True)]
    return tuple(sorted(tests, key=lambda item: item.p_value * item.multiplicity)), known


def _stepped(base: Fit, candidate: Candidate, step: Array, key: str) -> float:
    """Value of an effect after the linear estimate."""
    if key not in candidate.free:
        return candidate.fixed.get(key, base.ship.get(key))
    return base.ship.get(key) + float(step[[*candidate.free].index(key)])


def _scores(base: Fit, candidates: Sequence[Candidate]) -> _Scores:
    shared: dict[object, int] = {}
    places = [
        np.array([shared.setdefault(tag, len(shared)) for tag, _ in candidate_disturbances(base.linear, candidate)])
        for candidate in candidates
    ]
    c, (names, run) = len(base.keys), np.unique(runs_of(base.linear.motion.windows), return_inverse=True)
    own, both = np.zeros((len(names), c, c)), np.zeros((len(names), c, len(shared)))
    each, s = np.zeros((len(names), len(shared))), np.zeros((len(names), c + len(shared)))
    A = np.zeros((c + len(shared), c + len(shared)))
    for taken, linear in in_groups(base.linear, c + len(shared)):
        disturbances = [*effect_disturbances(linear, base.keys), *_distinct(linear, candidates)]
        found = build_sensitivities(linear, disturbances, random_current=base.noise.current_std_mps > 0)
        of_windows, scores = window_information(gram_matrices(found, base.noise), found, base.noise)
        A = A + of_windows.sum(axis=0)
        np.add.at(own, run[taken], of_windows[:, :c, :c])
        np.add.at(both, run[taken], of_windows[:, :c, c:])
        np.add.at(each, run[taken], np.diagonal(of_windows, axis1=1, axis2=2)[:, c:])
        np.add.at(s, run[taken], scores)
    spread = directions_between_runs((own, both, each), (s[:, :c], s[:, c:]), base.precision)
    score = s.sum(axis=0)
    size = np.sqrt(np.maximum(np.diag(A)[c:], 1e-300))
    now = deviations_of(base.ship, base.keys)
    if c:
        of_effects = np.column_stack([A[:c, c:], score[:c] - base.precision @ now])
        solved = pseudo_inverse_of(A[:c, :c] + base.precision) @ of_effects
        score = score[c:] - A[c:, :c] @ solved[:, -1]
        A = A[c:, c:] - A[c:, :c] @ solved[:, :-1]
    return _Scores(A=A, s=score, size=size, index=tuple(places), spread=spread)


def _distinct(linear: LinearisedMotion, candidates: Sequence[Candidate]) -> list[Disturbance]:
    """Disturbances along a motion, each once, in the order of their first candidates."""
    shared = dict[object, Disturbance]()
    for candidate in candidates:
        for tag, disturbance in candidate_disturbances(linear, candidate):
            if tag not in shared:
                shared[tag] = disturbance()
    return [*shared.values()]


def _p_value(statistic: Any, freedom: int, *, positive: bool) -> Any:
    """Of a chi-squared statistic; of sizes that cannot be below zero, one-sided.

    Source: H. Chernoff, Annals of Mathematical Statistics 25 (1954), 573-578, for a size at its bound.
    """
    return scipy.special.chdtrc(freedom, statistic) / (2.0 if positive else 1.0)


def _effective_tests(
    A: Array, roots: list[tuple[Array, Array]], candidates: Sequence[Candidate], rng: np.random.Generator
) -> list[float]:
    """How many independent tests each one is among: candidates of its cause, times causes."""
    size = np.sqrt(np.maximum(np.diag(A), 1e-300))  # sizes may span more digits than floating-point numbers
    values, vectors = np.linalg.eigh((A + A.T) / 2 / np.outer(size, size))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    drawn = rng.standard_normal((DRAWS, len(A))) @ root.T * size
    causes = [item.cause.split(":")[0] for item in candidates]
    largest: dict[tuple[str, int, bool], Array] = {}
    for cause, candidate, (index, own_root) in zip(causes, candidates, roots, strict=True):
        z, key = drawn[:, index] @ own_root, (cause, len(index), candidate.positive)
        statistic = ((z * np.sign(own_root).T > 0.0)[:, 0] if candidate.positive else 1.0) * (z**2).sum(axis=1)
        largest[key] = np.maximum(largest[key], statistic) if key in largest else statistic
    smallest: dict[str, Array] = {}
    for (cause, freedom, positive), statistic in largest.items():
        p_values = np.where(statistic > 0.0, _p_value(statistic, freedom, positive=positive), 1.0 - TINY)
        smallest[cause] = np.minimum(smallest[cause], p_values) if cause in smallest else p_values
    own = {cause: _independent_tests(p_values) for cause, p_values in smallest.items()}
    adjusted = [-np.expm1(own[cause] * np.log1p(-p_values)) for cause, p_values in smallest.items()]
    every = _independent_tests(np.min(adjusted, axis=0))
    return [own[cause] * every for cause in causes]


def _independent_tests(smallest: Array) -> float:
    """Number of independent tests whose smallest p-value has the same quantile at the level; one for a single test."""
    found = max(float(np.quantile(smallest, TUNING.level)), TINY)
    return max(1.0, math.log1p(-TUNING.level) / math.log1p(-found))
