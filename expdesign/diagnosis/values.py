"""Results of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.diagnosis.accuracy import Accuracy, Residuals
from expdesign.diagnosis.data import Windows
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import Vessel

VISIBLE = 0.01
"""Reduction of an error below which no number is given."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """One number of a finding: its name in results, value, standard error and unit."""

    name: str
    value: float
    std: float
    unit: str


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorReduction:
    """The share by which the simulated error of one output falls on held-out batches.

    Attributes:
        output: u, v or r.
        share: 1 for no error left, 0 for no change, negative for a larger error.
        low, high: 95 % interval, bootstrap over batches.
    """

    output: str
    share: float
    low: float
    high: float

    @property
    def is_certain(self) -> bool:
        """Whether it is worth a word and its interval excludes zero."""
        return self.share >= VISIBLE and self.low > 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Finding:
    """One cause of the simulation error.

    Attributes:
        cause: name in the catalogue.
        estimates: its numbers.
        p_value: corrected for multiple tests.
        fit_before, fit_after: (n,) simulated fit [%] of held-out batches, without and with it.
        error_reductions: per output.
        gain: mean over outputs of the difference; gain_interval: 95 %, bootstrap over batches.
        not_distinguishable_from: causes that explain the data as well; alternatives: in words.
        would_tell_apart: the manoeuvre that distinguishes them best, per minute, or None.
        explanation: a sentence or two.
        likelihood_gain: twice the log likelihood gained.
        keys: effects of the extended model, in the order of the estimates.
        predicted: where no simulated error falls visibly, the share by which the squared whitened error of predictions
            of held-out data from one sample to the next falls, if that is certain.
    """

    cause: str
    estimates: tuple[Estimate, ...]
    p_value: float
    fit_before: Array
    fit_after: Array
    error_reductions: tuple[ErrorReduction, ...]
    gain: float
    gain_interval: tuple[float, float]
    not_distinguishable_from: tuple[str, ...]
    would_tell_apart: str | None
    explanation: str
    likelihood_gain: float
    keys: tuple[str, ...]
    predicted: ErrorReduction | None = None
    alternatives: tuple[str, ...] = ()


@dataclass(frozen=True)
class Lead:
    """A candidate that is not certain.

    Attributes:
        cause: name in the catalogue.
        gain: on held-out batches, mean over outputs [points of fit]; gain_interval: 95 %, bootstrap over batches.
        parameters: those that it changes, by most standard errors first.
    """

    cause: str
    gain: float
    gain_interval: tuple[float, float]
    parameters: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Unexplained:
    """What remains where a simulation, all findings included, explains little of the data.

    Attributes:
        fit: (n,) of the simulation [%].
        force_share: (n,) share of its error that an unmeasured, slowly varying force would take away.
        leads: the best candidates, by gain; unit: what their gains are measured on.
    """

    outputs: tuple[str, ...]
    fit: Array
    force_share: Array
    leads: tuple[Lead, ...]
    unit: str = "runs"


@dataclass(frozen=True, kw_only=True, eq=False)
class Diagnosis:
    """Findings, and the simulations that they rest on.

    Attributes:
        vessel: the model in use.
        extended: the same with all findings.
        record: the data.
        windows: the data as compared.
        unit: what gains are measured on, in words.
        before, after: accuracy of both on all batches, in sample.
        findings: by what the model of all loses on held-out data without each; each gain is relative to the model with
            the causes that were found before.
        verdict: three sentences: what the simulation lacks, how sure that is, what to do.
        unexplained: what remains; None where the simulation explains much, or all but the noise.
        simulated_before, simulated_after: (w, s, 4) channels beside `windows.measured`.
        errors: per finding, (w, s, 4) error of the model with the earlier findings.
        residuals: of the model in use.
        step_residuals: per finding, of the same model as in `errors`.
        notes: quantities not measured, causes left out or not tested.
        screened: (cause, smallest adjusted p-value) of the round that found nothing more.
    """

    vessel: Vessel
    extended: Vessel
    record: Record
    windows: Windows
    unit: str
    before: Accuracy
    after: Accuracy
    findings: tuple[Finding, ...]
    verdict: str
    unexplained: Unexplained | None
    simulated_before: Array
    simulated_after: Array
    errors: tuple[Array, ...]
    residuals: Residuals
    step_residuals: tuple[Residuals, ...]
    notes: tuple[str, ...]
    screened: tuple[tuple[str, float], ...]
