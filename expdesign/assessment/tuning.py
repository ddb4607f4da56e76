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
        same_error: share of an error below which a difference of two does not count.
        most_folds: into which runs are divided, to be left out in turn.
        smallest_error, largest_error: over the standard deviation of an output, that count.
        worth_whole: runs so many horizons long are compared with simulations of their whole length too.
        most_by_itself: samples, averaged, up to which output error is tried without being asked for.
        unstable_growth: growth of an error over a run above which the ship is unstable.
        cancelling_share: share of the squared misfit above which its parts have opposite signs, and their sizes no
            meaning.
        method_work, prediction_work, decomposition_work: how long one method takes, predictions of what is left out and
            the decomposition, for the progress told.
        most_deliveries: how often data are delivered with new dead times and lags, at most.
        settled_change: change of such a time, in its standard deviations, below which it is not delivered again.
        time_change: of a time, for derivatives, in samples.
    """

    lags: int = 60
    slow_s: float = 20.0
    ahead_s: float = 30.0
    same_error: float = 0.02
    most_folds: int = 4
    smallest_error: float = 1e-4
    largest_error: float = 1.0
    worth_whole: float = 1.5
    most_by_itself: int = 20_000
    unstable_growth: float = 5.0
    cancelling_share: float = 1.1
    method_work: float = 0.9
    prediction_work: float = 0.9
    decomposition_work: float = 0.1
    most_deliveries: int = 5
    settled_change: float = 0.5
    time_change: float = 0.1


TUNING = Tuning()
