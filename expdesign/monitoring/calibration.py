"""Calibration on a reference: a period in which the ship was as known, in the weather and with the sensors at hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from expdesign.errors import NotInformative
from expdesign.monitoring.changes import INERTIA, Change
from expdesign.monitoring.evidence import STARTS, Grams, Stretches, stretches_of
from expdesign.monitoring.force import (
    Force,
    Judged,
    Known,
    after_gap,
    after_stretch,
    beside,
    judged,
    likelihood,
    surprise,
)
from expdesign.values import Array, sealed

KNOWN_WITHIN = 6.0  # a change is watched for where its size is so many standard errors of the reference

ITERATIONS = 60  # of the expectation-maximisation of noise and force
FEWEST_STRETCHES = 40  # of a reference
# blocks into which the reference is cut to measure how scores of neighbouring stretches correlate; the largest
# inflation counts
BLOCK_COUNTS = (160, 80, 40, 20)
SHOALER = 0.12  # by which draught over depth is beyond the reference's before the water counts as shallower
# how uncertain forces of the measured wind may be beside the reference's most uncertain, as a ratio of variances: twice
# as large an error
WINDS_REACH = 4.0
MISFIT_DEVIATIONS = 6.0  # standard deviations of the reference's misfit beyond which a stretch is not judged
LARGEST_SIZE = 10.0  # of changes that are told from errors unlike the reference's, in sizes that matter
# correlation times of the unmeasured force: first guess of the quick one, and the slow one [s]
QUICK_S, SLOW_S = 300.0, 43200.0
# variance of the slow part beside what the reference shows, as a multiple of it and by the number of times `SLOW_S`
# that the reference covers
SPARE = 8.0
SLOW_SHARE = 1 / 16  # of the variance, in the slow part where the search begins; it never is more than the whole
WIND_S = 7200.0  # correlation time of winds [s]
STRONGER = 4.0  # variance that winds may have later, in that of the reference
SEARCHED_STRETCHES = 600  # of a reference, from which the variation of the force is learnt
# iterations of that search, least relative gain of the likelihood in one, and the step of its slopes, in powers of two
SEARCH_ITERATIONS, SEARCH_GAIN, SEARCH_STEP = 30, 1e-5, 0.01
MOST_QUICK = 6.0  # largest variance of the quick part in that of independent stretches, in powers of two

LEAST_VARIANCE = 1e-14  # of a force that is none
ROUGHER = ((2.0, False), (5.0, False), (3.0, True))
"""Standard deviations of the force in other weathers, in those of the reference, and whether it lasts `LASTING_S`."""
WINDIER = 2.0
"""Standard deviation of winds in another weather, in the larger of those that they may have and of quick forces."""
LASTING_S = 900.0
PUSHES = 3  # accelerations among the components of the force, the last of them
LEAST_SURPRISE = 0.1  # of a stretch on average, where the reference shows no force


@sealed(
    std="h",
    ramp="o",
    baseline="m",
    baseline_covariance="m m",
    inflation="m",
    rate="m",
    alike="m m",
    load="m",
    wanted="m",
    weights="m q",
    surprise="m",
)
class Calibration:
    """What a reference tells of noise, of the unmeasured force and of the ship."""

    std: Array  # (h,) standard deviations of the noise of the channels of `Grams`; infinite where not measured
    force: Force  # the unmeasured force
    ramp: Array  # (o,) variances of what its accelerations grow by within a stretch, and of the drift of a gyro
    baseline: Array  # (m,) differences of the ship from its model in the reference, in sizes of the changes
    # (m, m) covariance of their errors, all free at once, with a prior of one size, after inflation
    baseline_covariance: Array
    inflation: Array  # (m,) variance of sums of scores over that of independent stretches, at least one
    rate: Array  # (m,) information of a stretch, on average, in inverse squared sizes and after inflation
    alike: Array  # (m, m) correlation of scores: one where two changes cannot be told apart
    stretches: int  # number of stretches of the reference
    stretch_s: float  # their length [s]
    misfit_limit: float  # misfit per measured number beyond which a stretch is not judged
    seas: Force  # (a, n) the force in other weathers, see `_seas`
    weights: Array  # (m, q) of the surprises of components of the force, for every change, see `force.surprise`
    surprise: Array  # (m,) of a stretch on average, with these: how well the weather is predicted
    load: Array  # (m,) standard deviation of what a port call may change of the load, in sizes
    heavier: Array  # (m,) what more mass changes, in sizes: the inertia of every equation alike; zero where it is one
    wanted: Array  # (m,) one for changes that are watched for where they can be, zero for those that are learnt only
    shoal_limit: float  # draught over depth beyond which the water is shallower than the reference's
    air: tuple[int, ...]  # numbers of the changes that act by the measured wind
    wind_limit: float  # `by_wind` beyond which the wind is unlike the reference's
    wind_mps: float  # largest mean speed of the air past the ship in a stretch of the reference [m/s]

    @property
    def loads(self) -> NDArray[np.int64]:
        """(l,) numbers of the changes that a port call may bring, and of air drag, which every wind may tell."""
        return np.array(sorted({*np.flatnonzero(self.load).tolist(), *self.air}), dtype=np.int64)

    @property
    def _air_places(self) -> NDArray[np.int64]:
        """(a,) of air drag in `Known`."""
        return np.asarray(len(self.force.time_s) + np.searchsorted(self.loads, self.air))

    @property
    def nuisance(self) -> Force:
        """The unmeasured force and the load."""
        return self.force.with_load(len(self.loads))

    @property
    def others(self) -> Force:
        """`nuisance` in each of the other weathers."""
        return self.seas.with_load(len(self.loads))

    @property
    def baseline_std(self) -> Array:
        """(m,) standard errors of the baseline."""
        return np.sqrt(np.diag(self.baseline_covariance))

    def by_wind(self, known: Known, one: Judged) -> float:
        """Squared error that forces of the wind leave in a stretch on average, as the reference tells of air drag.

        That is what the stretch tells of air drag, times the covariance of the reference: it grows as the wind is
        stronger than there, or comes from where none came.

        Args:
            known: before the stretch.
            one: the stretch.

        Source: D. C. Montgomery, E. A. Peck and G. G. Vining, Introduction to Linear Regression Analysis (2012),
        section 3.8, on extrapolation told by the largest leverage.
        """
        own = np.ix_(self._air_places, self._air_places)
        told = np.linalg.inv(one.gain[own]) - np.linalg.inv(known.covariance[own])
        return float((told * self.baseline_covariance[np.ix_(self.air, self.air)]).sum())

    def begun(self, force: Force) -> Known:
        """What is known of force and load where a watch begins: of air drag, what the reference tells."""
        known = Known.nothing(force)
        covariance, own = known.covariance.copy(), self._air_places
        covariance[..., own[:, None], own] = self.baseline_covariance[np.ix_(self.air, self.air)]
        return replace(known, covariance=covariance)

    def called(self, known: Known) -> Known:
        """What is known of force and load after a port call, which may have changed the load."""
        more = np.concatenate([np.zeros(len(self.force.time_s)), self.load[self.loads] ** 2])
        return replace(known, covariance=known.covariance + np.diag(more))

    @property
    def watched(self) -> NDArray[np.bool_]:
        """(m,) changes that can be told from the uncertainty of the reference itself."""
        return np.asarray((self.rate * self.stretches >= KNOWN_WITHIN**2) & (self.wanted > 0))

    @property
    def common(self) -> float:
        """The largest inflation of changes that are watched, for comparing them."""
        return float(self.inflation[self.watched].max())


def calibrate(grams: Grams, *, changes: Sequence[Change] = ()) -> Calibration:
    """Noise, force and baseline of a reference.

    Noise and the variances of a force that is independent from stretch to stretch have the largest likelihood, by
    expectation-maximisation. How the force varies from stretch to stretch follows from a search of the likelihood of
    the filter. Changes have a standard normal prior in units of their sizes.

    Args:
        grams: of the reference, in which the ship carries one load.
        changes: those of the inner products; without them all are watched for, and no port call changes the load.

    Raises:
        NotInformative: too few stretches.

    Source: N. M. Laird and J. H. Ware, Biometrics 38 (1982), 963-974.
    """
    if len(grams) < FEWEST_STRETCHES:
        raise NotInformative(
            f"the reference has {len(grams)} stretches of {grams.stretch_s:g} s with a usable simulation, expected at "
            f"least {FEWEST_STRETCHES}, {FEWEST_STRETCHES * grams.stretch_s / 3600.0:.1f} h"
        )
    m = grams.changes
    std, ramp, variance = _independent(_windless(grams))
    stretches = stretches_of(grams, std, ramp)
    force = _spared(_varying(stretches, variance, grams.stretch_s), grams.time_s, grams.winds)
    score, information = _filtered(stretches, force)
    air = np.flatnonzero([change.air for change in changes])
    whole = information.sum(axis=0)
    baseline = np.linalg.solve(whole + np.eye(m), score.sum(axis=0))
    after = stretches.less(baseline)
    left, told = _filtered(after, force)
    inflation = _inflation(left, np.einsum("wii->wi", told))
    own = np.sqrt(np.maximum(np.diag(whole), 1e-300))
    misfit, surprises = _misfits(after, force)
    weights = _weights(stretches)
    middle = float(np.median(misfit))
    spread = 1.4826 * float(np.median(np.abs(misfit - middle)))
    found = Calibration(
        std=std,
        ramp=ramp,
        force=force,
        baseline=baseline,
        baseline_covariance=_errors(left, told),
        inflation=inflation,
        rate=np.diag(whole) / inflation / len(grams),
        alike=whole / np.outer(own, own),
        stretches=len(grams),
        stretch_s=grams.stretch_s,
        misfit_limit=middle + MISFIT_DEVIATIONS * spread,
        seas=_seas(force, stretches),
        weights=weights,
        surprise=np.maximum(weights @ surprises.mean(axis=0), LEAST_SURPRISE),
        load=np.array([change.load for change in changes]) if changes else np.zeros(m),
        heavier=_heavier(changes, m),
        wanted=np.array([float(change.watched) for change in changes]) if changes else np.ones(m),
        shoal_limit=float(grams.shoal.max()) + SHOALER,
        air=tuple(air.tolist()),
        wind_limit=np.inf,
        wind_mps=float(grams.wind_mps.max()),
    )
    own = found.baseline_covariance[np.ix_(air, air)]
    leverage = np.einsum("wij,ij->w", information[:, air[:, None], air], own)
    return replace(found, wind_limit=WINDS_REACH * float(leverage.max())) if len(air) else found


def _heavier(changes: Sequence[Change], count: int) -> Array:
    """(count,) of `Calibration.heavier`."""
    own = np.array([float(change.effect.startswith(INERTIA)) for change in changes])
    return own if own.sum() > 1.0 else np.zeros(count)


def misfit_of(quadratic: float, score: Array, information: Array, count: float) -> float:
    """Squared error per measured number, in standard deviations, that no change explains, large ones included."""
    explained = np.linalg.solve(information + np.eye(len(score)) / LARGEST_SIZE**2, score)
    return float((quadratic - score @ explained) / max(count, 1.0))


def _windless(grams: Grams) -> Grams:
    """The stretches without the columns of winds, each of which is a push within a stretch."""
    first = grams.changes + STARTS + grams.ramps
    kept = np.delete(np.arange(grams.products.shape[-1]), np.s_[first : first + grams.winds])
    return replace(grams, products=grams.products[:, :, kept][..., kept], winds=0)


def _independent(grams: Grams) -> tuple[Array, Array, Array]:
    """(h,) noise, (o,) and (q,) variances of ramps and the force, with a force of its own in each stretch."""
    total = grams.counts.sum(axis=1)
    error = grams.products[:, :, -1, -1].sum(axis=1)
    std = np.where(total > 0, np.sqrt(np.maximum(error, 1e-24) / np.maximum(total, 1)), np.inf)
    m, q = grams.changes, grams.ramps + grams.forces
    own = np.einsum("c,cwii->i", 1.0 / std**2, grams.products)[m + STARTS : m + STARTS + q]
    shown = grams.counts.sum() / np.maximum(own, 1e-300)
    variance = np.where(own > 0, np.maximum(shown, LEAST_VARIANCE), LEAST_VARIANCE)
    for _ in range(ITERATIONS):
        std, variance = _improved(grams, total, std, variance)
    return std, variance[: grams.ramps], variance[grams.ramps :]


def _improved(grams: Grams, total: Array, std: Array, variance: Array) -> tuple[Array, Array]:
    """Noise and variances after one step of expectation-maximisation."""
    m, c = grams.changes, grams.products.shape[-1]
    whole = np.einsum("c,cwij->wij", 1.0 / std**2, grams.products)
    nuisance, others = slice(m, c - 1), np.r_[:m, c - 1]
    inner = whole[:, nuisance, nuisance] + np.diag(np.concatenate([np.full(STARTS, 1e-9), 1.0 / variance]))
    across = whole[:, nuisance][:, :, others]
    left = (whole[:, others][:, :, others] - np.swapaxes(across, 1, 2) @ np.linalg.solve(inner, across)).sum(axis=0)
    change = np.linalg.solve(left[:m, :m] + np.eye(m), left[:m, m])
    after = np.eye(c)[:, m:]
    after[:m, -1] = -change
    own = after.T @ grams.products @ after
    spread = np.linalg.inv(inner)
    mean = np.einsum("wij,c,cwj->wi", spread, 1.0 / std**2, own[:, :, :-1, -1])
    second = spread + mean[:, :, None] * mean[:, None, :]
    remaining = (
        own[:, :, -1, -1]
        - 2.0 * np.einsum("cwi,wi->cw", own[:, :, :-1, -1], mean)
        + np.einsum("cwij,wij->cw", own[:, :, :-1, :-1], second)
    )
    noise = np.where(total > 0, np.sqrt(remaining.sum(axis=1) / np.maximum(total, 1)), np.inf)
    return noise, np.maximum(np.einsum("wii->i", second)[STARTS:] / len(grams), LEAST_VARIANCE)


def _varying(stretches: Stretches, variance: Array, stretch_s: float) -> Force:
    """The force as it varies from stretch to stretch: variances of its quick and slow parts and of winds, quick times.

    Args:
        stretches: of a reference.
        variance: (k,) of currents and accelerations, where each stretch has its own.
        stretch_s: length of a stretch [s].
    """
    part = replace(
        stretches,
        time_s=stretches.time_s[:SEARCHED_STRETCHES],
        heading=stretches.heading[:SEARCHED_STRETCHES],
        products=stretches.products[:SEARCHED_STRETCHES],
        counts=stretches.counts[:SEARCHED_STRETCHES],
    )
    k, axes = len(variance), stretches.winds // 2
    whole, winds = np.log2(variance), np.log2(variance[k - axes :])
    slow = np.concatenate([whole, winds])
    first = np.concatenate([whole - 1.0, slow + np.log2(SLOW_SHARE), np.full(k, np.log2(QUICK_S))])
    least = np.log2(LEAST_VARIANCE)
    bounds = [
        *[(least, high + MOST_QUICK) for high in whole.tolist()],
        *[(least, max(high, least)) for high in slow.tolist()],
        *[(np.log2(stretch_s / 2), np.log2(SLOW_S / 4))] * k,
    ]
    steps = np.vstack([np.zeros(len(first)), SEARCH_STEP * np.eye(len(first))])

    def cost(logarithms: Array) -> tuple[float, Array]:
        costs = likelihood(part, _force(logarithms + steps, k, axes))
        return float(costs[0]), (costs[1:] - costs[0]) / SEARCH_STEP

    words = {"maxiter": SEARCH_ITERATIONS, "ftol": SEARCH_GAIN}
    best: Any = minimize(cost, first, jac=True, bounds=bounds, method="L-BFGS-B", options=words)
    return _force(best.x, k, axes)


def _spared(force: Force, time_s: Array, winds: int) -> Force:
    """The force with more variance of its slow currents, of which a short reference shows few independent values.

    So with winds, which may be stronger later. The accelerations get none: a ship meets another mean current in every
    water, while slow wind and waves vary within a reference, too.
    """
    n = len(force.variance)
    k = (n - winds) // 2
    seen = len(np.unique(np.floor((time_s - time_s[0]) / SLOW_S)))
    spare = np.ones(n)
    spare[k : 2 * k - PUSHES if k > PUSHES else 2 * k] += SPARE / seen
    spare[2 * k :] = STRONGER
    return replace(force, variance=spare * force.variance)


def _force(logarithms: Array, k: int, axes: int) -> Force:
    """The force whose parameters have these logarithms (..., 3 k + axes)."""
    values = np.exp2(logarithms)
    processes, winds, quick = np.split(values, [2 * k, 2 * k + axes], axis=-1)
    variance = np.concatenate([processes, winds, winds], axis=-1)
    time_s = [quick, np.full_like(quick, SLOW_S), *[np.full_like(winds, WIND_S)] * 2]
    turning = np.zeros(variance.shape[-1])
    turning[max(k - PUSHES, 0) : k] = 1.0
    return Force(variance=np.maximum(variance, LEAST_VARIANCE), time_s=np.concatenate(time_s, axis=-1), turning=turning)


def _filtered(stretches: Stretches, force: Force) -> tuple[Array, Array]:
    """(w, m) scores and (w, m, m) information of changes that were there from the first stretch on."""
    m = stretches.changes
    known, taken = Known.nothing(force), np.zeros((force.variance.shape[-1], m))
    scores, told = np.empty((len(stretches), m)), np.empty((len(stretches), m, m))
    for index, products in enumerate(stretches.products):
        if index:
            gap = stretches.since(index)
            known, taken = after_gap(known, force, *gap), force.memory(*gap)[:, None] * taken
        one = judged(products, m, known)
        scores[index], told[index], taken = beside(one, taken)
        known = after_stretch(known, one)
    return scores, told


def _misfits(stretches: Stretches, force: Force) -> tuple[Array, Array]:
    """(w,) `misfit_of` every stretch of a reference, and (w, q) squared `surprise`."""
    known, found = Known.nothing(force), np.empty(len(stretches))
    surprises = np.empty((len(stretches), stretches.products.shape[-1] - stretches.changes - 1))
    for index, products in enumerate(stretches.products):
        if index:
            known = after_gap(known, force, *stretches.since(index))
        one = judged(products, stretches.changes, known)
        found[index] = misfit_of(float(one.quadratic), one.score, one.information, float(stretches.counts[index]))
        surprises[index] = surprise(products, stretches.changes, known)
        known = after_stretch(known, one)
    return found, surprises


def _seas(force: Force, stretches: Stretches) -> Force:
    """(a, n) forces of which one acceleration, or all currents, vary more than in the reference; or winds, the last.

    The quick part does, or what a stretch can tell of it, where it shows less; or, of an acceleration, a part of
    minutes takes the place of that of hours: a wind that comes and goes lasts as a change of the ship does for a while.
    """
    n, winds = len(force.variance), stretches.winds
    k = (n - winds) // 2
    told = np.einsum("wkk->k", stretches.products[:, -1 - k : -1, -1 - k : -1]) / len(stretches)
    quick = np.maximum(force.variance[:k], 1.0 / np.maximum(told, 1e-300))
    again = np.concatenate([quick, quick, np.tile(quick[k - winds // 2 :], 2)])
    first, axes = max(k - PUSHES, 0), np.arange(k)
    groups = [*(axes == axis for axis in range(first, k)), *[axes < first] * (first > 0)]
    variances, times = list[Array](), list[Array]()
    for group in groups:
        for factor, lasts in ROUGHER:
            place = np.concatenate([group & (not lasts), group & lasts & (axes >= first), np.zeros(winds, dtype=bool)])
            variances.append(np.where(place, factor**2 * again, force.variance))
            times.append(np.where(place & (np.arange(n) >= k), LASTING_S, force.time_s))
    if winds:
        place = np.arange(n) >= 2 * k
        variances.append(np.where(place, WINDIER**2 * np.maximum(again, force.variance), force.variance))
        times.append(np.where(place, LASTING_S, force.time_s))
    return replace(force, variance=np.array(variances), time_s=np.array(times))


def _weights(stretches: Stretches) -> Array:
    """(m, q) how much of every change's effect each component of the force resembles; rows add up to one.

    Of components, only the accelerations count: a current takes what they do, in every direction.
    """
    m, q = stretches.changes, stretches.products.shape[-1] - stretches.changes - 1
    across = (stretches.products[:, :m, m:-1] ** 2).sum(axis=0)
    own = np.einsum("wqq->q", stretches.products[:, m:-1, m:-1])
    alike = across / np.maximum(own, 1e-300) * (np.arange(q) >= q - PUSHES) + 1e-300
    return np.asarray(alike / alike.sum(axis=1, keepdims=True))


def _errors(score: Array, information: Array) -> Array:
    """(m, m) covariance of the errors of the baseline, where the scores of neighbouring stretches correlate.

    Sums of scores vary more than they say by a factor of each combination that is known apart from the others. Factors
    of changes would not do: two that look alike, each with its own, would seem to be told apart worse than they are.
    """
    known, axes = np.linalg.eigh(information.sum(axis=0))
    along = np.einsum("wij,ia,ja->wa", information, axes, axes)
    factors = np.where(known > 1.0, _inflation(score @ axes, along), 1.0)  # what the data do not tell, the prior does
    variance = (1.0 + known * factors) / (1.0 + known) ** 2
    return np.asarray(axes * variance @ axes.T)


def _inflation(score: Array, known: Array) -> Array:
    """(m,) the largest ratio of the variance of sums over blocks to the sum of information (w, m), at least one."""
    largest = np.ones(score.shape[1])
    for count in BLOCK_COUNTS:
        edges = np.linspace(0, len(score), min(count, len(score)), endpoint=False).astype(int)
        sums, sizes = np.add.reduceat(score, edges), np.add.reduceat(known, edges)
        largest = np.maximum(largest, (sums**2).sum(axis=0) / np.maximum(sizes.sum(axis=0), 1e-300))
    return largest
