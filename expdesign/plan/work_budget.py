"""Work counted instead of timed, so that a search gives up at the same point on every machine."""

from __future__ import annotations

import math

ITERATION_S = 2e-4  # one iteration of the optimiser for each sample of a leg, on a machine of 2020 [s]
SAMPLE_S = 2.5e-3  # one sample of some hundred drawn ships there [s]


class WorkBudget:
    """Counted work of a search, in seconds of a reference machine.

    Attributes:
        spent_s: so far.
        most_s: the budget. Work under way is never stopped; only what comes after it is refused.
    """

    def __init__(self, most_s: float = math.inf) -> None:
        """Begin with nothing spent."""
        self.spent_s, self.most_s = 0.0, most_s

    @property
    def exhausted(self) -> bool:
        """Whether nothing is left."""
        return self.spent_s > self.most_s

    def optimised(self, iterations: int, samples: int) -> None:
        """Count iterations of the optimiser on a leg of some samples."""
        self.spent_s += ITERATION_S * iterations * samples

    def sailed(self, samples: int) -> None:
        """Count samples of drawn trials."""
        self.spent_s += SAMPLE_S * samples
