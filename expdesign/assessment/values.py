"""Estimates with everything that speaks for and against them."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.assessment.residuals import OneStep
from expdesign.assessment.runs import RunCheck
from expdesign.estimation.excitation import Breach
from expdesign.estimation.methods import Method
from expdesign.estimation.values import Estimate
from expdesign.signals import Record
from expdesign.vessel import VesselModel


@dataclass(frozen=True, kw_only=True, eq=False)
class Assessed:
    """One method's estimate.

    Attributes:
        method: how it was made.
        estimate: parameters with their uncertainty.
        start: what the first instruments were simulated with, "nominal" or "ls"; "" for least squares.
        model: the vessel's model with the estimate.
        runs: every run simulated with it, first those of the estimation, then those kept apart.
        one_step: its residuals.
        breaches: where the data break the experiment condition, for the signals this method uses.
    """

    method: Method
    estimate: Estimate
    start: str
    model: VesselModel
    runs: tuple[RunCheck, ...]
    one_step: OneStep
    breaches: tuple[Breach, ...]

    @property
    def stable(self) -> bool:
        """Whether the model can be simulated over every run."""
        return all(run.simulated is not None for run in self.runs)


@dataclass(frozen=True, kw_only=True, eq=False)
class Assessment:
    """All methods on the same data.

    Attributes:
        record: what the estimates come from.
        tests: runs kept apart; none when empty.
        methods: one entry for each method that gave an estimate, in the order asked for.
        left_out: one sentence for each method tried on our own account that gave none.
        chosen: index of the method whose estimate goes into the vessel file.
        mean: how the mean was subtracted from instruments.
        fixed: parameters held at the vessel file's values.
    """

    record: Record
    tests: Record
    methods: tuple[Assessed, ...]
    left_out: tuple[str, ...]
    chosen: int
    mean: str
    fixed: tuple[str, ...]

    @property
    def best(self) -> Assessed:
        """The estimate that goes into the vessel file."""
        return self.methods[self.chosen]
