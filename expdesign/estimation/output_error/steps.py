"""How much of the search of output error is done, from steps taken and those that its convergence lets expect."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.estimation.tuning import TUNING
from expdesign.progress import Estimated, Progress

ACTIVITY = "fitting simulations to the data"


class Steps:
    """Tells the share done, in samples simulated.

    Args:
        stages: work of a step, and the expected number of steps, of each stage.
        progress: of the search.
    """

    def __init__(self, stages: Sequence[tuple[float, int]], progress: Progress) -> None:
        """Begin before the first stage, with the libraries loaded."""
        self._stages, self._place, self._taken, self._before = list(stages), -1, 0, np.inf
        self._estimated = Estimated(progress, after=TUNING.covariance_steps * stages[-1][0])
        self._estimated.done = TUNING.loading_samples
        self._tell(0.0)

    def begin(self) -> None:
        """The next stage is compiled, and then begun."""
        self._place, self._taken, self._before = self._place + 1, 0, np.inf
        work, expected = self._stages[self._place]
        self._estimated.done += TUNING.compiling_samples
        self._tell(expected * work)

    def insert(self, work: float, expected: int) -> None:
        """Another stage comes before the present one, which is begun again after it."""
        here = self._place + 1
        self._stages[here:here] = [(work, expected), self._stages[self._place]]

    def report(self, excess: float) -> None:
        """A step is to be taken whose expected decrease is so many times the one that ends the stage."""
        work, expected = self._stages[self._place]
        left = float(max(1, expected - self._taken))
        if np.isfinite(self._before) and excess > 0:
            shrinks = np.log(max(self._before / excess, TUNING.slowest_convergence))
            left = min(max(np.log(max(excess, 1.0)) / shrinks, 0.0) + 1.0, 2.0 * expected)
        self._tell(left * work)
        self._before, self._taken = excess, self._taken + 1
        self._estimated.done += work

    def end(self) -> None:
        """All stages are done."""
        self._tell(0.0)

    def _tell(self, left: float) -> None:
        later = self._stages[self._place + 1 :]
        self._estimated.tell(ACTIVITY, left + sum(work * steps + TUNING.compiling_samples for work, steps in later))
