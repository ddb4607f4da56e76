"""Progress of long work."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from itertools import accumulate, pairwise

Progress = Callable[[str, float], None]
"""Is called with the present activity and the completed share of the work, 0 to 1; nan where nobody knows what is left,
as a limit or the next result decides."""


def silent(activity: str, share: float) -> None:
    """Ignore progress."""


def within(progress: Progress, low: float, high: float) -> Progress:
    """Progress of a part of the work that begins at share `low` and ends at share `high`."""
    return lambda activity, share: progress(activity, low + (high - low) * share)


def of_part(progress: Progress, part: str) -> Progress:
    """Progress whose activities say which part of the work they belong to."""
    return lambda activity, share: progress(f"{part}: {activity}", share)


def ending(progress: Progress, *, most_s: float, refusal: Callable[[str], Exception]) -> Progress:
    """Progress of work that is given up where more time than this has passed by the clock.

    Args:
        most_s: time from now; work under way ends its present step first.
        refusal: raised then, made of what was to be done next.
    """
    ends_s = time.monotonic() + most_s

    def report(activity: str, share: float) -> None:
        if time.monotonic() > ends_s:
            raise refusal(activity)
        progress(f"{activity} (given up after {most_s / 60.0:g} min)", share)

    return report


def in_phases(progress: Progress, *work: float) -> tuple[Progress, ...]:
    """Progress of parts of the work, one after the other, that take times in these ratios."""
    ends = [end / sum(work) for end in accumulate(work, initial=0.0)]
    return tuple(within(progress, low, high) for low, high in pairwise(ends))


class Estimated:
    """Progress of work whose amount becomes known as it goes: the share done of what is done and what is left.

    Args:
        progress: of all the work.
        after: work that follows what is told, in the unit in which all work is counted.
    """

    def __init__(self, progress: Progress, *, after: float = 0.0) -> None:
        """Begin with nothing done."""
        self._progress, self.after, self.done = never_falling(progress), after, 0.0

    def tell(self, activity: str, left: float) -> None:
        """What is done next, and how much work is expected to be left."""
        self._progress(activity, self.done / (self.done + left + self.after or 1.0))

    def part(self, work: float, left: float) -> Progress:
        """Progress of the next part of the work, with so much left after it."""
        began = self.done

        def report(activity: str, share: float) -> None:
            if not math.isnan(share):
                self.done = began + work * share
            self.tell(activity, began + work - self.done + left)

        return report


def never_falling(progress: Progress) -> Progress:
    """Progress that stays where it is while work is repeated."""
    most = 0.0

    def report(activity: str, share: float) -> None:
        nonlocal most
        most = max(most, share)  # nan compares as nothing
        progress(activity, share if math.isnan(share) else most)

    return report
