"""Tuning constants of reading measured data that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Thresholds that separate data from errors in data."""

    read_bytes: int = 1 << 20  # bytes read at once while a file is checked to be text
    block_rows: int = 4096  # rows held as text at once
    gap_sample_times: float = 1.5  # interval, in sample times, above which a new batch starts


TUNING = Tuning()
