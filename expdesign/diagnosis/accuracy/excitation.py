"""Whether data are sufficient for a diagnosis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.accuracy.tuning import TUNING
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import simulate_from_measured
from expdesign.errors import NotInformative
from expdesign.values import Array

PER_SECOND_DIFFERENCE = np.sqrt(6.0)
"""Standard deviation of second differences of white noise of unit variance."""


def check_excitation(ship: ExtendedModel, windows: Windows) -> None:
    """Refuse data that are too short, do not measure an output, or whose inputs move the ship too little.

    Raises:
        NotInformative: naming what is missing.
    """
    samples = int(np.isfinite(windows.measured[..., :3]).any(axis=2).sum())
    if samples < TUNING.fewest_samples:
        seconds = samples * windows.sample_s
        raise NotInformative(
            f"the data are too short for a diagnosis: {samples} samples of {windows.sample_s:g} s ({seconds:.0f} s), "
            f"expected {TUNING.fewest_samples} or more"
        )
    for name in ship.model.outputs:
        if not np.isfinite(windows.measured[..., OUTPUTS.index(name)]).any():
            raise NotInformative(
                f"the data cannot support a diagnosis: {name} is not measured; expected it, or a pose to derive it from"
            )
    still = constant_inputs(ship, windows)
    if len(still) == len(ship.model.inputs):
        raise NotInformative(
            f"the data cannot support a diagnosis: no input changes ({', '.join(still)}), so a steady run is all there "
            f"is; expected runs in which {', '.join(still)} vary",
            parameters=still,
        )
    _check_answer(ship, windows)


def constant_inputs(ship: ExtendedModel, windows: Windows) -> tuple[str, ...]:
    """Inputs that never change."""
    rows = np.concatenate(windows.batch_inputs)
    size = TUNING.constant_range * (1.0 + np.abs(rows).max(axis=0))
    return tuple(name for name, span, least in zip(ship.model.inputs, np.ptp(rows, axis=0), size, strict=True)
                 if span <= least)  # fmt: skip


def _check_answer(ship: ExtendedModel, windows: Windows) -> None:
    """Refuse inputs whose simulated effect on the motion is smaller than the noise."""
    held = tuple(np.broadcast_to(rows.mean(axis=0), rows.shape) for rows in windows.batch_inputs)
    moved, steady = (
        simulate_from_measured(ship, data).predicted[..., :3] for data in (windows, replace(windows, batch_inputs=held))
    )
    columns = [OUTPUTS.index(name) for name in ship.model.outputs]
    measured = windows.measured[..., columns]
    answer = np.where(np.isfinite(measured), (moved - steady)[..., columns], 0.0)
    size = np.sqrt((answer**2).sum(axis=(0, 1)) / np.maximum(np.isfinite(measured).sum(axis=(0, 1)), 1))
    noise = white_noise_std(measured)
    if (size < TUNING.least_response * noise).all():
        rows = np.concatenate(windows.batch_inputs)
        spans = ", ".join(
            f"{name} by {span:.2g}" for name, span in zip(ship.model.inputs, np.ptp(rows, axis=0).tolist(), strict=True)
        )
        raise NotInformative(
            f"the data cannot support a diagnosis: the inputs change so little ({spans}) that what the model makes of "
            f"it is less than half of the noise in every output; expected runs with larger changes",
            parameters=ship.model.inputs,
        )


def white_noise_std(measured: Array) -> Array:
    """(n,) standard deviation of white noise in (w, s, n), from second differences, which include some motion."""
    second = np.diff(measured, 2, axis=1)
    seen = np.isfinite(second)
    mean = np.where(seen, second, 0.0) ** 2
    return np.asarray(np.sqrt(mean.sum(axis=(0, 1)) / np.maximum(seen.sum(axis=(0, 1)), 1)) / PER_SECOND_DIFFERENCE)
