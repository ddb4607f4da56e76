"""Yaw models by instrumental variables: noise of the inputs leaves no bias. The thesis only suggests this.

Samples of even and of odd number have noise of their own and the same motion. The model driven by the one half gives
the error, driven by the other the sensitivities that the error has to be orthogonal to, and the other way round:

    sum Z_odd' (r_even - r_hat_even(theta)) + sum Z_even' (r_odd - r_hat_odd(theta)) = 0

Output error has the same sensitivities on both sides, so that their noise correlates with the error's. What is given up
is half of the samples on either side: the spread is larger. The noise must be without memory from sample to sample.

Source: T. Söderström, Errors-in-Variables Methods in System Identification (2018), chapter 6; J. Linder and M. Enqvist
(2015) for instruments in ship models; A. Savitzky and M. J. E. Golay, Analytical Chemistry 36 (1964), 1627-1639.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.monitoring.yaw.estimate import YawEstimate, estimate_yaw, fit_of, signs, simulate_yaw
from expdesign.monitoring.yaw.model import INPUTS, YawData, YawModel
from expdesign.values import Array

STEPS = 15
LARGEST_STEP = 0.5
"""Of a parameter in a step, as a share of its start."""
SMALLEST_STEP = 1e-4
"""Below which there is no further one, as a share of the start."""
SETTLED = 0.02
"""Largest last step, in standard errors."""
SMOOTHING_S = 2.0
"""Of each half, so that products of noisy signals have little noise inside their absolute values [s]."""
BLOCK_S = 20.0
"""Over which errors may hang together [s]."""


def split(data: YawData, *, smoothing_s: float = SMOOTHING_S) -> tuple[YawData, YawData]:
    """The voyages by their even samples alone, and by their odd ones, each smoothed and filled in by cubic polynomials.

    Args:
        data: of n voyages, with noise that is independent from sample to sample.
        smoothing_s: length of the polynomials that smooth [s]; less than five samples of a half are not smoothed.

    Returns:
        Both at the same times, those of the data but the first and the last ones.
    """
    window = 2 * int(smoothing_s / (4.0 * data.sample_time_s)) + 1
    halves: tuple[dict[str, Array], dict[str, Array]] = ({}, {})
    for name in ("r", *INPUTS):
        even, odd = (_filled(_smooth(getattr(data, name)[:, first::2], window)) for first in (0, 1))
        count = min(even.shape[1] - 1, odd.shape[1])
        halves[0][name], halves[1][name] = even[:, 1 : 1 + count], odd[:, :count]
    one, other = (YawData(sample_time_s=data.sample_time_s, **half) for half in halves)
    return one, other


def _smooth(values: Array, window: int) -> Array:
    if window < 5 or window > values.shape[1]:
        return values
    return np.asarray(scipy.signal.savgol_filter(values, window, 3, axis=1))


def _filled(x: Array) -> Array:
    """(n, 2 k - 6) samples (n, k) but the first and the last two, with values between them."""
    between = (9.0 * (x[:, 1:-2] + x[:, 2:-1]) - x[:, :-3] - x[:, 3:]) / 16.0
    return np.asarray(np.stack([x[:, 1:-2], between], axis=2).reshape(len(x), -1))


def estimate_yaw_by_instruments(
    model: YawModel,
    data: YawData,
    start: Mapping[str, float],
    *,
    groups: NDArray[np.int_] | None = None,
    smoothing_s: float = SMOOTHING_S,
) -> YawEstimate:
    """Parameters whose errors are orthogonal to sensitivities with other noise, by Newton's method.

    Args:
        model: the structure.
        data: of n voyages.
        start: value of every parameter [SI] from which output error begins; instruments begin from its estimate.
        groups: as in `estimate_yaw`.
        smoothing_s: as in `split`.

    Returns:
        The estimate of each group; nan where the steps do not settle, for instance for lack of information. Standard
        errors are robust to errors that are correlated over `BLOCK_S`.
    """
    owner = np.arange(len(data.r)) if groups is None else groups
    pool = np.eye(owner.max() + 1)[:, owner]
    scale = np.array([abs(start[name]) for name in model.parameters])
    x = np.array(estimate_yaw(model, data, start, groups=groups).parameters / scale)
    low, high = signs(model)
    halves, last = split(data, smoothing_s=smoothing_s), np.full(x.shape, np.inf)
    for _ in range(STEPS):
        simulated = [simulate_yaw(model, half, (x * scale)[owner]) for half in halves]
        errors = [half.r - rates for half, (rates, _) in zip(halves, simulated, strict=True)]
        Z, other = (slopes * scale for _, slopes in simulated)
        across = np.swapaxes(other, 1, 2) @ Z
        G = np.einsum("gn,nij->gij", pool, across + np.swapaxes(across, 1, 2))
        moments = other * errors[0][..., None] + Z * errors[1][..., None]
        inverse = np.linalg.pinv(G)
        last = (inverse @ (pool @ moments.sum(axis=1))[..., None])[..., 0]
        if np.abs(last).max() < SMALLEST_STEP:
            break
        x = np.clip(x + np.clip(last, -LARGEST_STEP, LARGEST_STEP), low, high)
    width = max(1, round(BLOCK_S / halves[0].sample_time_s))
    blocks = np.add.reduceat(moments, np.arange(0, moments.shape[1], width), axis=1)
    spread = inverse @ np.einsum("gn,nbi,nbj->gij", pool, blocks, blocks) @ np.swapaxes(inverse, 1, 2)
    std = np.sqrt(np.einsum("nii->ni", spread))
    settled = (np.abs(last) <= SETTLED * std).all(axis=1)
    return YawEstimate(
        model=model,
        parameters=np.where(settled[:, None], x, np.nan) * scale,
        std=np.where(settled[:, None], std, np.nan) * scale,
        fit=np.where(settled, fit_of(halves[0], errors[0], pool), np.nan),
    )
