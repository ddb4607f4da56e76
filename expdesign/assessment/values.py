"""Options and results of an estimation, and what the vessel file knew before the data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from expdesign.assessment.held_out import HeldOut, reason
from expdesign.assessment.misfit import Limits, OneStep, RunCheck
from expdesign.assessment.prior import NONE, PARAMETER_STD, PRIORS
from expdesign.assessment.unstated import Answer, Current
from expdesign.errors import InputError, NoAnswer, UnknownName
from expdesign.estimation.disturbance import MeasuredWind, Moments
from expdesign.estimation.excitation import ALL, SAMPLES, Breach
from expdesign.estimation.instrumental import STARTS
from expdesign.estimation.methods import Method
from expdesign.estimation.regression import MEANS
from expdesign.estimation.replay import STEERED, Integration
from expdesign.estimation.solve import BLOCKS
from expdesign.estimation.values import Estimate
from expdesign.signals import Record
from expdesign.simulation.run import SUBSTEPS
from expdesign.vessel import Missed, VesselModel


@dataclass(frozen=True, kw_only=True, eq=False)
class Disturbances:
    """Current and wind: as estimated, and as measured."""

    current: Moments | None  # its moments, or None where the method does not estimate them
    combined: tuple[Moments, ...]  # of current and wind together, for equations in which they cannot be distinguished
    wind: MeasuredWind | None  # the measured one, or None where none is used


@dataclass(frozen=True, kw_only=True, eq=False)
class Assessed:
    """One method's estimate."""

    method: Method  # how it was made
    horizon_s: float | None  # of output error [s], None for whole runs
    estimate: Estimate  # parameters with their uncertainty
    start: str  # parameters of the first instruments, "nominal" or "ls"; "" for least squares
    model: VesselModel  # the vessel's model with the estimate
    runs: tuple[RunCheck, ...]  # every run simulated with it, first the estimation runs, then the test runs
    one_step: OneStep  # its residuals
    breaches: tuple[Breach, ...]  # where the data break the excitation condition, for the signals this method uses
    disturbances: Disturbances  # current and wind, from the nuisance parameters and from the measured wind
    std: Mapping[str, float]  # as of `Vessel.std`, with those of dead times and lags that were estimated

    @property
    def label(self) -> str:
        """Name of the method, with the horizon of output error."""
        return HeldOut.label_of(self.method, self.horizon_s)

    @property
    def uses_instruments(self) -> bool:
        """Whether the method is one of instrumental variables."""
        return self.method.solver == "iv"

    @property
    def stable(self) -> bool:
        """Whether the model can be simulated over every run."""
        return all(run.simulated is not None for run in self.runs)


@dataclass(frozen=True, kw_only=True, eq=False)
class Assessment:
    """All methods on the same data."""

    record: Record  # estimation data
    tests: Record  # test runs, not used for estimation; may be empty
    methods: tuple[Assessed, ...]  # one entry for each method that gave an estimate, in the order of the options
    # methods, or horizons of output error, that gave no estimate, and why
    failures: tuple[tuple[str, InputError | NoAnswer], ...]
    notes: tuple[str, ...]  # on methods that were not tried, and on what could not be checked
    asked: tuple[str, ...]  # names of the methods asked for; none where they are the program's choice
    # errors of predictions that decide which estimate is chosen; empty where nothing was to be decided
    compared: tuple[HeldOut, ...]
    chosen: int  # index of the method whose estimate goes into the vessel file
    mean: str  # how the mean was subtracted from instruments
    fixed: tuple[str, ...]  # parameters held at the vessel file's values
    motion: str  # "continuous" or "euler", as in `EstimateOptions`
    prior: str  # "parameter_std" where estimates are joined with what the vessel file knew before, else "none"
    limits: tuple[Limits, ...]  # decomposed misfit of every run of the chosen estimate
    current: Current | None = None  # that nobody stated
    answers: tuple[Answer, ...] = ()  # inputs that the ship answers later or sooner than is stated

    @property
    def left_out(self) -> tuple[str, ...]:
        """One sentence for each method that gave no estimate, or was not tried."""
        return (*(f"No estimate by {label}: {error}." for label, error in self.failures), *self.notes)

    @property
    def missed(self) -> Missed | None:
        """What the chosen method misses of runs that it has not seen, where that was looked at."""
        return next((item.missed for item in self.compared if item.label == self.best.label), None)

    @property
    def why(self) -> str:
        """Why the chosen estimate is chosen, a sentence; "" where there was nothing to choose from."""
        why = reason(self.compared, self.best.label, self.asked)
        return f"{self.best.label} {why}." if why else ""

    @property
    def best(self) -> Assessed:
        """The estimate that goes into the vessel file."""
        return self.methods[self.chosen]

    @property
    def best_first(self) -> tuple[Assessed, ...]:
        """All methods, that of the vessel file first: a narrow page cuts off the last columns of a table."""
        return (self.best, *(item for item in self.methods if item is not self.best))


