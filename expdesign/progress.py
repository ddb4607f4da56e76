"""Progress of long work."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Is called with the present activity and the completed share of the work, 0 to 1."""


def silent(activity: str, share: float) -> None:
    """Ignore progress."""


def within(progress: Progress, low: float, high: float) -> Progress:
    """Progress of a part of the work that begins at share `low` and ends at share `high`."""
    return lambda activity, share: progress(activity, low + (high - low) * share)
