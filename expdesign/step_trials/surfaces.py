"""Damping and inertia as surfaces over speed and yaw rate, and the region in which they hold.

The bases keep the symmetry of a vessel whose port and starboard sides are alike: the damping of surge and both inertias
are even in r, the damping of yaw is odd in r but for a constant, the rudder that holds a straight course. They are
fitted by weighted ridge or lasso with cross-validation,

    minimise  (1/N) sum w_i (y_i - phi_i beta)^2 + penalty * sum beta_j^2    (ridge)
                                              or + penalty * sum |beta_j|    (lasso)

on columns of unit root mean square; the intercept is not penalised. Nothing prevents weights in either.

Source: T. Hastie, R. Tibshirani and J. Friedman, The Elements of Statistical Learning (2009), 3.4, 7.10; leave-one-out
errors of ridge by its hat matrix.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
import shapely

from expdesign.step_trials.holds import CHANNELS, CONSTANT_SHARE
from expdesign.step_trials.samples import STEADY_BLOCKS, Plateau, StepSample
from expdesign.values import Array, sealed

# of ridge and lasso that cross-validation compares, on columns of unit size
PENALTIES = (1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
FOLDS = 10  # of cross-validation where there is no closed form


SMALLEST = 1e-11  # eigenvalue of the normal equations, relative to the largest, below which smaller ones are raised


@sealed(columns="n p", values="n", weights="n", penalised="p")
class Sampled:
    """Values of a function at places."""

    columns: Array  # (n, p) basis functions
    values: Array  # (n,)
    weights: Array  # (n,)
    penalised: Array  # (p,) 0 for the intercept, 1 for others

    def part(self, rows: Array) -> Sampled:
        """Some of the samples."""
        return Sampled(
            columns=self.columns[rows], values=self.values[rows], weights=self.weights[rows], penalised=self.penalised
        )


@sealed(coefficients="p")
class Fit:
    """A regression."""

    method: str  # "ridge" or "lasso"
    penalty: float  # that cross-validation chose
    coefficients: Array  # (p,) of the columns as given
    held_out: float  # weighted root mean square error of cross-validation, unit of the values


def ridge(samples: Sampled, penalties: tuple[float, ...] = PENALTIES) -> Fit:
    """Ridge regression with the penalty of the least leave-one-out error, in closed form."""
    errors = [_left_out_error(samples, penalty) for penalty in penalties]
    best = int(np.argmin(errors))
    solution = _ridge(samples, penalties[best])[0]
    return Fit(method="ridge", penalty=penalties[best], coefficients=solution, held_out=errors[best])


def lasso(samples: Sampled, penalties: tuple[float, ...] = PENALTIES) -> Fit:
    """Lasso with the penalty of the least error in folds; zeros are exact."""
    folds = np.arange(float(len(samples.values))) % min(FOLDS, len(samples.values))
    largest = _largest_penalty(samples)
    errors = [_fold_error(samples, folds, penalty * largest) for penalty in penalties]
    best = int(np.argmin(errors))
    solution = _lasso(samples, penalties[best] * largest)
    return Fit(method="lasso", penalty=penalties[best] * largest, coefficients=solution, held_out=errors[best])


def _scale(samples: Sampled) -> Array:
    size = np.sqrt(np.mean(samples.columns**2, axis=0))
    return np.where(size > 0, size, 1.0)


def _ridge(samples: Sampled, penalty: float) -> tuple[Array, Array]:
    """(p,) coefficients, (n,) leverages."""
    scale, root = _scale(samples), np.sqrt(samples.weights / len(samples.values))
    rows = root[:, None] * samples.columns / scale
    gram = rows.T @ rows + penalty * np.diag(samples.penalised + 1e-12)
    gain = np.linalg.pinv(gram, hermitian=True, rcond=1e-14) @ rows.T
    return gain @ (root * samples.values) / scale, np.einsum("np,pn->n", rows, gain)


def _left_out_error(samples: Sampled, penalty: float) -> float:
    solution, leverage = _ridge(samples, penalty)
    error = (samples.values - samples.columns @ solution) / np.maximum(1.0 - leverage, 1e-6)
    return _weighted_rms(samples, error)


def _weighted_rms(samples: Sampled, error: Array) -> float:
    return float(np.sqrt(np.sum(samples.weights * error**2) / np.sum(samples.weights)))


def _fold_error(samples: Sampled, folds: Array, penalty: float) -> float:
    error = np.empty(len(samples.values))
    for fold in np.unique(folds):
        out = folds == fold
        error[out] = samples.values[out] - samples.columns[out] @ _lasso(samples.part(~out), penalty)
    return _weighted_rms(samples, error)


def _largest_penalty(samples: Sampled) -> float:
    """The penalty from which on all penalised coefficients are about zero."""
    pull = samples.columns.T @ (samples.weights * samples.values) / _scale(samples) / len(samples.values)
    return 2.0 * float(np.max(np.abs(pull)))


def _lasso(samples: Sampled, penalty: float) -> Array:
    """The lasso, solved as non-negative least squares in the positive and negative parts of the coefficients."""
    scale, root = _scale(samples), np.sqrt(samples.weights / len(samples.values))
    rows = root[:, None] * samples.columns / scale
    both = np.concatenate([rows, -rows], axis=1)
    pull = both.T @ (root * samples.values) - penalty / 2 * np.tile(samples.penalised, 2)
    values, vectors = np.linalg.eigh(both.T @ both)
    sizes = np.sqrt(np.maximum(values, SMALLEST * values[-1]))
    parts, _ = scipy.optimize.nnls(sizes[:, None] * vectors.T, vectors.T @ pull / sizes, maxiter=100 * len(pull))
    return np.asarray((parts[: len(scale)] - parts[len(scale) :]) / scale)


EVEN = ((0, 0), (1, 0), (2, 0), (0, 2), (3, 0), (1, 2), (4, 0), (2, 2), (0, 4))
ODD = ((0, 1), (1, 1), (2, 1), (0, 3), (3, 1), (1, 3))  # powers of U and r
WITH_BIAS = ((0, 0), *ODD)
STEEPNESS = (2.0, 5.0, 10.0)  # a of tanh(a (U - b)), times the range of U
BENDS = (0.1, 0.3, 0.5)  # b, as a share of the range of U
NO_BEND = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """A function of U [m/s] and r [rad/s]."""

    powers: tuple[tuple[int, int], ...]  # of U and r in each term
    bend: tuple[float, float]  # a [s/m] and b [m/s]; `NO_BEND` for none
    fit: Fit  # its coefficients are those of the terms, the last one of tanh(a (U - b)) where there is a bend
    # least, most: smallest and largest value measured
    least: float
    most: float

    def __call__(self, state: Array) -> Array:
        """(...) value at states (..., 2)."""
        return np.asarray(_columns(state, self.powers, self.bend) @ self.fit.coefficients)

    def at(self, u: float, r: float) -> float:
        """Value at one state, quicker than for an array."""
        value = sum(c * u**i * r**j for c, (i, j) in zip(self._numbers, self.powers, strict=False))
        bent = self._numbers[-1] * math.tanh(self.bend[0] * (u - self.bend[1])) if self.bend != NO_BEND else 0.0
        return value + bent

    @cached_property
    def _numbers(self) -> list[float]:
        return [float(one) for one in self.fit.coefficients]


def _columns(state: Array, powers: Sequence[tuple[int, int]], bend: tuple[float, float]) -> Array:
    u, r = state[..., 0], state[..., 1]
    columns = [u**i * r**j for i, j in powers]
    if bend != NO_BEND:
        columns.append(np.tanh(bend[0] * (u - bend[1])))
    return np.stack(columns, axis=-1)


def fitted_surface(
    states: Array,
    values: Array,
    powers: tuple[tuple[int, int], ...],
    *,
    weights: Array | None = None,
    bends: bool = False,
) -> Surface:
    """A surface through values at states (n, 2), by ridge or lasso.

    A basis with more terms than half of the samples is cut to those of lowest degree. Where a bend is allowed its place
    and steepness are those of the least leave-one-out error, if that is less than without one.
    """
    powers = _affordable(powers, states)
    candidates = [NO_BEND, *(_bends(states[:, 0]) if bends and len(values) > 2 * len(powers) + 4 else [])]
    weights = np.ones(len(values)) if weights is None else weights
    sampled = {bend: _sampled(states, values, weights, powers, bend) for bend in candidates}
    best = min(candidates, key=lambda bend: ridge(sampled[bend]).held_out)
    fit = min((ridge(sampled[best]), lasso(sampled[best])), key=lambda fit: fit.held_out)
    return Surface(powers=powers, bend=best, fit=fit, least=float(values.min()), most=float(values.max()))


def _sampled(
    states: Array, values: Array, weights: Array, powers: Sequence[tuple[int, int]], bend: tuple[float, float]
) -> Sampled:
    columns = _columns(states, powers, bend)
    penalised = np.array([*(float(power != (0, 0)) for power in powers), *[1.0] * (bend != NO_BEND)])
    return Sampled(columns=columns, values=values, weights=weights, penalised=penalised)


def _affordable(powers: tuple[tuple[int, int], ...], states: Array) -> tuple[tuple[int, int], ...]:
    """Terms of lowest degree, at most half as many as there are samples; none in r where r never differs from 0."""
    turning = np.ptp(np.abs(states[:, 1])) > 1e-3 * max(float(np.max(np.abs(states[:, 1]))), 1e-9)
    useful = [power for power in powers if turning or not power[1]] or list(powers[:1])
    return tuple(sorted(useful, key=sum)[: max(1, len(states) // 2)])


def _bends(speeds: Array) -> list[tuple[float, float]]:
    low, width = float(speeds.min()), float(np.ptp(speeds)) or 1.0
    return [(steep / width, low + place * width) for steep in STEEPNESS for place in BENDS]


@sealed(corners="k 2", scale="2")
class ValidityRegion:
    """Convex hull of the steady states and transients of a trial, in U and |r|, mirrored to both sides."""

    corners: Array  # (k, 2) of the hull, U [m/s] and r [rad/s] divided by `scale`
    scale: Array  # (2,) largest U and |r|

    @cached_property
    def hull(self) -> shapely.Geometry:
        """The region in scaled coordinates."""
        hull = shapely.MultiPoint(self.corners).convex_hull
        shapely.prepare(hull)
        return hull

    @property
    def outline(self) -> Array:
        """(k, 2) corners in U and r."""
        return np.asarray(self.corners * self.scale)

    def contains(self, state: Array) -> bool:
        """Whether a state (2,) lies in it, up to a thousandth of its size."""
        return bool(shapely.dwithin(self.hull, shapely.Point(state / self.scale), 1e-3))

    def nearest(self, state: Array) -> Array:
        """The state itself, or the nearest one on the edge."""
        u, r = (state / self.scale).tolist()
        if shapely.intersects_xy(self.hull, u, r):
            return state
        place = shapely.Point(u, r)
        near = shapely.get_coordinates(shapely.shortest_line(self.hull, place))[0]
        return np.asarray(near * self.scale)


def validity_region(states: Array) -> ValidityRegion:
    """The region of the states (n, 2) that a trial visited."""
    scale = np.maximum(np.max(np.abs(states), axis=0), 1e-9)
    mirrored = np.concatenate([states, states * [1.0, -1.0]]) / scale
    hull = shapely.MultiPoint(mirrored).convex_hull
    return ValidityRegion(corners=shapely.get_coordinates(hull), scale=scale)


LOW_ORDER = 3  # highest degree of the surface that is compared with
LEAST_PAIRS = 2  # levels reached from both sides, from which hysteresis is judged
REPEATED_SHARE = 0.003
"""Of a steady state, within which it repeats itself from hour to hour whatever its standard error says."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A difference that a symmetric surface without memory cannot have."""

    kind: str  # "asymmetry" or "hysteresis"
    command: str  # "throttle" or "rudder"
    difference: float  # half of that between the two sides or branches, in the unit of the command
    std: float  # its standard error
    p_value: float  # of no difference
    samples: int  # plateaus compared
    state_difference: float = math.nan  # of hysteresis: down less up, in the state that the command drives; m/s, rad/s
    at: tuple[float, float] | None = None  # commands of the pair that shows it; None for the mean of all pairs


