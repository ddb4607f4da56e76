"""Accuracy of a simulation with the measured inputs: fit, error, bias, and growth of the error with the horizon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.accuracy.tuning import TUNING
from expdesign.diagnosis.data import channel_std, cut_windows
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import simulate_from_measured
from expdesign.estimation.fit import fit_percent
from expdesign.signals import Record
from expdesign.values import Array

WHOLE_S = 1e9
"""Length of windows that are whole runs [s]."""


def accuracy(ship: ExtendedModel, record: Record) -> Accuracy:
    """Accuracy of a model on all batches."""
    outputs = ship.model.outputs
    columns = [OUTPUTS.index(name) for name in outputs]
    windows = cut_windows(ship.model, record, longest_s=WHOLE_S)
    motion = simulate_from_measured(ship, windows)
    measured = windows.measured[..., columns]
    error = clipped(motion.error[..., columns], measured)
    flat = error.reshape(-1, len(columns))
    horizons, growth = _growth(ship, record, columns)
    return Accuracy(
        outputs=outputs,
        fit=pooled_fit(error, measured),
        rmse=np.sqrt(np.nanmean(flat**2, axis=0)),
        bias=np.nanmean(flat, axis=0),
        horizons_s=horizons,
        growth=growth,
        per_batch=np.stack([fit_percent(m, m - e) for m, e in zip(measured, error, strict=True)]),
    )


def pooled_fit(error: Array, measured: Array) -> Array:
    """(n,) fit [%] over several windows (w, s, n), each around its own mean."""
    lost, varied = squared_sums(error, measured)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(100 * (1 - np.sqrt(lost.sum(axis=0) / varied.sum(axis=0))))


def squared_sums(error: Array, measured: Array) -> tuple[Array, Array]:
    """(w, n) squared error and squared deviation from the mean of every window."""
    seen = np.isfinite(measured)
    mean = np.where(seen, measured, 0).sum(axis=1, keepdims=True) / np.maximum(seen.sum(axis=1, keepdims=True), 1)
    lost = np.where(seen, clipped(error, measured) ** 2, 0.0).sum(axis=1)
    return lost, np.where(seen, (measured - mean) ** 2, 0.0).sum(axis=1)


def clipped(error: Array, measured: Array) -> Array:
    """Errors (w, s, n) no larger than `Tuning.largest_error` standard deviations of the measurements."""
    size = channel_std(measured)
    most = np.where(size > 0, TUNING.largest_error * size, np.inf)
    return np.asarray(np.clip(error, -most, most))


def _growth(ship: ExtendedModel, record: Record, columns: list[int]) -> tuple[Array, Array]:
    shortest = min(len(batch) * batch.sample_time_s for batch in record.batches)
    horizons, rows = [], []
    for horizon in TUNING.horizons_s:
        if horizon < 4 * record.batches[0].sample_time_s or horizon > shortest:
            continue
        windows = cut_windows(ship.model, record, longest_s=horizon)
        if windows.measured.shape[1] < 4:
            continue
        error = clipped(simulate_from_measured(ship, windows).error[..., columns], windows.measured[..., columns])
        last = error[:, -max(1, error.shape[1] // 5) :]
        rows.append(np.sqrt(np.nanmean(last**2, axis=(0, 1))))
        horizons.append(horizon)
    return np.array(horizons), np.array(rows).reshape(len(horizons), len(columns))


@dataclass(frozen=True, kw_only=True, eq=False)
class Accuracy:
    """Accuracy per output over all batches, each simulated from its first state.

    Attributes:
        outputs: u, v, r, those that the model has.
        fit, rmse, bias: (n,) fit [%], root mean square and mean of measured less simulated.
        horizons_s: (h,) and growth (h, n): root mean square error that long after a start from a measured state.
        per_batch: (b, n) fit of every batch.
    """

    outputs: tuple[str, ...]
    fit: Array
    rmse: Array
    bias: Array
    horizons_s: Array
    growth: Array
    per_batch: Array
