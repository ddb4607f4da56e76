"""Tuning constants of the durations that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived. Gaps and eigenvalues are relative: to the degree, to the largest."""

    largest_gap: float = 1e-6  # designs with a wider gap are not returned
    floor_rounding: float = 1e-6  # shortfall of a floor, as a logarithm, that counts as rounding
    # most candidates of a problem that cvxpy solves as stated, and without a working set. With 18 parameters and 3
    # means it takes 0.3 s of 14 candidates, 0.9 s of 300, 12 s of 10,000.
    conic_candidates: int = 300
    singular: float = 1e-13  # eigenvalues below this are rounding
    loosening: float = 1e-9  # share by which limits are loosened where they leave no interior
    one_thread: int = 260_000  # multiplications in a matrix product up to which OpenBLAS uses one thread


TUNING = Tuning()
