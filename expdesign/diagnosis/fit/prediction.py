"""How well models predict held-out data from one sample to the next, given all before: held-out likelihoods.

Simulations of whole runs add up slow errors, of the model's structure or of weather, and hide small effects that act at
once, such as a dead time. The whitened error, less what initial velocities and the random current explain, does not:
its squares are those of predictions one sample ahead. They are nearly independent, so that blocks of them give the
standard error of a gain even where there are few runs. Blocks count alike, however rough the water was: each by the
logarithm of its error.

Source: L. Ljung, System Identification, 2nd ed. (1999), sections 3.2 and 16.6, for predictions and cross-validation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.data import Noise, Windows
from expdesign.diagnosis.fit.gram_matrices import (
    GramMatrices,
    current_precision,
    gram_matrices,
    start_columns,
    whitened_error,
)
from expdesign.diagnosis.fit.held_out import HeldOut
from expdesign.diagnosis.fit.linear_model import Sensitivities, build_sensitivities
from expdesign.diagnosis.fit.tuning import TUNING
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import linearise, simulate_from_measured
from expdesign.values import Array


def prediction_gain(
    before: HeldOut, after: HeldOut, windows: Windows, noise: Noise
) -> tuple[float, tuple[float, float]]:
    """Share of the squared error of held-out predictions that a model takes away, and its 95 % interval over blocks.

    Args:
        before: the model without it, fitted without each of the units that it is held out of; after: with it.
        windows: all data.
        noise: that both are whitened by.
    """
    if not before.models or not after.models:
        return np.nan, (np.nan, np.nan)
    lost, left = (np.concatenate([_squares(*one, windows, noise) for one in held.models]) for held in (before, after))
    if lost.shape != left.shape or len(lost) < 2:
        return np.nan, (np.nan, np.nan)
    with np.errstate(invalid="ignore"):
        ratios = np.log(left / lost)  # nan where both models run away
    middle, error = ratios.mean(), 1.96 * ratios.std(ddof=1) / np.sqrt(len(ratios))
    share, most, least = (1.0 - np.exp([middle, middle - error, middle + error])).tolist()
    return share, (least, most)


def _current(grams: GramMatrices, found: Sensitivities, noise: Noise) -> Array:
    """(w, z) likeliest random current at its knots."""
    prior = current_precision(found, noise)[0]
    return np.asarray(np.linalg.solve(grams.XX + prior, grams.Xe[..., None])[..., 0])


def _squares(held_out: NDArray[np.bool_], ship: ExtendedModel | None, windows: Windows, noise: Noise) -> Array:
    """(blocks,) squared whitened error of u, v, r in some windows, summed over blocks of time; infinite if lost."""
    if ship is None:
        return np.zeros(0)
    motion = simulate_from_measured(ship, windows.selected(held_out))
    size = max(1, round(TUNING.block_s / windows.sample_s))
    if motion.diverged:
        return np.full(1, np.inf)
    moving = noise.current_std_mps > 0 and windows.has_heading
    found = build_sensitivities(linearise(motion), [], random_current=moving)
    grams = gram_matrices(found, noise)
    current = _current(grams, found, noise) if moving else grams.Xe
    by_current = np.einsum("wc,cwsn->wsn", current, found.values)
    by_start = np.einsum("wn,nwsk->wsk", grams.start_steps(current), start_columns(found, noise))
    whole = whitened_error(found.error - by_current - by_start, noise)
    errors, seen = (part[..., : len(OUTPUTS)] for part in whole)
    count = -(-errors.shape[1] // size)
    sums = [(part**2).sum(axis=(1, 2)) for part in np.array_split(errors, count, axis=1)]
    measured = [part.any(axis=(1, 2)) for part in np.array_split(seen, count, axis=1)]
    return np.concatenate(sums)[np.concatenate(measured)]
