"""Results of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.diagnosis.accuracy import Accuracy, Residuals
from expdesign.diagnosis.data import Windows
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import Vessel

VISIBLE = 0.01  # reduction of an error below which no number is given


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """One number of a finding: its name in results, value, standard error and unit."""

    name: str
    value: float
    std: float
    unit: str
    stated: float | None = None  # in the vessel file; None where that says nothing of it


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorReduction:
    """The share by which the simulated error of one output falls on held-out batches."""

    output: str  # u, v or r
    share: float  # 1 for no error left, 0 for no change, negative for a larger error
    # low, high: 95 % interval
    low: float
    high: float

    @property
    def is_certain(self) -> bool:
        """Whether it is worth a word and its interval excludes zero."""
        return self.share >= VISIBLE and self.low > 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Finding:
    """One cause of the simulation error."""

    cause: str  # name in the catalogue
    estimates: tuple[Estimate, ...]  # its numbers
    p_value: float  # corrected for multiple tests
    # fit_before, fit_after: (n,) simulated fit [%] of held-out batches, without and with it
    fit_before: Array
    fit_after: Array
    error_reductions: tuple[ErrorReduction, ...]  # per output
    gain: float  # mean over outputs [points of fit]; gain_interval: 95 %
    gain_interval: tuple[float, float]
    not_distinguishable_from: tuple[str, ...]  # causes that explain the data as well; alternatives: in words
    would_tell_apart: str | None  # the manoeuvre that distinguishes them best, per minute, or None
    explanation: str  # a sentence or two
    likelihood_gain: float  # twice the log likelihood gained
    keys: tuple[str, ...]  # effects of the extended model, in the order of the estimates
    # where no simulated error of an output falls visibly, the share by which the squared whitened error of predictions
    # of held-out data from one sample to the next falls, if that is certain
    predicted: ErrorReduction | None = None
    alternatives: tuple[str, ...] = ()


@dataclass(frozen=True)
class Lead:
    """A candidate that is not certain."""

    cause: str  # name in the catalogue
    gain: float  # on held-out batches, mean over outputs [points of fit]; gain_interval: 95 %
    gain_interval: tuple[float, float]
    parameters: tuple[str, ...] = ()  # those that it changes, by most standard errors first


@dataclass(frozen=True, kw_only=True, eq=False)
class Unexplained:
    """What remains where a simulation, all findings included, explains little of the data."""

    outputs: tuple[str, ...]
    fit: Array  # (n,) of the simulation [%]
    force_share: Array  # (n,) share of its error that an unmeasured, slowly varying force would take away
    leads: tuple[Lead, ...]  # the best candidates, by gain; unit: what their gains are measured on
    unit: str = "runs"


@dataclass(frozen=True, kw_only=True, eq=False)
class Diagnosis:
    """Findings, and the simulations that they rest on."""

    vessel: Vessel  # the model in use
    extended: Vessel  # the same with all findings
    record: Record  # the data
    windows: Windows  # the data as compared
    unit: str  # what gains are measured on, in words
    # before, after: accuracy of both on all batches, in sample
    before: Accuracy
    after: Accuracy
    # by what the model of all loses on held-out data without each, parameters that are wrong beside causes last; each
    # gain is relative to the model with the causes that were found before, after such parameters
    findings: tuple[Finding, ...]
    verdict: str  # three sentences: what the simulation lacks, how sure that is, what to do
    unexplained: Unexplained | None  # what remains; None where the simulation explains much, or all but the noise
    # simulated_before, simulated_after: (w, s, 4) channels beside `windows.measured`
    simulated_before: Array
    simulated_after: Array
    errors: tuple[Array, ...]  # per finding, (w, s, 4) error of the model with the earlier findings
    residuals: Residuals  # of the model in use
    step_residuals: tuple[Residuals, ...]  # per finding, of the same model as in `errors`
    notes: tuple[str, ...]  # quantities not measured, causes left out or not tested
    screened: tuple[tuple[str, float], ...]  # (cause, smallest adjusted p-value) of the round that found nothing more

    @property
    def is_extended(self) -> bool:
        """Whether anything was changed in the model in use, by findings or within its standard deviations."""
        return self.after is not self.before
