"""A fit of effects and uncertain parameters, and likelihoods of fits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.data import Noise, channel_std, linear_basis, white_noise
from expdesign.diagnosis.fit.linear_model import (
    GramMatrices,
    Sensitivities,
    build_sensitivities,
    gram_matrices,
    marginalised,
)
from expdesign.diagnosis.model import FOLLOWING, LEAST_EFFECT, ExtendedModel, resisting, term_factors
from expdesign.diagnosis.motion import Disturbance, LinearisedMotion
from expdesign.own_units import solution_of
from expdesign.values import Array
from expdesign.vessel.quantities import TIME, acts_on, effect_row

STEPS = 8  # Gauss-Newton steps of a fit, at most
SMALLEST_FACTOR_CHANGE = -0.8  # factors stay above one plus this on the way, or above their least possible ones
LARGEST_RATIO = 3.0  # times and widths change by this factor in a step, at most
BEYOND_STD_LEVEL = 1e-3  # of the test whether parameters are within their stated standard deviations
LEAST_CORRELATION_EIGENVALUE = 1e-6  # of stated parameters; smaller ones count as rounded
FORCE_SPACING_S = 60.0  # between the knots of a force that nobody measured [s]
# sizes of such a force that are tried, as ridge penalties
FORCE_PENALTIES = (1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4)
POSITIVE = tuple(f"{kind}:" for kind in FOLLOWING)  # effects that are times, from zero on
LITTLE = 1e-6  # share of a step from which slopes of factors are taken


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """A model with effects fitted to all windows."""

    ship: ExtendedModel  # with the fitted effects
    keys: tuple[str, ...]  # the estimated effects, in order; uncertain parameters last
    free_count: int  # how many of them have no prior
    covariance: Array  # (c, c)
    starts: Array  # (w, n) initial states
    noise: Noise  # of the remainder
    # weighted squared error at the end, while fitting; deviance: twice its negative log likelihood, with the size of
    # its own noise
    cost: float
    deviance: float
    # linear, sensitivities: at the end; grams: of the sensitivities, under the noise
    linear: LinearisedMotion
    sensitivities: Sensitivities
    grams: GramMatrices
    precision: Array  # (c, c) of the effects' priors
    step: Array  # (c,) to the optimum of the linear model within bounds
    gain: float  # by how much it lowers the cost of the linear model
    converged: bool  # a further step would not lower the cost noticeably
    simulations: int = 1  # of all windows that the fit took
    freedom: float = math.inf  # degrees of freedom of the covariance, where it counts how runs differ

    def selected(self, keep: NDArray[np.bool_]) -> Fit:
        """The same effects beside only some of the windows, by a mask (w,): where a fit to these begins.

        Cost, covariance and step remain those of all windows.
        """
        return replace(
            self,
            starts=self.starts[keep],
            linear=self.linear.selected(keep),
            sensitivities=self.sensitivities.selected(keep),
            grams=self.grams.selected(keep),
        )

    @property
    def free_keys(self) -> tuple[str, ...]:
        """Estimated effects without a prior."""
        return self.keys[: self.free_count]

    def value(self, key: str) -> float:
        """Estimate."""
        return self.ship.get(key)

    def std(self, key: str) -> float:
        """Standard error."""
        index = self.keys.index(key)
        return float(np.sqrt(max(self.covariance[index, index], 0.0)))


@dataclass(frozen=True, kw_only=True, eq=False)
class FitOptions:
    """Options of a fit."""

    noise: Noise | None = None  # first guess; white noise by default
    ar_order: int | None = None  # of the noise's autoregressions, or None to choose it
    steps: int = STEPS  # Gauss-Newton steps, at most
    warm_start: Fit | None = None  # a fit of a similar ship over the same windows; faster, with the same result
    # estimate the noise at the start alone, and evaluate a step with the weights of initial states and random current
    # at its start. The weights depend on the effects, which a step of weighted least squares ignores, so a step may
    # raise the cost with updated weights. Fits that are compared with each other need updated weights, and the noise
    # that they end with.
    fixed_weights: bool = False


def continuing(found: Fit, *, steps: int = STEPS) -> FitOptions:
    """Options of a fit that starts from another one: its noise, its order, its motion."""
    return FitOptions(noise=found.noise, ar_order=found.noise.order, warm_start=found, steps=steps)


def uncertain_keys(ship: ExtendedModel) -> tuple[str, ...]:
    """What has a standard deviation in the vessel file: parameters, and states of water, actuators and sensors."""
    return tuple(key for key, std in _prior_std(ship).items() if std > 0)


def prior_precision(ship: ExtendedModel, keys: tuple[str, ...], *, free: int = 0) -> Array:
    """(c, c) inverse covariance of effects with a standard deviation in the vessel file, zero for others.

    Args:
        free: this many of the first have no prior; that of the others is their marginal one.
    """
    whitening = _prior_whitening(ship, keys, free)
    return np.asarray(whitening.T @ whitening)


def _prior_whitening(ship: ExtendedModel, keys: tuple[str, ...], free: int) -> Array:
    """(c, c) symmetric square root of the inverse prior correlation, times the inverse standard deviations."""
    known = _prior_std(ship)
    std = np.array([0.0] * free + [known.get(key, 0.0) for key in keys[free:]])
    index = np.flatnonzero(std > 0)
    values, vectors = np.linalg.eigh(_prior_correlation(ship, [keys[place] for place in index]))
    root = (vectors / np.sqrt(np.maximum(values, LEAST_CORRELATION_EIGENVALUE))) @ vectors.T
    whitening = np.zeros((len(keys), len(keys)))
    whitening[np.ix_(index, index)] = root / std[index]
    return whitening


def _prior_correlation(ship: ExtendedModel, keys: Sequence[str]) -> Array:
    """(c, c) of effects: that of parameters is in the vessel file, others are independent."""
    names = [f"theta:{name}" for name in ship.model.names]
    correlation = np.eye(len(keys))
    rows = [row for row, key in enumerate(keys) if key in names]
    places = [names.index(keys[row]) for row in rows]
    correlation[np.ix_(rows, rows)] = ship.model.parameter_correlation_matrix[np.ix_(places, places)]
    return correlation


def _prior_std(ship: ExtendedModel) -> dict[str, float]:
    model = ship.model
    parameters = {f"theta:{n}": s for n, s in zip(model.names, model.parameter_std.tolist(), strict=True)}
    return {**parameters, **ship.stated_std}


def step_bounds(ship: ExtendedModel, keys: tuple[str, ...], shortest_s: float = 0.0) -> Array:
    """(2, c) least and greatest steps to the bounds of effects; infinite for those without.

    Those of the ship, her sensors and the sea are `ExtendedModel.bounds`. Times cannot be below zero, what holds the
    ship at high speed cannot push her (`resisting`), and samples show no faster oscillation than
    `Windows.shortest_period_s`. What lies outside may stay there, and comes no further.

    Args:
        ship: the model before the step.
        shortest_s: that period [s].
    """
    now = np.array([ship.get(key) for key in keys])
    bounds = np.array([ship.bounds(key) for key in keys]).reshape(-1, 2).T - now
    parameters = dict(zip(ship.model.names, ship.model.parameters.tolist(), strict=True))
    signs = resisting(ship.model)
    for place, key in enumerate(keys):
        if key.startswith(POSITIVE):
            bounds[0, place] = LEAST_EFFECT - now[place]
        if key == "roll:period":
            bounds[0, place] = shortest_s - now[place]
        sign = signs.get(key.removeprefix("theta:"), 0.0)
        if sign:
            bounds[int(sign < 0), place] = -parameters[key.removeprefix("theta:")] - now[place]
    kept = np.array([key.startswith(POSITIVE) or key.removeprefix("theta:") in signs for key in keys], dtype=bool)
    return np.where(kept, bounds, [np.minimum(bounds[0], 0.0), np.maximum(bounds[1], 0.0)])


def best_step(A: Array, score: Array, bounds: Array) -> tuple[Array, float]:
    """(c,) step to the least cost of a linear model within the bounds, and by how much it lowers the cost.

    What leaves its bounds is held there, and the rest is solved again: an active set that only grows.

    Args:
        A: (c, c) information.
        score: (c,).
        bounds: (2, c) least and greatest step allowed.
    """
    step = np.zeros(len(score))
    held = np.zeros(len(score), dtype=bool)
    while len(score):
        free = ~held
        step[held] = np.clip(step, *bounds)[held]
        left = score[free] - A[np.ix_(free, held)] @ step[held]
        step[free] = solution_of(A[np.ix_(free, free)], left)
        outside = free & ((step < bounds[0]) | (step > bounds[1]))
        if not outside.any():
            break
        held |= outside
    return step, float(2.0 * score @ step - step @ A @ step)


def after_step(ship: ExtendedModel, keys: Sequence[str], step: Array) -> dict[str, float]:
    """Effects after a Gauss-Newton step.

    Data determine only the product of a gain and the uncertain thrust parameters, so the cost has a narrow curved
    valley. The products and the gain therefore take linear steps, and the parameters follow from both.
    """
    change = dict(zip(keys, step.tolist(), strict=True))
    after = within_bounds(ship, {key: ship.get(key) + size for key, size in change.items()})
    factors = [key for key in keys if key.split(":")[0] in ("gain", "inertia")]
    if not factors:
        return after
    nudged = {key: ship.get(key) + LITTLE * change[key] for key in factors}
    old, close, new = (term_factors(ship.model, {**ship.effects, **effects}) for effects in ({}, nudged, after))
    for name, value in zip(ship.model.names, ship.model.parameters.tolist(), strict=True):
        key = f"theta:{name}"
        if key in change:
            whole, slope = value + ship.get(key), (close[name] - old[name]) / LITTLE
            after[key] = (whole * (old[name] + slope) + old[name] * change[key]) / new[name] - value
    return after


def within_bounds(ship: ExtendedModel, effects: dict[str, float]) -> dict[str, float]:
    """Times and widths stay positive and change by a limited ratio, but lags and dead times may vanish at once."""
    result = {}
    for key, value in effects.items():
        kind = key.split(":")[0]
        if kind in (*FOLLOWING, "deadband") or key in ("roll:period", "roll:damping"):
            before, ratio = ship.get(key), LARGEST_RATIO
            least = 0.0 if kind in FOLLOWING else before / ratio
            value = min(max(value, least, LEAST_EFFECT), max(before, 1e-3) * ratio)
        elif effect_row(key).neutral == 1.0 and not acts_on(key, TIME):
            value = max(value, min(SMALLEST_FACTOR_CHANGE, effect_row(key).low))
        result[key] = value
    return result


def nearest_possible(ship: ExtendedModel) -> ExtendedModel:
    """The model with its uncertain effects within their bounds, nearest in units of their standard deviations."""
    keys = uncertain_keys(ship)
    precision = prior_precision(ship, keys)
    step, _ = best_step(precision, -precision @ deviations_of(ship, keys), step_bounds(ship, keys))
    return ship.with_effects(after_step(ship, keys, step))


def deviations_of(ship: ExtendedModel, keys: tuple[str, ...]) -> Array:
    """(c,) effects less what the vessel file states of them."""
    return np.array([ship.get(key) - ship.stated.get(key, 0.0) for key in keys])


def within_stated_std(found: Fit) -> bool:
    """Whether all effects with a standard deviation in the vessel file are within it, by Bonferroni's inequality."""
    return not beyond_stated_std(found)


