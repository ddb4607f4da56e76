"""How well a model simulates the measured inputs: fit, error, bias, and growth with the horizon."""

from __future__ import annotations

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.data import Windows, cut_windows, spread
from expdesign.diagnosis.model.extended import Extended
from expdesign.diagnosis.model.motion import Linear, Motion, simulate_windows
from expdesign.diagnosis.model.sensors import behind
from expdesign.diagnosis.values import Accuracy
from expdesign.estimation.fit import fit_percent
from expdesign.signals import Record
from expdesign.values import Array

FIRST = 5
HORIZONS_S = (2.0, 5.0, 10.0, 30.0, 60.0, 120.0, 300.0)
WHOLE_S = 1e9
MOST_SPREADS = 10.0
"""Errors beyond so many standard deviations of what is measured count as that large: the simulation is lost, and by how
much says nothing."""


def first_states(windows: Windows, states: int = 3) -> Array:
    """(w, n) state at the beginning of every window: a straight line through its first samples, undisturbed roll."""
    count = min(FIRST, windows.measured.shape[1])
    time = np.arange(count, dtype=float)
    result = np.zeros((len(windows.measured), states))
    for index, rows in enumerate(windows.measured[:, :count, :3]):
        for channel in range(3):
            seen = np.isfinite(rows[:, channel])
            if seen.sum() >= 3:
                result[index, channel] = np.polyfit(time[seen], rows[seen, channel], 1)[1]
            elif seen.any():
                result[index, channel] = rows[seen, channel].mean()
    return result


def simulate_from_first(ship: Extended, windows: Windows, near: Linear | None = None) -> Motion:
    """Every window from its own first measured state; a linearised motion nearby makes it quicker."""
    start = first_states(windows, ship.states)
    start[:, :3] = behind(ship, start[:, :3])
    for axis, name in enumerate(OUTPUTS):
        if name not in ship.model.outputs:
            start[:, axis] = 0.0
    return simulate_windows(ship, windows, start, near=near)


def accuracy(ship: Extended, record: Record) -> Accuracy:
    """Accuracy of a model on all batches."""
    outputs = ship.model.outputs
    columns = [OUTPUTS.index(name) for name in outputs]
    windows = cut_windows(ship.model, record, longest_s=WHOLE_S)
    motion = simulate_from_first(ship, windows)
    measured = windows.measured[..., columns]
    error = bounded(motion.error[..., columns], measured)
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
    lost, varied = sums(error, measured)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(100 * (1 - np.sqrt(lost.sum(axis=0) / varied.sum(axis=0))))


def sums(error: Array, measured: Array) -> tuple[Array, Array]:
    """(w, n) squared error and squared deviation from the mean of every window."""
    seen = np.isfinite(measured)
    mean = np.where(seen, measured, 0).sum(axis=1, keepdims=True) / np.maximum(seen.sum(axis=1, keepdims=True), 1)
    lost = np.where(seen, bounded(error, measured) ** 2, 0.0).sum(axis=1)
    return lost, np.where(seen, (measured - mean) ** 2, 0.0).sum(axis=1)


def bounded(error: Array, measured: Array) -> Array:
    """Errors (w, s, n) no larger than `MOST_SPREADS` standard deviations of what is measured."""
    size = spread(measured)
    most = np.where(size > 0, MOST_SPREADS * size, np.inf)
    return np.asarray(np.clip(error, -most, most))


def _growth(ship: Extended, record: Record, columns: list[int]) -> tuple[Array, Array]:
    shortest = min(len(batch) * batch.sample_time_s for batch in record.batches)
    horizons, rows = [], []
    for horizon in HORIZONS_S:
        if horizon < 4 * record.batches[0].sample_time_s or horizon > shortest:
            continue
        windows = cut_windows(ship.model, record, longest_s=horizon)
        if windows.measured.shape[1] < 4:
            continue
        error = bounded(simulate_from_first(ship, windows).error[..., columns], windows.measured[..., columns])
        last = error[:, -max(1, error.shape[1] // 5) :]
        rows.append(np.sqrt(np.nanmean(last**2, axis=(0, 1))))
        horizons.append(horizon)
    return np.array(horizons), np.array(rows).reshape(len(horizons), len(columns))
