"""The work of a search: counted, limited, what is expected to be left of it, and what it leaves untried."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Any

from expdesign.diagnosis.fit import Fit
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.select.tuning import TUNING
from expdesign.progress import Estimated, silent


@dataclass(kw_only=True)
class Work:
    """Simulations of all data in fits of candidates, spent by the search that owns it.

    Attributes:
        simulations: so far.
        untried: what was left out once the limit was reached, in order.
        rounds_left: expected after the present one.
        progress: of the search and of what follows, in simulations of all data without roll.
    """

    simulations: int = 0
    untried: list[str] = field(default_factory=list)
    rounds_left: int = TUNING.first_rounds
    progress: Estimated = field(default_factory=lambda: Estimated(silent))
    _fits: tuple[Fit | None, dict[Hashable, Any]] = field(default_factory=lambda: (None, {}), repr=False)

    def fits_beside(self, base: Fit) -> dict[Hashable, Any]:
        """Fits of candidates beside this one, for another round from it; those beside others are forgotten."""
        if self._fits[0] is not base:
            self._fits = base, {}
        return self._fits[1]

    def spend(self, simulations: int, each: float = 1.0) -> None:
        """Count some, each with the work of so many without roll."""
        self.simulations += simulations
        self.progress.done += simulations * each

    def tell(self, activity: str, left: float) -> None:
        """What is done next, and the work left in this round."""
        self.progress.tell(activity, left + self.rounds_left * TUNING.round_work)

    def allows(self, what: str) -> bool:
        """Whether the limit allows more; otherwise that is noted as untried."""
        if self.simulations < TUNING.most_simulations:
            return True
        if what not in self.untried:
            self.untried.append(what)
        return False


def work_of_simulation(ship: ExtendedModel) -> float:
    """Of all data, beside one without roll."""
    return 1.0 if ship.roll is None else TUNING.roll_work
