"""How much of measured accelerations a model structure explains: plain least squares on smoothed velocities.

Accelerations are derivatives of quadratics fitted to the velocities over a sliding window; inputs and wind are smoothed
alike. This says what a structure can reach at best on real data, before any question of noise in regressors: too short
a window leaves noise in the accelerations, too long a one takes the manoeuvre out of them.

Source: A. Savitzky and M. J. E. Golay, Analytical Chemistry 36 (1964), 1627-1639.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import savgol_filter

from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError, NoAnswer
from expdesign.estimation.tables import AIR, heading_of, inputs_of, model_for, signal_table
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import NUMPY, VesselModel


def explained_accelerations(
    model: VesselModel, record: Record, *, window_s: float, wind: bool = False
) -> dict[str, float]:
    """R^2 of the accelerations of each output, pooled over all runs, by least squares.

    Args:
        model: gives the terms; its parameters do not matter.
        record: the data.
        window_s: length of the sliding window [s], at least three samples.
        wind: use measured wind; otherwise terms of air velocities are left out.

    Returns:
        Output -> R^2, nan where the acceleration is constant.

    Raises:
        InputError: a window too short, or wind is asked for and not measured.
        NoAnswer: no run is longer than the window.
    """
    driven = model_for(model, record)
    parts = [_smoothed(driven, batch, window_s, wind) for batch in record.batches]
    parts = [(table, rates) for table, rates in parts if len(rates)]
    if not parts:
        raise NoAnswer(f"no run is longer than the window of {window_s:g} s")
    return {output: _explained(driven, output, parts, wind) for output in driven.outputs}


Part = tuple[dict[str, Array], Array]
"""Signals, each (k,), and accelerations (k, 3), of the samples with a whole window around them."""


def _smoothed(model: VesselModel, batch: Batch, window_s: float, wind: bool) -> Part:
    half = round(window_s / batch.sample_time_s / 2)
    width = 2 * half + 1
    if half < 1:
        raise InputError(f"window_s is {window_s:g}, expected three samples of {batch.sample_time_s:g} s or more")
    if wind and batch.wind is None:
        raise InputError(f"{batch.name} has no measured wind")
    if len(batch) < width:
        return {}, np.zeros((0, 3))

    def smooth(values: Array, derivative: int = 0) -> Array:
        filtered = savgol_filter(values, width, 2, deriv=derivative, delta=batch.sample_time_s, axis=0)
        return np.asarray(filtered[half : len(batch) - half])

    velocity = smooth(batch.velocity)
    air = smooth(batch.wind) if wind and batch.wind is not None else velocity[:, :2]
    heading = heading_of(batch)[half : len(batch) - half]
    return signal_table(model, velocity, air, heading, smooth(inputs_of(model, batch))), smooth(batch.velocity, 1)


def _explained(model: VesselModel, output: str, parts: list[Part], wind: bool) -> float:
    used = [
        expression
        for term, expression in zip(model.terms, model.expressions, strict=True)
        if term.equation == output and (wind or not set(AIR) & set(expression.signals))
    ]
    y = np.concatenate([rates[:, OUTPUTS.index(output)] for _, rates in parts])
    columns = [
        np.concatenate([np.broadcast_to(item.evaluate(table, NUMPY), len(rates)) for table, rates in parts])
        for item in used
    ]
    Phi = np.stack(columns, axis=1)
    size = np.linalg.norm(Phi, axis=0)
    Phi = Phi / np.where(size > 0, size, 1.0)
    residuals = y - Phi @ np.linalg.lstsq(Phi, y, rcond=None)[0]
    return float(1.0 - residuals.var() / y.var()) if y.var() > 0 else float("nan")