AUTO = "auto"
CONTINUOUS, EULER = "continuous", "euler"
MOTIONS = (CONTINUOUS, EULER)
HELD_OUT, INSTRUMENTS = "held-out", "instruments"
CHOICES = (HELD_OUT, INSTRUMENTS)


@dataclass(frozen=True, kw_only=True)
class EstimateOptions:
    """Options of an estimation."""

    methods: tuple[str, ...] = ()  # names in `estimation.methods.METHODS`; empty for those that suit the data
    fixed: tuple[str, ...] = ()  # parameters held at the vessel's values
    mean: str = "complete"  # subtracted from the instruments: "none", "batch" or "complete"
    blocks: str = "one"  # of instruments: "one" for all runs, or one for each "batch" (4.45)
    # of the first instruments: "nominal" for the vessel's values, "ls" for the least-squares estimate, "auto" for the
    # vessel's values unless they are all zero or fail
    start: str = AUTO
    # "continuous" for parameters of the continuous-time motion, which plans use; "euler" for those of Euler's map at
    # the sample time
    motion: str = CONTINUOUS
    horizon_s: float | None = None  # simulation horizon of output error [s], None for whole runs
    constant: bool = False  # whether output error gives every run a constant force of its own
    steered: str = AUTO  # what becomes of samples marked as steered, one of `estimation.replay.STEERED`
    samples: str = ALL  # "all", or "equation-wise": for each equation those that meet the excitation condition
    # strongest current, and wind where it is not measured, that velocities inside an absolute value must exceed in
    # equation-wise samples, beside the sensors' noise [m/s]
    offset_mps: float = 0.0
    prior: str = NONE  # "parameter_std" to join estimates with what the vessel file knew before, or "none"
    # of the best estimate: "held-out" for that which predicts best, see `held_out`; "instruments" for the first stable
    # one with instruments, and without output error unless that is among the methods
    choice: str = HELD_OUT

    def __post_init__(self) -> None:
        for what, value, known in (
            ("instrument mean", self.mean, MEANS),
            ("instrument blocks", self.blocks, BLOCKS),
            ("start", self.start, (AUTO, *STARTS)),
            ("motion", self.motion, MOTIONS),
            ("treatment of steered samples", self.steered, STEERED),
            ("choice of samples", self.samples, SAMPLES),
            ("prior", self.prior, PRIORS),
            ("choice", self.choice, CHOICES),
        ):
            if value not in known:
                raise UnknownName(what, value, known=known)
        if self.prior == PARAMETER_STD and self.motion != CONTINUOUS:
            raise InputError(
                f"--prior {PARAMETER_STD} is of the continuous motion, expected it without --motion {EULER}"
            )
        if not 0 <= self.offset_mps < float("inf"):
            raise InputError(f"offset is {self.offset_mps:g} m/s, expected 0 or more")
        if self.horizon_s is not None and not 0 < self.horizon_s < float("inf"):
            raise InputError(f"horizon is {self.horizon_s:g} s, expected more than 0")

    @property
    def integration(self) -> Integration:
        """Integrator of the models."""
        return Integration("rk4", SUBSTEPS) if self.motion == CONTINUOUS else Integration()

    @property
    def quadrature(self) -> str:
        """Quadrature of the regressors over a sample interval."""
        return "trapezoid" if self.motion == CONTINUOUS else "euler"
