"""Information of a trial about effects, beside everything that a diagnosis estimates anyway."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.diagnosis.data import Noise
from expdesign.diagnosis.fit import build_sensitivities, effect_disturbances, gram_matrices, marginalised
from expdesign.diagnosis.motion import Disturbance, LinearisedMotion
from expdesign.values import Array


def batch_information(
    linear: LinearisedMotion, keys: Sequence[str], disturbances: Sequence[Disturbance], noise: Noise
) -> Array:
    """(b, c + m, c + m) information of every batch about the c nuisance effects, then about m disturbances.

    Initial states are projected out and the random current is integrated out, as in every fit of a diagnosis.

    Args:
        linear: the linearised motion of all batches.
        keys: c effects that are estimated anyway.
        disturbances: m effects as they are.
        noise: of the remainder.
    """
    own = effect_disturbances(linear, keys)
    found = build_sensitivities(linear, [*own, *disturbances], random_current=noise.current_std_mps > 0)
    grams = gram_matrices(found, noise)
    batch = linear.motion.windows.batch
    rows = []
    for name in np.unique(batch):
        kept = batch == name
        part = replace(
            grams,
            XX=grams.XX[kept],
            Xe=grams.Xe[kept],
            ee=grams.ee[kept],
            effect_starts=grams.effect_starts[kept],
            error_starts=grams.error_starts[kept],
        )
        rows.append(marginalised(part, found, noise).A)
    return np.stack(rows)


def allowed_by_prior(whole: Array, precision: Array, least: float) -> bool:
    """Whether data without end reach a noncentrality if nuisance is known, and never if it has its prior.

    Args:
        whole: (c + m, c + m) information of a large multiple of the data, about nuisance and m effects.
        precision: (c, c) prior precision of the nuisance.
        least: noncentrality that is needed.
    """
    c = len(precision)
    alone, beside = (np.linalg.eigvalsh(item)[0] for item in (whole[c:, c:], beside_nuisance(whole, precision)))
    return bool(beside < least <= alone)


def beside_nuisance(whole: Array, precision: Array) -> Array:
    """(..., m, m) what is left of the information about m effects once c others are estimated too.

    Args:
        whole: (..., c + m, c + m).
        precision: (c, c) prior precision of the others.
    """
    c = len(precision)
    if not c:
        return whole
    own, cross = whole[..., :c, :c] + precision, whole[..., :c, c:]
    size = np.sqrt(np.maximum(np.diagonal(own, axis1=-2, axis2=-1), 1e-300))  # parameters differ by many digits
    scaled = own / (size[..., :, None] * size[..., None, :])
    solved = np.linalg.pinv(scaled, rcond=1e-13, hermitian=True) @ (cross / size[..., None])
    return np.asarray(whole[..., c:, c:] - np.swapaxes(cross / size[..., None], -1, -2) @ solved)