def comparisons(samples: Sequence[StepSample]) -> tuple[Comparison, ...]:
    """Asymmetry where both sides were sailed, hysteresis where levels were reached from both directions."""
    steady = [(one, one.plateau) for one in samples if one.plateau is not None]
    found = [
        part for channel in range(len(CHANNELS)) for part in (_asymmetry(channel, steady), _paired(channel, steady))
    ]
    return tuple(one for one in found if one is not None)


def _paired(channel: int, steady: Sequence[tuple[StepSample, Plateau]]) -> Comparison | None:
    """Hysteresis: plateaus at the same commands, after steps up and after steps down, whatever the surface is between.

    Hysteresis may be that of an actuator, alike at all levels, or of the flow, at some of them: the mean difference and
    the largest one are both judged, and the clearer of the two is told.

    Differences are weighed by their standard errors. Where they do not even agree in sign and spread more than these,
    their own spread counts, as in a random-effects meta-analysis; where they agree it is by what hysteresis differs
    from level to level.

    Source: G. Knapp and J. Hartung, Statistics in Medicine 22 (2003), 2693-2710.
    """
    own = [(one, part) for one, part in steady if one.hold.channel == channel and np.isfinite(part.std).all()]
    at, pairs = _pairs(own)
    if len(pairs) < LEAST_PAIRS:
        return None
    commands = np.array([one.hold.commands[channel] for one, _ in own])
    states = np.array([part.state[channel] for _, part in own])
    levels = [[place for place, (one, _) in enumerate(own) if _level(one, 1 - channel, own) == key] for key in
              dict.fromkeys(_level(one, 1 - channel, own) for one, _ in own)]  # fmt: skip
    rows = [(np.ptp(commands[part]), np.ptp(states[part])) for part in levels if np.ptp(commands[part]) > 0]
    slope = float(np.median([high / wide for wide, high in rows]))
    apart, variance = np.array(pairs).T
    weights = 1.0 / variance
    mean = float(weights @ apart / weights.sum())
    own_variance, freedom = 1.0 / float(weights.sum()), float(len(pairs) * 2 * (STEADY_BLOCKS - 1))
    spread = float(weights @ (apart - mean) ** 2 / weights.sum()) / (len(pairs) - 1)
    if spread > own_variance and np.ptp(np.sign(apart)):
        own_variance, freedom = spread, len(pairs) - 1.0
    std = math.sqrt(own_variance)
    p_value, one = 2 * float(scipy.special.stdtr(freedom, -abs(mean) / std)), int(np.argmax(apart**2 / variance))
    alone = 2 * float(scipy.special.stdtr(2 * (STEADY_BLOCKS - 1), -abs(apart[one]) / math.sqrt(variance[one])))
    place = None
    if alone * len(pairs) < p_value:
        p_value, mean, std = alone * len(pairs), float(apart[one]), math.sqrt(variance[one])
        place = at[one]
    return Comparison(
        kind="hysteresis", command=CHANNELS[channel], difference=mean / 2 / slope, std=std / 2 / slope,
        p_value=min(1.0, 2 * p_value), samples=2 * len(pairs), state_difference=mean, at=place,
    )  # fmt: skip


