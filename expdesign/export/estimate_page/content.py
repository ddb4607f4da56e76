"""The content of the page."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.assessment import Assessed, Assessment
from expdesign.export.tuning import TUNING
from expdesign.vessel import Vessel


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimateContent:
    """The values that the page shows.

    Attributes:
        vessel: as it was before the estimation.
        found: the estimates and their assessment.
        command: the command line that reproduces the result.
        version: of the program.
    """

    vessel: Vessel
    found: Assessment
    command: str
    version: str

    @property
    def drawn(self) -> tuple[Assessed, ...]:
        """The methods whose simulations are drawn: the one in the vessel file, then those that simulate most runs."""
        others = [item for item in self.found.methods if item is not self.found.best]
        others.sort(key=lambda item: sum(bool(run.problem) for run in item.runs))
        return (self.found.best, *others)[: TUNING.drawn_methods]
