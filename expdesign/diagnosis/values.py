"""What a diagnosis says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from expdesign.diagnosis.data import Windows
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import Vessel


@dataclass(frozen=True, kw_only=True, eq=False)
class Accuracy:
    """How well a model simulates: per output over all batches, each from its first state.

    Attributes:
        outputs: u, v, r, those that the model has.
        fit, rmse, bias: (n,) fit [%], root mean square and mean of measured less simulated.
        horizons_s: (h,) and growth (h, n): root mean square error that long after a start from a measured state.
        per_batch: (b, n) fit of every batch.
    """

    outputs: tuple[str, ...]
    fit: Array
    rmse: Array
    bias: Array
    horizons_s: Array
    growth: Array
    per_batch: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimated:
    """One number of a finding: its name in results, value, standard error and unit."""

    name: str
    value: float
    std: float
    unit: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Fall:
    """The share by which the simulated error of one output falls on batches that were not used to estimate.

    Attributes:
        output: u, v or r.
        share: 1 for no error left, 0 for no change, negative for a larger error.
        low, high: 95 % interval, bootstrap over batches.
    """

    output: str
    share: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Finding:
    """One thing that the simulation gets wrong.

    Attributes:
        cause: name in the catalogue.
        estimates: its numbers.
        p_value: corrected for all causes tried.
        fit_before, fit_after: (n,) simulated fit [%] of batches that were not used to estimate, without and with it.
        falls: of the error, per output.
        gain: mean over outputs of the difference; gain_interval: 95 %, bootstrap over batches.
        not_distinguishable_from: causes that explain the data as well.
        would_tell_apart: the manoeuvre for which they and this cause disagree most per minute, or None.
        explanation: a sentence or two.
        worth: twice the log likelihood gained.
        keys: effects of the extended model that the estimates are of, in their order.
    """

    cause: str
    estimates: tuple[Estimated, ...]
    p_value: float
    fit_before: Array
    fit_after: Array
    falls: tuple[Fall, ...]
    gain: float
    gain_interval: tuple[float, float]
    not_distinguishable_from: tuple[str, ...]
    would_tell_apart: str | None
    explanation: str
    worth: float
    keys: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Residuals:
    """Stretches, each with what the model lacks there and where that was.

    Attributes:
        outputs: of the model.
        stretch_s: length of a stretch [s].
        lacking: (k, n) measured less simulated acceleration [m/s^2, rad/s^2].
        variables: (k,) means over the stretch by name: u v r as measured, inputs, `u_q v_q` through the air and `depth`
            where they are measured, `heading` (0 to 2 pi), `time` since the data began and number of the `run`.
    """

    outputs: tuple[str, ...]
    stretch_s: float
    lacking: Array
    variables: Mapping[str, Array]


@dataclass(frozen=True, kw_only=True, eq=False)
class Diagnosis:
    """Everything found.

    Attributes:
        vessel: the model in use; extended: with all findings.
        record: the data.
        windows: the data as compared.
        before, after: accuracy of both on all batches, in sample.
        findings: by gain; that of each is against the model with what was found before it, in the order of the search.
        verdict: one sentence.
        simulated_before, simulated_after: (w, s, 4) channels beside `windows.measured`.
        errors: per finding, (w, s, 4) error without it, with what was found before it in the model.
        residuals: of the model in use, within seconds; lacking: per finding likewise, of the same model as in `errors`.
        notes: what a reader must know: what was left out, what could not be tested.
        screened: (cause, p) of the last round, the smallest p per cause, corrected.
    """

    vessel: Vessel
    extended: Vessel
    record: Record
    windows: Windows
    before: Accuracy
    after: Accuracy
    findings: tuple[Finding, ...]
    verdict: str
    simulated_before: Array
    simulated_after: Array
    errors: tuple[Array, ...]
    residuals: Residuals
    lacking: tuple[Residuals, ...]
    notes: tuple[str, ...]
    screened: tuple[tuple[str, float], ...]
