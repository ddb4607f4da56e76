"""Window lengths for unstable models: errors of initial states must not grow too much in a window."""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.data import Windows, channel_std, cut_windows
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion.linearisation import linearise, start_responses
from expdesign.diagnosis.motion.simulation import simulate_from_measured
from expdesign.diagnosis.motion.tuning import TUNING
from expdesign.signals import Record


def stable_windows(ship: ExtendedModel, record: Record) -> Windows:
    """Windows of a record: as long as possible, but at least a few, and short enough for an unstable model."""
    windows = longest_windows(ship, record)
    for _ in range(TUNING.window_rounds):
        stable_s = _stable_time(ship, windows)
        if stable_s >= windows.steps * windows.step_s:
            break
        windows = cut_windows(ship.model, record, longest_s=stable_s)
    return windows


def longest_windows(ship: ExtendedModel, record: Record) -> Windows:
    """Windows of a record for a stable model."""
    windows = cut_windows(ship.model, record)
    if len(windows.batch) >= TUNING.fewest_windows:
        return windows
    total_s = sum(len(batch) * batch.sample_time_s for batch in record.batches)
    return cut_windows(ship.model, record, longest_s=total_s / TUNING.fewest_windows)


def _stable_time(ship: ExtendedModel, windows: Windows) -> float:
    """Time until an error of an initial velocity, in measured standard deviations, grows too much [s]."""
    motion = simulate_from_measured(ship, windows)
    if motion.diverged:
        return windows.steps * windows.step_s / 2
    size = channel_std(windows.measured[..., :3])
    scale = np.where(size > 0, size, 1.0)
    by_start = start_responses(motion, linearise(motion).transition)
    answers = np.moveaxis(by_start[..., :3], 0, -1) * scale / scale[:, None]
    growth = np.linalg.norm(answers, axis=(2, 3)) / np.sqrt(3.0)
    unstable = (growth > TUNING.largest_growth).any(axis=0)
    if not unstable.any():
        return windows.steps * windows.step_s
    return max(int(np.argmax(unstable)), TUNING.fewest_window_samples) * windows.sample_s
