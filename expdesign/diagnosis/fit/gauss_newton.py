"""Gauss-Newton fits of effects, uncertain parameters and noise to all windows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis.data import Noise, Windows, channel_std, fit_ar_noise, white_noise
from expdesign.diagnosis.fit.fit import (
    Fit,
    FitOptions,
    after_step,
    best_step,
    deviations_of,
    prior_precision,
    step_bounds,
    uncertain_keys,
)
from expdesign.diagnosis.fit.linear_model import (
    GramMatrices,
    MarginalInformation,
    Sensitivities,
    current_precision,
    gram_matrices,
    information,
    marginalised,
    marginalised_under,
    sensitivities_beside,
    sensitivities_to,
)
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import (
    LinearisedMotion,
    Motion,
    linearise,
    linearised_like,
    simulate_nearby,
    simulate_windows,
)
from expdesign.own_units import covariance_of
from expdesign.values import Array

CONVERGED_BELOW = 0.05  # a fit has converged when the next step would lower the cost by less than this
ALLOWED_RISE = 1.0  # a step may raise the cost by this, because the noise is an estimate
HALVINGS = 5  # of a step that raises the cost
FIRST_NOISE_PASSES = 3  # alternations between effects and noise without a first guess of the noise
# standard deviations of the random current that are tried [m/s]
CURRENT_STDS_MPS = (0.0, 0.005, 0.01, 0.02, 0.035, 0.06, 0.1, 0.2)
CURRENT_TIMES_S = (60.0, 150.0, 400.0, 1000.0)  # correlation times of the random current that are tried [s]
# of differences of white noise, as noise of yaw rates, that are tried; shares_beside_current: beside a random current,
# which leaves some noise at low frequencies, as it is known at its knots alone
SHARES = (0.9, 1.0)
SHARES_BESIDE_CURRENT = (0.95,)
NUMBERS_AT_ONCE = 200_000  # in matrices of random currents that are tried together, at most


@dataclass(frozen=True, kw_only=True, eq=False)
class Prior:
    """Prior knowledge of the estimated effects."""

    precision: Array  # (c, c) of the Gaussian priors around zero change; zero for effects without a prior
    now: Array  # (c,) the effects that the sensitivities are taken at, less what the vessel file states of them
    bounds: Array  # (2, c) least and greatest steps from there


def estimate_noise(
    found: Sensitivities, prior: Prior, noise: Noise | None, grams: GramMatrices | None = None, *, ar_order: int | None
) -> Noise:
    """Noise of the remainder after the best linear response.

    Args:
        found: sensitivities and error.
        noise: a first guess; without one the estimate takes a few passes from white noise.
        grams: of the sensitivities under the first guess, if they are known.
        ar_order: of the autoregressions, or None to choose it.
    """
    passes = 1
    if noise is None:
        size = channel_std(found.error)
        noise, passes, grams = white_noise(np.where(size > 0, size, np.inf)), FIRST_NOISE_PASSES, None
    for number in range(passes):
        grams = gram_matrices(found, noise) if grams is None or number else grams
        noise = _estimate_random_current(grams, found, noise, prior)
        shares = SHARES_BESIDE_CURRENT if noise.current_std_mps else SHARES
        ar_noise = fit_ar_noise(_remainder(grams, found, noise, prior), order=ar_order, shares=shares)
        noise = replace(ar_noise, current_std_mps=noise.current_std_mps, current_time_s=noise.current_time_s)
    return noise


def _estimate_random_current(grams: GramMatrices, found: Sensitivities, noise: Noise, prior: Prior) -> Noise:
    """Standard deviation and correlation time of the random current with the largest restricted likelihood."""
    if grams.XX.shape[1] == found.numbers:
        return noise
    best: tuple[float, Noise] = (np.inf, noise)
    for trial, m in _under_random_currents(grams, found, noise):
        A = m.A + prior.precision
        cost = m.log_det + m.quadratic - best_step(A, m.s - prior.precision @ prior.now, prior.bounds)[1]
        cost += float(np.linalg.slogdet(A + 1e-12 * np.diag(np.diag(A) + 1e-30))[1])
        if cost < best[0] - 1e-9:
            best = (cost, trial)
    return best[1]


def _under_random_currents(
    grams: GramMatrices, found: Sensitivities, noise: Noise
) -> Iterator[tuple[Noise, MarginalInformation]]:
    """The noise with every random current that is tried, first none, and the information under it."""
    still, *others = [
        replace(noise, current_std_mps=std_mps, current_time_s=time_s)
        for std_mps in CURRENT_STDS_MPS
        for time_s in (CURRENT_TIMES_S if std_mps else CURRENT_TIMES_S[:1])
    ]
    yield still, marginalised(grams, found, still)
    at_once = max(1, NUMBERS_AT_ONCE // (len(grams.XX) * (2 * found.knot_count) ** 2))
    for low in range(0, len(others), at_once):
        part = others[low : low + at_once]
        yield from zip(part, marginalised_under(grams, found, part), strict=True)


def _remainder(grams: GramMatrices, found: Sensitivities, noise: Noise, prior: Prior) -> Array:
    """(w, s, 4) error less the best linear response and less a draw of the random current.

    The most likely current would absorb some of the noise. A current drawn from its posterior does not (stochastic EM:
    G. Celeux and J. Diebolt, Computational Statistics Quarterly 2 (1985), 73-82). The draw uses the same random numbers
    every time, so that fits of candidates differ by what they explain and not by chance.
    """
    m = marginalised(grams, found, noise)
    c = found.numbers
    score = m.s - prior.precision @ prior.now
    step, _ = best_step(m.A + prior.precision, score, prior.bounds)
    effects = np.broadcast_to(step, (len(grams.Xe), c))
    if noise.current_std_mps > 0 and found.knot_count:
        ZZ = grams.XX[:, c:, c:] + current_precision(found, noise)[0]
        b = np.linalg.solve(ZZ, (grams.Xe[:, c:] - grams.XX[:, c:, :c] @ step)[..., None])[..., 0]
        normal = np.random.default_rng(0).standard_normal((*b.shape, 1))
        b = b + np.linalg.solve(np.swapaxes(np.linalg.cholesky(ZZ), 1, 2), normal)[..., 0]
        effects = np.concatenate([effects, b], axis=1)
    starts = grams.initial_state_steps(effects)
    explained = np.einsum("wc,cwsn->wsn", effects, found.values[: effects.shape[1]])
    return np.asarray(found.error - explained - np.einsum("wn,nwsk->wsk", starts, found.starts))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Problem:
    """The parts of a fit that all steps share."""

    windows: Windows
    keys: tuple[str, ...]
    free_count: int
    precision: Array
    options: FitOptions


@dataclass(frozen=True, kw_only=True, eq=False)
class _Point:
    """A model simulated and linearised, before its errors are weighted."""

    ship: ExtendedModel
    starts: Array
    linear: LinearisedMotion
    sensitivities: Sensitivities
    grams: GramMatrices | None = None  # under the noise of the fit that it comes from, where they are known


def fit(
    ship: ExtendedModel, windows: Windows, free: tuple[str, ...], *, starts: Array, options: FitOptions | None = None
) -> Fit:
    """Gauss-Newton with step halving; the noise is estimated at the start, after the first step and at the end.

    Args:
        ship: where to start; its effects not in `free` stay, except uncertain parameters.
        free: effects to estimate without a prior.
        starts: (w, n) first guess of the initial states.
        options: how to begin and when to end.

    Raises:
        FloatingPointError: the simulation diverges at the start of the fit.
    """
    options = FitOptions() if options is None else options
    keys = (*free, *(key for key in uncertain_keys(ship) if key not in free))
    precision = prior_precision(ship, keys, free=len(free))
    problem = _Problem(windows=windows, keys=keys, free_count=len(free), precision=precision, options=options)
    starts = _resized(starts, ship.states)
    point = _first_point(problem, ship, starts)
    if point is None:
        raise FloatingPointError
    best, noise_is_fitted = _weighted(problem, point, _noise(problem, point, options.noise)), True
    simulations = 1
    for step in range(options.steps):
        ahead, tries = _line_search(problem, best)
        simulations += tries
        if ahead is None:
            break
        best, noise_is_fitted = ahead, options.fixed_weights
        if best.converged:
            break
        if step == 0 and not noise_is_fitted:
            best, noise_is_fitted = _with_noise_refitted(problem, best), True
    return replace(best if noise_is_fitted else _with_noise_refitted(problem, best), simulations=simulations)


def _first_point(problem: _Problem, ship: ExtendedModel, starts: Array) -> _Point | None:
    """The point where a fit begins: what is known of it from the fit that it continues is not computed again."""
    known = problem.options.warm_start
    near = None if known is None else known.linear
    motion = simulate_windows(ship, problem.windows, starts, warm_start=near)
    linear = None if motion.diverged else linearised_like(motion, near)
    if known is None or linear is None:
        return _linearised(problem, ship, starts, motion)
    grams = None
    if problem.keys == known.keys and motion.ship.effects == known.ship.effects:
        sensitivities = known.sensitivities
        grams = known.grams if problem.options.noise is known.noise else None
    else:
        of_effects = dict(zip(known.keys, known.sensitivities.values, strict=False))
        sensitivities = sensitivities_beside(linear, problem.keys, of_effects, known.sensitivities)
    if sensitivities.unbounded:
        return None
    return _Point(ship=ship, starts=starts, linear=linear, sensitivities=sensitivities, grams=grams)


def _linearised(problem: _Problem, ship: ExtendedModel, starts: Array, motion: Motion) -> _Point | None:
    """None where the motion or its sensitivities diverge."""
    if motion.diverged:
        return None
    linear = linearise(motion)
    sensitivities = sensitivities_to(linear, problem.keys)
    if sensitivities.unbounded:
        return None
    return _Point(ship=ship, starts=starts, linear=linear, sensitivities=sensitivities)


def _weighted(problem: _Problem, point: _Point | Fit, noise: Noise) -> Fit:
    """Cost, covariance and the next step under some noise."""
    grams = gram_matrices(point.sensitivities, noise)
    m = marginalised(grams, point.sensitivities, noise)
    now = deviations_of(point.ship, problem.keys)
    score = m.s - problem.precision @ now
    A = m.A + problem.precision
    step, gain = best_step(A, score, step_bounds(point.ship, problem.keys, problem.windows.shortest_period_s))
    cost = m.quadratic + float(now @ problem.precision @ now)
    return Fit(
        ship=point.ship,
        keys=problem.keys,
        free_count=problem.free_count,
        covariance=covariance_of(A),
        starts=point.starts,
        noise=noise,
        cost=cost,
        deviance=cost + m.log_det + _log_size(point.sensitivities.error, noise),
        linear=point.linear,
        sensitivities=point.sensitivities,
        grams=grams,
        precision=problem.precision,
        step=step,
        gain=gain,
        converged=gain < CONVERGED_BELOW,
    )


def _log_size(error: Array, noise: Noise) -> float:
    """Log determinant of the white noise of all measured samples."""
    counts = np.isfinite(error[:, noise.order :]).sum(axis=(0, 1))
    used = (counts > 0) & np.isfinite(noise.std)
    return float(2.0 * counts[used] @ np.log(noise.std[used]))


def _noise(problem: _Problem, point: _Point | Fit, guess: Noise | None) -> Noise:
    prior = Prior(
        precision=problem.precision,
        now=deviations_of(point.ship, problem.keys),
        bounds=step_bounds(point.ship, problem.keys, problem.windows.shortest_period_s),
    )
    ar_order = 0 if problem.windows.white_noise else problem.options.ar_order
    return estimate_noise(point.sensitivities, prior, guess, point.grams, ar_order=ar_order)


def _with_noise_refitted(problem: _Problem, found: Fit) -> Fit:
    """The same effects with the noise estimated again from their remainder."""
    return replace(_weighted(problem, found, _noise(problem, found, found.noise)), converged=found.converged)


def _line_search(problem: _Problem, best: Fit) -> tuple[Fit | None, int]:
    """The fit after a step, halved where it raises the cost by more than allowed, None if no share of it lowers it.

    A whole step may raise it a little, because weights depend on the effects. Where shares of it do so too, the fit is
    as good as its steps make it. Shares that would hardly lower it are not tried. Beside it the number of simulations.
    """
    held = problem.options.fixed_weights
    effects = np.broadcast_to(best.step, (len(best.starts), len(best.step)))
    start_step = _resized(best.grams.initial_state_steps(effects), best.ship.states)
    for halvings in range(HALVINGS + 1):
        share = 0.5**halvings
        if halvings and share * (2.0 - share) * best.gain < CONVERGED_BELOW:
            return None, halvings
        limit = best.cost + (0.0 if halvings else ALLOWED_RISE)
        ship = best.ship.with_effects(after_step(best.ship, best.keys, share * best.step))
        starts = best.starts + share * start_step
        motion = simulate_nearby(ship, problem.windows, starts, best.linear)
        if (
            motion is None
            or motion.diverged
            or (held and _cost_with_weights_of(problem, best, ship, motion.error) > limit)
        ):
            continue
        point = _linearised(problem, ship, starts, motion)
        ahead = None if point is None else _weighted(problem, point, best.noise)
        if ahead is not None and (held or ahead.cost <= limit):
            return ahead, halvings + 1
    return None, HALVINGS + 1


def _cost_with_weights_of(problem: _Problem, best: Fit, ship: ExtendedModel, error: Array) -> float:
    """Cost of another ship's error with the weights of the best fit so far."""
    quadratic = information(replace(best.sensitivities, error=error), best.noise).quadratic
    now = deviations_of(ship, problem.keys)
    return quadratic + float(now @ problem.precision @ now)


def _resized(starts: Array, n: int) -> Array:
    """(w, n) initial states; roll begins at rest."""
    if starts.shape[1] < n:
        return np.column_stack([starts, np.zeros((len(starts), n - starts.shape[1]))])
    return starts[:, :n]
