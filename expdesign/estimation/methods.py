"""The methods that users choose from, in one tuple, and the estimation itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import InputError, UnknownName
from expdesign.estimation.excitation import EQUATION_WISE, sample_notes, with_strata
from expdesign.estimation.instrumental import Settings, instrumental_estimate, least_squares, quick_least_squares
from expdesign.estimation.output_error import Fitting, minimise_output_error
from expdesign.estimation.regression import (
    PREDICTORS,
    UNKNOWN,
    Integers,
    Layout,
    Predictor,
    Regression,
    Rows,
    build_layout,
    build_regression,
    measured_table,
    model_for,
    with_wind_as_measured,
)
from expdesign.estimation.replay import LEAVE_OUT, PLANNED, Steered, as_planned, open_loop, treatment_of
from expdesign.estimation.solve import NullSpace, Refined, Solution
from expdesign.estimation.values import Estimate, Feedback, Residuals, feedback_in, feedback_notes
from expdesign.progress import Progress, silent
from expdesign.signals import Record
from expdesign.vessel import NOT_SUPPORTED, VesselModel

ESTIMATORS = {"ls": "least squares", "iv": "instrumental variables", "oe": "output error"}
"""Name -> title; "iv" has simulated, refined instruments, "oe" the least simulation error."""


@dataclass(frozen=True)
class Method:
    """One way to estimate: an estimator, and what is known and unknown of the weather."""

    solver: str  # one of `ESTIMATORS`
    weather: Predictor

    @property
    def name(self) -> str:
        """As users type it and files have it, "iv-air"."""
        return "-".join(filter(None, (self.solver, self.weather.suffix)))

    @property
    def title(self) -> str:
        """For tables."""
        return ESTIMATORS[self.solver] + self.weather.title

    @property
    def exists(self) -> bool:
        """Whether its equations are here: output error has no nuisance regressors, a steady current needs refining."""
        return not (self.weather.nuisance if self.solver == "oe" else self.weather.steady and self.solver == "ls")


METHODS = tuple(method for solver in ESTIMATORS for weather in PREDICTORS if (method := Method(solver, weather)).exists)
HOLDS_STEERED = {
    "ls": "least squares then holds only where it does without: velocities without noise, disturbances without memory.",
    "iv": "instruments simulated from their inputs are biased by disturbances that last.",
    "oe": "output error then holds only for noise of the sensors without memory: a current or wind that is not "
    "measured makes the simulation's error last, and inputs that answer it bias the estimate.",
}
"""What a method's estimate needs where inputs follow the ship's motion; derived in `feedback`."""
ROLLS = (
    "the vessel's model has a roll mode, [model.roll], which estimate does not support; expected a vessel file "
    "without that table, or use expdesign diagnose"
)


def method_named(name: str) -> Method:
    """The method of that name.

    Raises:
        UnknownName: there is none.
    """
    for method in METHODS:
        if method.name == name:
            return method
    raise UnknownName("method", name, known=[method.name for method in METHODS])


def steady_current_method(model: VesselModel) -> str:
    """The method whose accuracy designs and plans state where the forecast leaves a steady current unknown."""
    return "iv-air-current" if model.reads_air else "iv-current"


def method_for(solver: str, unknown: str, *, wind: bool) -> Method | None:
    """The method of an estimator for what is unknown of the weather; None where there is none.

    Args:
        solver: one of `ESTIMATORS`.
        unknown: one of `UNKNOWN`.
        wind: whether wind is measured and acts in the model; it is used unless it is what is unknown.
    """
    fitting = [one for one in METHODS if (one.solver, one.weather.unknown) == (solver, unknown)]
    return max(fitting, key=lambda one: one.weather.wind == wind, default=None)


def methods_for(names: Sequence[str], unknown: str, *, wind: bool) -> tuple[str, ...]:
    """Methods of estimators for what is unknown of the weather; of all that there are where none is named.

    Raises:
        UnknownName: no such estimator, or nothing that may be unknown.
        InputError: the estimator has no such method.
    """
    if unknown not in UNKNOWN:
        raise UnknownName("part of the weather", unknown, known=UNKNOWN)
    for name in names:
        if name not in ESTIMATORS:
            raise UnknownName("estimator", name, known=ESTIMATORS)
    found = {name: method_for(name, unknown, wind=wind) for name in names or ESTIMATORS}
    for name, method in found.items():
        if names and method is None:
            there = [one for one in UNKNOWN if method_for(name, one, wind=wind)]
            raise InputError(f"{name} has no method for {unknown} unknown, expected one of {', '.join(there)}")
    return tuple(method.name for method in found.values() if method is not None)


def estimate(
    record: Record,
    model: VesselModel,
    *,
    method: str = "iv",
    settings: Settings | None = None,
    progress: Progress = silent,
) -> Estimate:
    """Parameters of a model from measured data.

    Args:
        record: batches with the model's inputs, or generalised forces.
        model: structure; its values start the instruments and stand for parameters held fixed.
        method: a name in `METHODS`.
        progress: of output error; the others are quick.

    Raises:
        InputError: the data lack what the method needs, or the model has a roll mode.
        NotInformative: parameters that the data cannot tell apart; the message names the combinations.
        Diverged: the model that the first instruments come from is unstable.
    """
    chosen, choices = method_named(method), settings or Settings()
    if model.roll is not None:
        raise InputError(ROLLS)
    if model.inertia is not None:
        raise InputError(NOT_SUPPORTED.format(what="estimate"))
    steered = treatment_of(record, choices.steered, instruments=chosen.solver == "iv")
    record = open_loop(record) if steered.treatment == LEAVE_OUT else record
    measured, record = record, as_read(record, chosen)
    layout = build_layout(
        model_for(model, record),
        record,
        predictor=chosen.weather.name,
        fixed=choices.fixed,
        quadrature=choices.quadrature,
    )
    notes = (*layout.notes, *_vane_notes(measured, layout, chosen), *_steered_notes(steered, chosen))
    layout = replace(layout, notes=notes)
    planned = steered.treatment == PLANNED
    driving = as_planned(record) if planned else record
    if chosen.solver == "iv":
        layout, rows, refined = instrumental_estimate(layout, record, driving, choices)
        whole = _whole(rows.regression)
        feedback = feedback_in(
            record, rows.regression.at(whole), refined.solution.residuals[whole], known_steered=planned
        )
        return _estimate(chosen, layout, rows, refined, steered, feedback)
    rows = build_regression(layout, record)
    if chosen.solver == "ls":
        if choices.samples == EQUATION_WISE:
            tables = [measured_table(layout.model, b, wind_measured=layout.predictor.wind) for b in record.batches]
            rows = with_strata(layout, rows, tables, worst=choices.worst)
        return _estimate(chosen, layout, rows, least_squares(rows, choices.weighting), steered)
    start, fitting = quick_least_squares(rows, choices.weighting), _fitting(choices, current=layout.guess is not None)
    layout = replace(layout, guess=None)  # nothing is linearised around it
    solution, regression = minimise_output_error(layout, record, start, fitting, progress=progress)
    left_out = sum(map(len, record.batches)) - len(regression)
    rows = Rows(regression=regression, used=(), left_out=left_out)
    return _estimate(chosen, layout, rows, Refined(solution, 0, ()), steered)


def as_read(record: Record, method: Method) -> Record:
    """The record as a method reads it."""
    return with_wind_as_measured(record) if method.solver == "ls" else record


def _vane_notes(record: Record, layout: Layout, method: Method) -> tuple[str, ...]:
    std_rad = max(batch.vane_std_rad for batch in record.batches)
    if method.solver != "ls" or not layout.predictor.wind or not std_rad:
        return ()
    return (
        f"The vane's noise of {std_rad:.2g} rad draws least squares towards zero in the terms of the wind; "
        "methods with instruments (iv-air, iv-wind) are free of it.",
    )


def _steered_notes(steered: Steered, method: Method) -> tuple[str, ...]:
    if not steered.samples:
        return ()
    share = f"{steered.samples} of {steered.of} samples are marked as steered"
    if steered.treatment == LEAVE_OUT:
        return (f"{share}; they are left out, and {steered.of - steered.samples} are used.",)
    if steered.treatment == PLANNED:
        return (f"{share}; all are used, those with instruments from the inputs as planned.",)
    return (f"{share} and used all the same; {HOLDS_STEERED[method.solver]}",)


def _fitting(choices: Settings, *, current: bool) -> Fitting:
    return Fitting(
        integration=choices.integration,
        horizon_s=choices.horizon_s,
        constant=choices.constant,
        current=current,
        times=choices.times,
        sensors=choices.sensors,
        begun=choices.begun,
        quick=choices.weighting.covariance == "hc0",
    )


def _whole(regression: Regression) -> Integers | slice:
    """Rows that every equation uses."""
    return slice(None) if regression.chosen is None else np.flatnonzero(regression.chosen.all(axis=1))


def _estimate(
    method: Method, layout: Layout, rows: Rows, refined: Refined, steered: Steered, feedback: Feedback | None = None
) -> Estimate:
    solution, p = refined.solution, len(layout.parameters)
    guessed = np.zeros(len(solution.values) - p) if layout.guess is None else layout.guess.to_mps
    full = dict(zip(layout.model.names, layout.full_parameters(solution.values).tolist(), strict=True))
    residuals = _statistics(rows.regression, solution, rows.left_out)
    return Estimate(
        method=method.name,
        names=layout.parameters,
        values=solution.values[:p],
        covariance=solution.covariance[:p, :p],
        held={name: full[name] for name in layout.model.names if name not in layout.parameters},
        nuisance_names=rows.regression.parameters[p:],
        nuisance_values=guessed + solution.values[p:],
        nuisance_shares=tuple(item.shares for item in layout.nuisance),
        partners=dict(layout.partners),
        joint_covariance=solution.covariance,
        between_runs=solution.between_runs,
        residuals=residuals,
        null_space=solution.null_space,
        refinements=refined.refinements,
        warnings=(
            *layout.notes,
            *([f"{rows.left_out} samples with missing values are not used."] if rows.left_out else []),
            *sample_notes(residuals),
            *refined.warnings,
            *solution.warnings,
            *faint_notes(solution.null_space),
            *feedback_notes(feedback),
        ),
        steered=steered,
        feedback=feedback,
    )


def _statistics(regression: Regression, solution: Solution, left_out: int) -> Residuals:
    used = regression.Phi.any(axis=2) | (solution.residuals != 0)  # output error has zeros where nothing is measured
    used = used & regression.used
    count = np.maximum(used.sum(axis=0), 1)
    eps = np.where(used, solution.residuals - solution.residuals.sum(axis=0) / count, 0.0)
    joined = (np.diff(regression.step_of) == 1) & (np.diff(regression.batch_of) == 0)
    power = (eps**2).sum(axis=0) / count
    both = joined[:, None] & regression.used[1:] & regression.used[:-1]
    pairs = np.where(both, eps[1:] * eps[:-1], 0.0).sum(axis=0) / np.maximum(both.sum(axis=0), 1)
    correlation = pairs / np.where(power > 0, power, 1.0)
    return Residuals(
        outputs=regression.outputs,
        std=np.sqrt(power),
        correlation=correlation,
        rows=int(regression.used.any(axis=1).sum()),
        rows_of=regression.used.sum(axis=0),
        left_out=left_out,
        lags=solution.lags,
    )


def faint_notes(found: NullSpace) -> Sequence[str]:
    """One sentence on the combinations of parameters that the data hardly show."""
    if not found.faint:
        return []
    faintest = min(found.faint, key=lambda direction: direction.strength)
    if len(found.faint) == 1:
        return [f"The data contain almost no information about this combination of parameters: {faintest}."]
    names = dict.fromkeys(name for direction in found.faint for name in direction.parameters)
    several = f"{len(found.faint)} combinations of {', '.join(names)}"
    return [f"The data contain almost no information about {several}; least about {faintest}."]