def beyond_stated_std(found: Fit) -> tuple[str, ...]:
    """Effects that are not within their standard deviation in the vessel file, by Bonferroni's inequality."""
    whitening = _prior_whitening(found.ship, found.keys, found.free_count)
    apart = np.abs(whitening @ deviations_of(found.ship, found.keys))
    stated = int((np.diag(whitening) > 0).sum())
    beyond = 2.0 * scipy.special.ndtr(-apart) * max(stated, 1) <= BEYOND_STD_LEVEL
    return tuple(key for key, is_beyond in zip(found.keys, beyond.tolist(), strict=True) if is_beyond)


def profile_cost(found: Fit, noise: Noise) -> float:
    """Twice the negative log likelihood under some noise, minimised over the effects of the linear model."""
    grams = found.grams if noise is found.noise else gram_matrices(found.sensitivities, noise)
    m = marginalised(grams, found.sensitivities, noise)
    now = deviations_of(found.ship, found.keys)
    score = m.s - found.precision @ now
    bounds = step_bounds(found.ship, found.keys, found.linear.motion.windows.shortest_period_s)
    _, best = best_step(m.A + found.precision, score, bounds)
    return float(m.quadratic + now @ found.precision @ now - best)


def log_likelihood_gain(base: Fit, found: Fit) -> float:
    """Likelihood ratio statistic of `found` against `base`, both under the likelier noise of the two."""
    noise = likeliest((base, found)).noise
    return profile_cost(base, noise) - profile_cost(found, noise)


