"""A yaw model learnt from a reference, and whether the reference was informative enough for it, in plain words."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.errors import NotInformative
from expdesign.monitoring.yaw.estimate import (
    YawEstimate,
    estimate_yaw,
    fit_of,
    halves_differ,
    signs,
    simulate_yaw,
    start_values,
)
from expdesign.monitoring.yaw.model import INPUTS, MOMENT, SAMPLES, YawData, YawModel, measures_moment, voyages
from expdesign.monitoring.yaw.ship import YawShip
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import VesselModel

# Yaw models by instrumental variables: noise of the inputs leaves no bias. The thesis only suggests this.
#
# Samples of even and of odd number have noise of their own and the same motion. The model driven by the one half gives
# the error, driven by the other the sensitivities that the error has to be orthogonal to, and the other way round:
#
#     sum Z_odd' (r_even - r_hat_even(theta)) + sum Z_even' (r_odd - r_hat_odd(theta)) = 0
#
# Output error has the same sensitivities on both sides, so that their noise correlates with the error's. What is given
# up is half of the samples on either side: the spread is larger. The noise must be without memory from sample to
# sample.
#
# Source: T. Söderström, Errors-in-Variables Methods in System Identification (2018), chapter 6; J. Linder and M.
# Enqvist (2015) for instruments in ship models; A. Savitzky and M. J. E. Golay, Analytical Chemistry 36 (1964),
# 1627-1639.

STEPS = 15
LARGEST_STEP = 0.5  # of a parameter in a step, as a share of its start
SMALLEST_STEP = 1e-4  # below which there is no further one, as a share of the start
SETTLED = 0.02  # largest last step, in standard errors
# length of the polynomials that smooth each half, so that products of noisy signals have little noise inside their
# absolute values; less than five samples of a half are not smoothed [s]
SMOOTHING_S = 2.0
BLOCK_S = 20.0  # over which errors may hang together [s]


def split(data: YawData) -> tuple[YawData, YawData]:
    """The voyages by their even samples alone, and by their odd ones, each smoothed and filled in by cubic polynomials.

    Args:
        data: of n voyages, with noise that is independent from sample to sample.

    Returns:
        Both at the same times, those of the data but the first and the last ones.
    """
    window = 2 * int(SMOOTHING_S / (4.0 * data.sample_time_s)) + 1
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
) -> YawEstimate:
    """Parameters whose errors are orthogonal to sensitivities with other noise, by Newton's method.

    Args:
        data: of n voyages.
        start: value of every parameter [SI] from which output error begins; instruments begin from its estimate.
        groups: as in `estimate_yaw`.

    Returns:
        The estimate of each group; nan where the steps do not settle, for instance for lack of information. Standard
        errors are robust to errors that are correlated over `BLOCK_S`.
    """
    owner = np.arange(len(data.r)) if groups is None else groups
    pool = np.eye(owner.max() + 1)[:, owner]
    scale = np.array([abs(start[name]) for name in model.parameters])
    x = np.array(estimate_yaw(model, data, start, groups=groups).parameters / scale)
    low, high = signs(model)
    halves, last = split(data), np.full(x.shape, np.inf)
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


STRETCHES = 2  # in a part that is simulated in one go
FEWEST_PARTS = 4
EQUAL_FIT = 5.0  # halves are fitted alike within so much [%]
MAIN = 0.3  # weight from which a parameter is named in a direction


def learnt_ship(
    model: YawModel, vessel: VesselModel, record: Record, *, stretch_s: float
) -> tuple[YawShip, tuple[str, ...]]:
    """The yaw model of the reference by output error, and notes on it.

    Args:
        vessel: model of the ship, for the moment of the drives where none is measured.
        record: the reference, or its beginning.
        stretch_s: length of a stretch of the watch [s].

    Raises:
        InputError: a signal that the model needs is not measured.
        NotInformative: too few data, or the ship never turns.
    """
    length_s, finest_s = STRETCHES * stretch_s, stretch_s / SAMPLES
    data, _ = voyages(model, vessel, record, length_s=length_s, finest_s=finest_s)
    if len(data.r) < FEWEST_PARTS:
        raise NotInformative(
            f"the first piece of the reference has {len(data.r)} parts of {length_s:g} s without a gap, expected at "
            f"least {FEWEST_PARTS} to learn a yaw model from"
        )
    start = start_values(model, data)
    half = np.arange(len(data.r)) * 2 // len(data.r)
    whole = estimate_yaw(model, data, start, groups=np.zeros_like(half))
    values = {name: float(whole.of(name)[0]) for name in model.parameters}
    halves = estimate_yaw(model, data, values, groups=half)
    fine, _ = voyages(model, vessel, record, length_s=length_s, finest_s=finest_s / 2.0)
    crossed = estimate_yaw_by_instruments(model, fine, values, groups=np.zeros_like(half))
    minutes = data.r.size * data.sample_time_s / 60.0
    notes = (
        _moment_in_words(record),
        f"The yaw model {model.name}, learnt by output error from {minutes:.0f} min of the reference, simulates the "
        f"yaw rate with a fit of {whole.fit[0]:.1f} %: {_listed(whole)}.",
        _crossed_in_words(crossed),
        _determined_in_words(model, data, whole),
        halves_in_words(halves),
    )
    return YawShip(model=model, vessel=vessel, parameters=values), notes


def _moment_in_words(record: Record) -> str:
    if measures_moment(record):
        return f"The yaw moment of the drives is {MOMENT}; a wrong scale of it scales every parameter alike."
    return (
        f"No {MOMENT} is measured: the moment of the drives is what the vessel file's terms of r give, per moment of "
        "inertia, so that I_r is 1 where the file is right, and all parameters are counted in it."
    )


def _listed(found: YawEstimate) -> str:
    pairs = zip(found.model.parameters, found.parameters[0], found.std[0], strict=True)
    return ", ".join(f"{name} {value:.3g} ± {abs(100.0 * std / value):.2g} %" for name, value, std in pairs)


def _crossed_in_words(found: YawEstimate) -> str:
    if not np.isfinite(found.parameters).all():
        return "By instruments, too little is determined of it: the estimate does not settle."
    return (
        f"By instruments, which noise of the inputs does not bias if it is independent from sample to sample: "
        f"{_listed(found)}."
    )


def _determined_in_words(model: YawModel, data: YawData, found: YawEstimate) -> str:
    """Rank test: combinations of parameters that are determined better than to their own size."""
    values = found.parameters[0]
    rates, slopes = simulate_yaw(model, data, values)
    columns = (slopes * np.abs(values)).reshape(-1, len(values))
    noise = float(np.sqrt(((data.r - rates) ** 2).mean()))
    _, size, directions = np.linalg.svd(columns / max(noise, 1e-12), full_matrices=False)
    determined = size > 1.0
    if determined.all():
        return f"The reference determines all {len(values)} parameters, each combination better than to its own size."
    weak = np.abs(directions[~determined]).max(axis=0) > MAIN
    names = ", ".join(name for name, here in zip(model.parameters, weak, strict=True) if here)
    return (
        f"The reference determines {int(determined.sum())} of {len(values)} combinations of the parameters better than "
        f"to their own size; it does not determine {names}."
    )


def halves_in_words(halves: YawEstimate) -> str:
    """Whether two halves of a voyage give the same parameters: the alarm of data that are not informative enough."""
    one, other = (
        YawEstimate(model=halves.model, parameters=halves.parameters[part], std=halves.std[part], fit=halves.fit[part])
        for part in (slice(0, 1), slice(1, 2))
    )
    apart = halves_differ(one, other)[0]
    fits = f"{one.fit[0]:.1f} and {other.fit[0]:.1f} %"
    if not apart.any():
        return f"Both halves of the reference give these parameters within a factor of three, with fits of {fits}."
    names = ", ".join(name for name, here in zip(halves.model.parameters, apart, strict=True) if here)
    if abs(one.fit[0] - other.fit[0]) > EQUAL_FIT:
        return f"Halves of the reference differ in {names} by more than a factor of three, and in their fit: {fits}."
    return (
        f"Not informative enough: halves of the reference give {names} that differ by more than a factor of three or "
        f"in sign, at equal fit ({fits}). Take a longer reference, or one with more turns, for these."
    )
