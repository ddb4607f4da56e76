"""Noise of the remainder, estimated together with a fit: autoregressions and a random current."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis.data import Noise, channel_std, fit_ar_noise, white_noise
from expdesign.diagnosis.fit.fit import best_step
from expdesign.diagnosis.fit.gram_matrices import (
    GramMatrices,
    MarginalInformation,
    current_precision,
    gram_matrices,
    marginalised,
    marginalised_under,
)
from expdesign.diagnosis.fit.linear_model import Sensitivities
from expdesign.diagnosis.fit.tuning import TUNING
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Prior:
    """Prior knowledge of the estimated effects.

    Attributes:
        precision: (c, c) of the Gaussian priors around zero change; zero for effects without a prior.
        now: (c,) the effects that the sensitivities are taken at, less what the vessel file states of them.
        bounds: (2, c) least and greatest steps from there.
    """

    precision: Array
    now: Array
    bounds: Array


def estimate_noise(
    found: Sensitivities, prior: Prior, noise: Noise | None, grams: GramMatrices | None = None, *, ar_order: int | None
) -> Noise:
    """Noise of the remainder after the best linear response.

    Args:
        found: sensitivities and error.
        prior: of the estimated effects.
        noise: a first guess; without one the estimate takes a few passes from white noise.
        grams: of the sensitivities under the first guess, if they are known.
        ar_order: of the autoregressions, or None to choose it.
    """
    passes = 1
    if noise is None:
        size = channel_std(found.error)
        noise, passes, grams = white_noise(np.where(size > 0, size, np.inf)), TUNING.first_noise_passes, None
    for number in range(passes):
        grams = gram_matrices(found, noise) if grams is None or number else grams
        noise = _estimate_random_current(grams, found, noise, prior)
        shares = TUNING.shares_beside_current if noise.current_std_mps else TUNING.shares
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
        for std_mps in TUNING.current_stds_mps
        for time_s in (TUNING.current_times_s if std_mps else TUNING.current_times_s[:1])
    ]
    yield still, marginalised(grams, found, still)
    at_once = max(1, TUNING.numbers_at_once // (len(grams.XX) * (2 * found.knot_count) ** 2))
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