def _level(one: StepSample, channel: int, own: Sequence[tuple[StepSample, Plateau]]) -> int:
    """Number of the level of a command, within the width that holds have."""
    values = [other.hold.commands[channel] for other, _ in own]
    return round(one.hold.commands[channel] / max(CONSTANT_SHARE * float(np.ptp(values)), 1e-6))


def _pairs(own: Sequence[tuple[StepSample, Plateau]]) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Commands of each pair, and state after steps down less that after steps up, away from zero, with its variance."""
    groups: dict[tuple[int, int], dict[bool, list[Plateau]]] = {}
    places: dict[tuple[int, int], tuple[float, float]] = {}
    channel = (own[0][0].hold.channel or 0) if own else 0
    for one, part in own:
        key = _level(one, 0, own), _level(one, 1, own)
        groups.setdefault(key, {True: [], False: []})[one.upward].append(part)
        places.setdefault(key, one.hold.commands)
    at, found = [], []
    for key, by in groups.items():
        if by[True] and by[False]:
            up, down = (_joined(by[way], channel) for way in (True, False))
            variance = up[1] + down[1] + 2.0 * (REPEATED_SHARE * up[0]) ** 2
            found.append((float(np.sign(up[0])) * (down[0] - up[0]), variance))
            at.append(places[key])
    return at, found


def _joined(parts: Sequence[Plateau], channel: int) -> tuple[float, float]:
    """Weighted mean of plateaus, and its variance."""
    weights = np.array([part.std[channel] for part in parts]) ** -2.0
    values = np.array([part.state[channel] for part in parts])
    return float(weights @ values / weights.sum()), 1.0 / float(weights.sum())


def _asymmetry(channel: int, steady: Sequence[tuple[StepSample, Plateau]]) -> Comparison | None:
    signs = np.array([np.sign(part.state[1]) * (abs(one.hold.commands[1]) > 0) for one, part in steady])
    states = np.array([part.state for _, part in steady])
    values = np.array([one.hold.commands[channel] for one, _ in steady])
    # half the difference of the rudders of both sides is a constant, that of throttles changes sign with the side
    powers = [power for power in (ODD if channel else EVEN) if sum(power) <= LOW_ORDER]
    extra = np.ones(len(signs)) if channel else signs
    if min(np.sum(signs > 0), np.sum(signs < 0)) < 3 or len(values) < len(powers) + 4:
        return None
    columns = np.stack([states[:, 0] ** i * states[:, 1] ** j for i, j in powers], axis=1)
    return _tested("asymmetry", CHANNELS[channel], columns, extra, values)


def _tested(kind: str, command: str, columns: Array, extra: Array, values: Array) -> Comparison:
    """The comparison that one more column makes; its F test is the square of its t test."""
    columns = columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-12)
    rest, target = (part - columns @ np.linalg.lstsq(columns, part, rcond=1e-10)[0] for part in (extra, values))
    power = max(float(rest @ rest), 1e-12)
    difference = float(rest @ target) / power
    freedom = len(values) - np.linalg.matrix_rank(columns) - 1
    error = target - difference * rest
    std = float(np.sqrt(max(float(error @ error), 1e-300) / freedom / power))
    p_value = 2 * float(scipy.special.stdtr(freedom, -abs(difference) / std))
    return Comparison(kind=kind, command=command, difference=difference, std=std, p_value=p_value, samples=len(values))