def likeliest(fits: Sequence[Fit]) -> Fit:
    """The fit with the largest likelihood, its own noise counted.

    Its noise is the one to compare fits under. Under the noise of a fit that leaves large errors in some channels and
    small ones in another, that fit would seem to gain.
    """
    return min(fits, key=lambda item: item.deviance)


# How much of the simulation error a slowly varying force that nobody measured would account for.
#
# The force is piecewise linear in time, in every equation of motion. Its size follows from generalised
# cross-validation, so it does not follow the noise.
#
# Source: G. H. Golub, M. Heath and G. Wahba, Technometrics 21 (1979), 215-223.


def unmeasured_force_share(linear: LinearisedMotion, outputs: tuple[str, ...]) -> Array:
    """(n,) share of the root mean square error of every output that the force takes away; 0 for nothing."""
    motion = linear.motion
    shape = (*motion.states.shape[:1], motion.states.shape[1] - 1, motion.states.shape[2])
    basis = linear_basis(shape[1], motion.windows.step_s, FORCE_SPACING_S)
    columns = [OUTPUTS.index(name) for name in outputs]
    found = build_sensitivities(
        linear, [_pushing(axis, row, shape) for axis in columns for row in basis], random_current=False
    )
    size = channel_std(found.error)
    grams = gram_matrices(found, white_noise(np.where(size > 0, size, np.inf)))
    still = np.zeros((shape[0], len(found.values)))
    before, after = (_rms(found, grams, effects)[columns] for effects in (still, _smoothed(found, grams)))
    return np.asarray(np.maximum(1.0 - after / np.where(before > 0, before, 1.0), 0.0))


