"""The tuning constants of the assessment of estimates, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        lags: longest lag of the autocorrelation, in samples.
        slow_s: periods longer than this [s], or than 40 samples, count as slow.
        ahead_s: prediction horizon from measured states [s].
        unstable_growth: growth of an error over a run above which the ship is unstable.
        cancelling_share: share of the squared misfit above which its parts nearly cancel, so that their sizes have no
            meaning.
        method_work, decomposition_work: how long one method takes to how long the decomposition does, for the progress
            told.
        most_deliveries: how often data are delivered with new dead times and lags, at most.
        settled_change: change of such a time, in its standard deviations, below which it is not delivered again.
        time_change: of a time, for derivatives, in samples.
    """

    lags: int = 60
    slow_s: float = 20.0
    ahead_s: float = 30.0
    unstable_growth: float = 5.0
    cancelling_share: float = 2.0
    method_work: float = 0.9
    decomposition_work: float = 0.1
    most_deliveries: int = 5
    settled_change: float = 0.5
    time_change: float = 0.1


TUNING = Tuning()
