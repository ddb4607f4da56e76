"""Estimates with their diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from expdesign.assessment.held_out import HeldOut, reason
from expdesign.assessment.limits import Limits
from expdesign.assessment.residuals import OneStep
from expdesign.assessment.runs import RunCheck
from expdesign.errors import InputError, NoAnswer
from expdesign.estimation.disturbance import MeasuredWind, Moments
from expdesign.estimation.excitation import Breach
from expdesign.estimation.methods import Method
from expdesign.estimation.values import Estimate
from expdesign.signals import Record
from expdesign.vessel import VesselModel

INSTRUMENTAL = "iv"
"""How the names of methods with instruments begin."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Disturbances:
    """Current and wind: as estimated, and as measured.

    Attributes:
        current: its moments, or None where the method does not estimate them.
        combined: of current and wind together, for equations in which they cannot be distinguished.
        wind: the measured one, or None where none is used.
    """

    current: Moments | None
    combined: tuple[Moments, ...]
    wind: MeasuredWind | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Assessed:
    """One method's estimate.

    Attributes:
        method: how it was made.
        horizon_s: of output error [s], None for whole runs.
        estimate: parameters with their uncertainty.
        start: parameters of the first instruments, "nominal" or "ls"; "" for least squares.
        model: the vessel's model with the estimate.
        runs: every run simulated with it, first the estimation runs, then the test runs.
        one_step: its residuals.
        breaches: where the data break the excitation condition, for the signals this method uses.
        disturbances: current and wind, from the nuisance parameters and from the measured wind.
        std: as of `Vessel.std`, with those of dead times and lags that were estimated.
    """

    method: Method
    horizon_s: float | None
    estimate: Estimate
    start: str
    model: VesselModel
    runs: tuple[RunCheck, ...]
    one_step: OneStep
    breaches: tuple[Breach, ...]
    disturbances: Disturbances
    std: Mapping[str, float]

    @property
    def label(self) -> str:
        """Name of the method, with the horizon of output error."""
        return HeldOut.label_of(self.method, self.horizon_s)

    @property
    def uses_instruments(self) -> bool:
        """Whether the method is one of instrumental variables."""
        return self.method.name.startswith(INSTRUMENTAL)

    @property
    def stable(self) -> bool:
        """Whether the model can be simulated over every run."""
        return all(run.simulated is not None for run in self.runs)


@dataclass(frozen=True, kw_only=True, eq=False)
class Assessment:
    """All methods on the same data.

    Attributes:
        record: estimation data.
        tests: test runs, not used for estimation; may be empty.
        methods: one entry for each method that gave an estimate, in the order of the options.
        failures: methods, or horizons of output error, that gave no estimate, and why.
        notes: on methods that were not tried.
        asked: names of the methods asked for; none where they are the program's choice.
        compared: errors of predictions that decide which estimate is chosen; empty where nothing was to be decided.
        chosen: index of the method whose estimate goes into the vessel file.
        mean: how the mean was subtracted from instruments.
        fixed: parameters held at the vessel file's values.
        motion: "continuous" or "euler", as in `EstimateOptions`.
        prior: "parameter_std" where estimates are joined with what the vessel file knew before, else "none".
        limits: decomposed misfit of every run of the chosen estimate.
    """

    record: Record
    tests: Record
    methods: tuple[Assessed, ...]
    failures: tuple[tuple[str, InputError | NoAnswer], ...]
    notes: tuple[str, ...]
    asked: tuple[str, ...]
    compared: tuple[HeldOut, ...]
    chosen: int
    mean: str
    fixed: tuple[str, ...]
    motion: str
    prior: str
    limits: tuple[Limits, ...]

    @property
    def left_out(self) -> tuple[str, ...]:
        """One sentence for each method that gave no estimate, or was not tried."""
        return (*(f"No estimate by {label}: {error}." for label, error in self.failures), *self.notes)

    @property
    def why(self) -> str:
        """Why the chosen estimate is chosen, a sentence; "" where there was nothing to choose from."""
        why = reason(self.compared, self.best.label, self.asked)
        return f"{self.best.label} {why}." if why else ""

    @property
    def best(self) -> Assessed:
        """The estimate that goes into the vessel file."""
        return self.methods[self.chosen]
