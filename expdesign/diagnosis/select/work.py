"""The work of a search: counted, limited, and what it leaves untried."""

from __future__ import annotations

from dataclasses import dataclass, field

from expdesign.diagnosis.select.tuning import TUNING


@dataclass(kw_only=True)
class Work:
    """Simulations of all data in fits of candidates, spent by the search that owns it.

    Attributes:
        simulations: so far.
        untried: what was left out once the limit was reached, in order.
    """

    simulations: int = 0
    untried: list[str] = field(default_factory=list)

    def spend(self, simulations: int) -> None:
        """Count some."""
        self.simulations += simulations

    def allows(self, what: str) -> bool:
        """Whether the limit allows more; otherwise that is noted as untried."""
        if self.simulations < TUNING.most_simulations:
            return True
        if what not in self.untried:
            self.untried.append(what)
        return False
