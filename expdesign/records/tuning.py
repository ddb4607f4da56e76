"""The tuning constants of reading measured data, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Thresholds that separate data from errors in data.

    Attributes:
        read_bytes: bytes read at once while a file is checked to be text.
        block_rows: rows held as text at once.
        gap_sample_times: interval, in sample times, above which a new batch starts.
    """

    read_bytes: int = 1 << 20
    block_rows: int = 4096
    gap_sample_times: float = 1.5


TUNING = Tuning()