def _pushing(axis: int, row: Array, shape: tuple[int, ...]) -> Disturbance:
    force = np.zeros(shape)
    force[..., axis] = row
    return Disturbance(force=force, sensor=None)


def _smoothed(found: Sensitivities, grams: GramMatrices) -> Array:
    """(w, c) forces in every window, as strong as generalised cross-validation allows."""
    scale = np.sqrt(np.maximum(np.einsum("wcc->c", grams.XX) / len(grams.XX), 1e-300))
    values, vectors = np.linalg.eigh(grams.XX / np.outer(scale, scale))
    values = np.maximum(values, 0.0)
    along = np.einsum("wcz,wc->wz", vectors, grams.Xe / scale)
    rows = int(np.isfinite(found.error).sum())
    best: tuple[float, float] = (np.inf, 0.0)
    for penalty in FORCE_PENALTIES:
        shrunk = values / (values + penalty)
        explained = (along**2 / (values + penalty) * (2.0 - shrunk)).sum()
        freedom = shrunk.sum() + grams.effect_starts.shape[0] * grams.effect_starts.shape[1]
        left = float((grams.ee.sum() - explained) / max(rows - freedom, 1.0) ** 2)
        best = min(best, (left, penalty))
    return np.asarray(np.einsum("wcz,wz->wc", vectors, along / (values + best[1])) / scale)


def _rms(found: Sensitivities, grams: GramMatrices, effects: Array) -> Array:
    """(4,) root mean square error once the forces and the initial velocities that go with them are taken away."""
    starts = grams.initial_state_steps(effects)
    rest = found.error - np.einsum("wc,cwsn->wsn", effects, found.values)
    rest = rest - np.einsum("wn,nwsk->wsk", starts, found.starts)
    seen = np.isfinite(rest)
    squares = np.where(seen, rest, 0.0) ** 2
    return np.asarray(np.sqrt(squares.sum(axis=(0, 1)) / np.maximum(seen.sum(axis=(0, 1)), 1)))
