"""Information of a trial about effects, beside everything that a diagnosis estimates anyway."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis.accuracy import squared_sums
from expdesign.diagnosis.data import Noise, Windows
from expdesign.diagnosis.fit import (
    BLOCK_S,
    Fit,
    build_sensitivities,
    effect_disturbances,
    gram_matrices,
    marginalised,
    validation_units,
)
from expdesign.diagnosis.motion import Disturbance, LinearisedMotion, Motion
from expdesign.diagnosis.select import candidate_disturbances
from expdesign.foresight.effects import Direction, HiddenEffect, Size, disturbance_at
from expdesign.foresight.trial import Background
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
    """
    return unit_information(linear, keys, disturbances, noise, linear.motion.windows.batch)


def unit_information(
    linear: LinearisedMotion, keys: Sequence[str], disturbances: Sequence[Disturbance], noise: Noise, unit: Array
) -> Array:
    """Information of every unit of the data, given the unit (w,) that each window belongs to."""
    own = effect_disturbances(linear, keys)
    found = build_sensitivities(linear, [*own, *disturbances], random_current=noise.current_std_mps > 0)
    grams = gram_matrices(found, noise)
    rows = []
    for name in np.unique(unit):
        rows.append(marginalised(grams.selected(unit == name), found, noise).A)
    return np.stack(rows)


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedUnits:
    """How simulated errors of u, v, r over k units of the data change with c nuisance effects and m others."""

    # (k, c + m, c + m) of each unit, whitened; predicted: of its u, v, r alone, whose predictions are compared, in so
    # many blocks of time that tell as much
    information: Array
    predicted: Array
    blocks: int
    samples: Array  # (k,) measured numbers of u, v, r
    # (k, 3, c + m, c + m) inner products of the sensitivities; with_error: (n, k, 3, c + m) with the errors of n
    # records where nothing is hidden; squared_error, squared_deviation: (n, k, 3)
    products: Array
    with_error: Array
    squared_error: Array
    squared_deviation: Array
    precision: Array  # (c, c) prior precision of the nuisance


def simulated_units(
    base: Fit, windows: Windows, again: Sequence[Motion], disturbances: Sequence[Disturbance]
) -> SimulatedUnits:
    """Simulated data of a trial with nothing hidden, in the units by which a diagnosis cross-validates.

    Args:
        base: the fit to a record.
        again: other records of the same runs, simulated by the model that they come from.
    """
    unit = validation_units(windows)
    own = effect_disturbances(base.linear, base.keys)
    found = build_sensitivities(base.linear, [*own, *disturbances], random_current=False).values[..., :3]
    member = (unit == np.unique(unit)[:, None]).astype(float)
    measured = np.stack([item.windows.measured[..., :3] for item in again])
    error = np.stack([item.error[..., :3] for item in again])
    values = np.where(np.isfinite(windows.measured[..., :3]), found, 0.0)
    lost, deviation = (np.stack(part) for part in zip(*map(squared_sums, error, measured), strict=True))
    without_heading = replace(base.noise, std=np.append(base.noise.std[:3], np.inf))
    known = (base.linear, base.keys, disturbances)
    return SimulatedUnits(
        information=unit_information(*known, base.noise, unit),
        predicted=unit_information(*known, without_heading, unit),
        blocks=max(1, math.ceil(windows.duration_s / len(member) / BLOCK_S)),
        samples=member @ np.isfinite(windows.measured[..., :3]).sum(axis=(1, 2)),
        products=np.stack([np.einsum("cwso,dwso->ocd", *[values[:, row > 0]] * 2, optimize=True) for row in member]),
        with_error=np.einsum("kw,cwso,nwso->nkoc", member, values, np.nan_to_num(error), optimize=True),
        squared_error=member @ lost,
        squared_deviation=member @ deviation,
        precision=base.precision,
    )


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


@dataclass(frozen=True, kw_only=True, eq=False)
class JointInformation:
    """Information of a trial about hidden effects at their sizes, then about all tested candidates."""

    whole: Array  # (c + m, c + m) nuisance first; beside: (m, m) beside nuisance
    beside: Array
    # directions, sizes: of the effects' own rows
    directions: tuple[Direction, ...]
    sizes: tuple[float, ...]
    blocks: tuple[NDArray[np.int64], ...]  # per effect, its rows among the m; rows: per tested candidate
    rows: tuple[NDArray[np.int64], ...]


def joint_information(
    known: Background, hidden: Sequence[HiddenEffect], sizes: Sequence[tuple[Size, ...]]
) -> JointInformation:
    """Information of a trial about hidden effects and tested candidates.

    Args:
        known: the trial with nothing hidden.
        sizes: of the directions of each; where one is not finite, the effect is taken as it is.
    """
    base = known.base
    directions = tuple(item for effect in hidden for item in effect.directions)
    values = tuple(size.value if math.isfinite(size.value) else 1.0 for own in sizes for size in own)
    ends = np.cumsum([len(own) for own in sizes])
    disturbances = [disturbance_at(base.linear, item, size) for item, size in zip(directions, values, strict=True)]
    rows = _candidate_rows(known, disturbances)
    whole = batch_information(base.linear, base.keys, disturbances, base.noise).sum(axis=0)
    return JointInformation(
        whole=whole,
        beside=beside_nuisance(whole, base.precision),
        directions=directions,
        sizes=values,
        blocks=tuple(np.arange(end - len(own), end) for end, own in zip(ends.tolist(), sizes, strict=True)),
        rows=tuple(rows),
    )


def _candidate_rows(known: Background, disturbances: list[Disturbance]) -> list[NDArray[np.int64]]:
    """Per tested candidate, its rows; appends the disturbances of all of them, shared ones once."""
    shared: dict[object, int] = {}
    rows = []
    for test in known.tests:
        index = []
        for tag, disturbance in candidate_disturbances(known.base.linear, test.candidate):
            if tag not in shared:
                shared[tag] = len(disturbances)
                disturbances.append(disturbance())
            index.append(shared[tag])
        rows.append(np.array(index))
    return rows
