"""Runs to choose from, what they cost, save and tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class Offer:
    """Runs to choose from.

    Attributes:
        matrices: (q, d, d) information of one whole run, summed over its samples.
        cost_s: (q,) of one whole run.
        saved_s: (q,) time of transit that its way made good saves.
        way_s: most that all runs save together.
        known: (d, d) information without runs.
        fewest, most: (q,) limits on runs.
    """

    matrices: Array
    cost_s: Array
    saved_s: Array
    way_s: float
    known: Array
    fewest: Array
    most: Array

    def __post_init__(self) -> None:
        seal(self, matrices="q d d", cost_s="q", saved_s="q", known="d d", fewest="q", most="q")

    def information(self, runs: Array) -> Array:
        """(d, d) of runs (q,), and what is known."""
        return np.asarray(self.known + np.tensordot(runs, self.matrices, axes=1))

    def total_s(self, runs: Array) -> float:
        """Cost of runs (q,), less what they save."""
        return float(runs @ self.cost_s) - min(float(runs @ self.saved_s), self.way_s)
