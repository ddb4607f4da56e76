"""The methods that users choose from, in one tuple, and the estimation itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from expdesign.errors import Diverged, InputError, NoAnswer, UnknownName
from expdesign.estimation.equation_wise import ALL, EQUATION_WISE, SAMPLES, sample_notes, strata_of
from expdesign.estimation.excitation import WorstCase
from expdesign.estimation.feedback import Feedback, feedback_in, feedback_notes
from expdesign.estimation.output_error import Fitting, minimise_output_error
from expdesign.estimation.regression import (
    PREDICTORS,
    Guess,
    Integers,
    Layout,
    Mask,
    Regression,
    Rows,
    build_layout,
    build_regression,
    measured_table,
    model_for,
    with_wind_as_measured,
)
from expdesign.estimation.replay import (
    LEAVE_OUT,
    PLANNED,
    STEERED,
    InstrumentModel,
    Integration,
    Replay,
    Steered,
    apart_from_start,
    as_planned,
    build_replay,
    open_loop,
    treatment_of,
)
from expdesign.estimation.solve import NullSpace, Prior, Refined, Solution, Weighting, refine_iv, solve_ls
from expdesign.estimation.tuning import TUNING
from expdesign.estimation.values import Estimate, Residuals
from expdesign.progress import Progress, silent
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import NOT_SUPPORTED, VesselModel


@dataclass(frozen=True)
class Method:
    """One way to estimate.

    Attributes:
        name: as users type it.
        title: for tables.
        predictor: a name in `predictors.PREDICTORS`.
        solver: "ls", "iv" (with simulated, refined instruments) or "oe" (least simulation error).
    """

    name: str
    title: str
    predictor: str
    solver: str

    @property
    def estimates_steady_current(self) -> bool:
        """Whether the current itself is a parameter, so that terms keep their own."""
        return next(item.steady for item in PREDICTORS if item.name == self.predictor)


METHODS = (
    Method("ls", "least squares", "basic", solver="ls"),
    Method("ls-air", "least squares with measured wind", "basic-wind", solver="ls"),
    Method("ls-augmented", "least squares, augmented", "augmented", solver="ls"),
    Method("ls-wind", "least squares, augmented, with measured wind", "wind", solver="ls"),
    Method("ls-no-current", "least squares, augmented for wind alone", "no-current", solver="ls"),
    Method("ls-no-wind", "least squares, augmented for a current alone", "no-wind", solver="ls"),
    Method("iv", "instrumental variables", "basic", solver="iv"),
    Method("iv-air", "instrumental variables with measured wind", "basic-wind", solver="iv"),
    Method("iv-augmented", "instrumental variables, augmented", "augmented", solver="iv"),
    Method("iv-wind", "instrumental variables, augmented, with measured wind", "wind", solver="iv"),
    Method("iv-no-current", "instrumental variables, augmented for wind alone", "no-current", solver="iv"),
    Method("iv-no-wind", "instrumental variables, augmented for a current alone", "no-wind", solver="iv"),
    Method("iv-current", "instrumental variables with an unknown steady current", "steady-current", solver="iv"),
    Method("iv-air-current", "the same with measured wind", "steady-current-wind", solver="iv"),
    Method("oe", "output error", "basic", solver="oe"),
    Method("oe-air", "output error with measured wind", "basic-wind", solver="oe"),
)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Choices that most users leave alone.

    Attributes:
        fixed: parameters held at the model's values.
        weighting: how IV equations are formed; least squares subtracts no mean and uses one block.
        start: first instruments from the "nominal" model or from the "ls" estimate.
        most_refinements: 0 for instruments of the first model only.
        heading: of the instruments, "measured" or "simulated".
        wind: of the instruments, "lagged", "mean" or "measured".
        integration: how models are simulated, for instruments and for output error.
        horizon_s: of output error [s], None for whole runs.
        constant: whether output error gives each run a constant acceleration of its own.
        quadrature: of regressors and instruments over a sample interval, "euler" or "trapezoid".
        steered: what becomes of samples marked as steered: "use", "leave-out", "planned" for instruments from the
            inputs as planned, or "auto", see `replay.treatment_of`.
        samples: "all", or "equation-wise", see `equation_wise`; output error uses all.
        worst: what signals inside a modulus must exceed in equation-wise samples.
    """

    fixed: tuple[str, ...] = ()
    weighting: Weighting = field(default_factory=lambda: Weighting(mean="complete"))
    start: str = "nominal"
    most_refinements: int = TUNING.most_refinements
    heading: str = "measured"
    wind: str = "lagged"
    integration: Integration = field(default_factory=Integration)
    horizon_s: float | None = None
    constant: bool = False
    quadrature: str = "euler"
    steered: str = "auto"
    samples: str = ALL
    worst: WorstCase = field(default_factory=WorstCase)

    def __post_init__(self) -> None:
        if self.steered not in STEERED:
            raise UnknownName("treatment of steered samples", self.steered, known=STEERED)
        if self.samples not in SAMPLES:
            raise UnknownName("choice of samples", self.samples, known=SAMPLES)
        if self.start not in STARTS:
            raise UnknownName("start of instruments", self.start, known=STARTS)


STARTS = ("nominal", "ls")
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
        settings: the rest.
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
        predictor=chosen.predictor,
        fixed=choices.fixed,
        quadrature=choices.quadrature,
    )
    notes = (*layout.notes, *_vane_notes(measured, layout, chosen), *_steered_notes(steered, chosen))
    layout = replace(layout, notes=notes)
    planned = steered.treatment == PLANNED
    driving = as_planned(record) if planned else record
    if chosen.solver == "iv":
        layout, rows, refined = _instrumental(layout, record, driving, choices)
        whole = _whole(rows.regression)
        feedback = feedback_in(
            record, rows.regression.at(whole), refined.solution.residuals[whole], known_steered=planned
        )
        return _estimate(chosen, layout, rows, refined, steered, feedback)
    rows = build_regression(layout, record)
    if chosen.solver == "ls":
        if choices.samples == EQUATION_WISE:
            tables = [measured_table(layout.model, b, wind_measured=layout.predictor.wind) for b in record.batches]
            rows = _with_rows(rows, strata_of(layout, rows, tables, worst=choices.worst))
        return _estimate(chosen, layout, rows, _least_squares(rows, choices), steered)
    start, fitting = _start(rows, choices), _fitting(choices)
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
    told = f"{steered.samples} of {steered.of} samples are marked as steered"
    if steered.treatment == LEAVE_OUT:
        return (f"{told}; they are left out, and {steered.of - steered.samples} are used.",)
    if steered.treatment == PLANNED:
        return (f"{told}; all are used, those with instruments from the inputs as planned.",)
    return (f"{told} and used all the same; {HOLDS_STEERED[method.solver]}",)


def _fitting(choices: Settings) -> Fitting:
    return Fitting(integration=choices.integration, horizon_s=choices.horizon_s, constant=choices.constant)


def _least_squares(rows: Rows, choices: Settings) -> Refined:
    weighting = replace(choices.weighting, mean="none", blocks="one")
    return Refined(solve_ls(rows.regression, weighting), 0, ())


def _start(rows: Rows, choices: Settings) -> Solution:
    """Least squares for another method to start from, with a covariance that takes no time."""
    quick = replace(choices.weighting, covariance="hc0")
    return _least_squares(rows, replace(choices, weighting=quick)).solution


def _instrumental(layout: Layout, record: Record, driving: Record, choices: Settings) -> tuple[Layout, Rows, Refined]:
    """The estimate, with the layout and the rows that it is from; where a current is sought, those around the last.

    Args:
        layout: columns, linearised around the first guess of a current.
        record: the data.
        driving: whose inputs the instruments are simulated with.
        choices: settings.
    """
    windy = layout.predictor.wind and choices.wind != "measured"
    replay = build_replay(layout.model, driving, choices.integration, windy=windy, flowing=layout.predictor.steady)
    rows = apart_from_start(build_regression(layout, record))
    rows, refined = _with_instruments(layout, driving, rows, replay, choices)
    if layout.guess is None:
        return layout, rows, refined
    weighting = replace(choices.weighting, output_weights=_by_residuals(rows, refined))
    weighted = replace(choices, weighting=weighting)

    def around(guess: Guess) -> tuple[Layout, Rows, Refined]:
        there = replace(layout, guess=guess)
        own = apart_from_start(build_regression(there, record))
        return there, *_with_instruments(there, driving, own, replay, weighted)

    parameters = full_parameters(layout, refined.solution.values)
    return _settled_current(around, around(replace(layout.guess, parameters=parameters)))


def _settled_current(
    around: Callable[[Guess], tuple[Layout, Rows, Refined]], found: tuple[Layout, Rows, Refined]
) -> tuple[Layout, Rows, Refined]:
    """The estimate around the current that it finds: Newton's method, with steps halved where the next one grows.

    Args:
        around: the estimate around a guess.
        found: the first one.
    """
    share = 1.0
    for _ in range(TUNING.most_currents):
        layout, _, refined = found
        moved, old = refined.solution.values[-2:], layout.guess
        assert old is not None
        if (np.abs(moved) <= TUNING.settled_deviations * np.sqrt(np.diag(refined.solution.covariance)[-2:])).all():
            break
        parameters = full_parameters(layout, refined.solution.values)
        guess = Guess(
            to_mps=old.to_mps + share * moved, parameters=old.parameters + share * (parameters - old.parameters)
        )
        try:
            there = around(guess)
        except NoAnswer:  # a poor guess may make the instruments' model unstable
            share /= 2.0
            continue
        if np.hypot(*there[2].solution.values[-2:]) < np.hypot(*moved):
            found, share = there, min(1.0, 2.0 * share)
        else:
            share /= 2.0
    else:
        layout, rows, refined = found
        left = " and ".join(f"{value:.2g}" for value in refined.solution.values[-2:])
        note = (
            f"the steady current did not settle in {TUNING.most_currents} steps: from the guess that the estimate is "
            f"around, it would go on by {left} m/s to north and east; intervals may be too short"
        )
        found = layout, rows, replace(refined, warnings=(*refined.warnings, note))
    return found


def _by_residuals(rows: Rows, refined: Refined) -> tuple[float, ...]:
    """Weights of the outputs, which the current couples: one over the variance of their residuals."""
    left, data = (np.mean(values**2, axis=0) for values in (refined.solution.residuals, rows.regression.y))
    variance = np.maximum(left, TUNING.exact_share * data)
    return tuple(np.where(variance > 0, variance, variance.max()) ** -1.0) if variance.any() else ()


def _with_instruments(
    layout: Layout, record: Record, rows: Rows, replay: Replay, choices: Settings
) -> tuple[Rows, Refined]:
    """The estimate, and the rows with the samples that each equation used."""
    simulation = InstrumentModel(layout, record, rows, replay, choices.heading, choices.wind)
    start = layout.model.parameters
    if choices.start == "ls":
        start = full_parameters(layout, _start(rows, choices).values)

    def first() -> Array:
        try:
            return simulation.instruments(start)
        except Diverged as error:
            raise Diverged(f"instruments cannot be simulated from the {choices.start} model: {error}") from None

    def refined(some: Rows) -> Refined:
        return refine_iv(
            some.regression,
            first,
            lambda values: simulation.instruments(full_parameters(layout, values)),
            choices.weighting,
            prior=_prior(layout, start),
            most=choices.most_refinements,
        )

    if choices.samples == ALL:
        return rows, refined(rows)
    own, found = rows, None
    for _ in range(TUNING.most_choices):
        parameters = start if found is None else full_parameters(layout, found.solution.values)
        try:
            tables = [simulation.table(index, parameters) for index in range(len(record.batches))]
        except Diverged:
            break
        newer = _with_rows(rows, strata_of(layout, rows, tables, worst=choices.worst))
        if found is not None and np.array_equal(_strata(newer.regression), _strata(own.regression)):
            break
        own, found = newer, refined(newer)
    assert found is not None  # instruments from the start were simulated above
    return own, found


def _with_rows(rows: Rows, strata: Integers) -> Rows:
    whole = bool((strata == strata[0]).all() and strata.all())
    return replace(rows, regression=replace(rows.regression, strata=None if whole else strata))


def _strata(regression: Regression) -> Integers:
    return np.ones(regression.y.shape, dtype=np.int64) if regression.strata is None else regression.strata


def _mask(regression: Regression) -> Mask:
    return np.asarray(_strata(regression) != 0)


def _whole(regression: Regression) -> Integers | slice:
    """Rows that every equation uses."""
    return slice(None) if regression.chosen is None else np.flatnonzero(regression.chosen.all(axis=1))


def _prior(layout: Layout, start: Array) -> Prior:
    """The first model, around which parameters spread as far as the vessel file states, or by their own size."""
    model = layout.model
    places = [model.names.index(name) for name in layout.parameters]
    stated, sizes = model.parameter_std[places], TUNING.prior_share * np.abs(start[places])
    spread = np.where(stated > 0, stated, np.where(sizes > 0, sizes, np.inf))
    others = len(layout.names) - len(layout.parameters)
    return Prior(values=np.append(start[places], np.zeros(others)), spread=np.append(spread, np.full(others, np.inf)))


def full_parameters(layout: Layout, values: Array) -> Array:
    """All parameters (all,) of the model: estimated ones, those held, zero for those merged into others."""
    full = np.array(layout.model.parameters)
    for name, value in zip(layout.parameters, values, strict=False):
        full[layout.model.names.index(name)] = value
    for name in layout.merged:
        full[layout.model.names.index(name)] = 0.0
    return full


def _estimate(
    method: Method, layout: Layout, rows: Rows, refined: Refined, steered: Steered, feedback: Feedback | None = None
) -> Estimate:
    solution, p = refined.solution, len(layout.parameters)
    guessed = np.zeros(len(solution.values) - p) if layout.guess is None else layout.guess.to_mps
    full = dict(zip(layout.model.names, full_parameters(layout, solution.values).tolist(), strict=True))
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
        residuals=residuals,
        null_space=solution.null_space,
        refinements=refined.refinements,
        warnings=(
            *layout.notes,
            *_row_notes(rows),
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
    used = used & _mask(regression)
    count = np.maximum(used.sum(axis=0), 1)
    eps = np.where(used, solution.residuals - solution.residuals.sum(axis=0) / count, 0.0)
    joined = (np.diff(regression.step_of) == 1) & (np.diff(regression.batch_of) == 0)
    power = (eps**2).sum(axis=0) / count
    both = joined[:, None] & _mask(regression)[1:] & _mask(regression)[:-1]
    pairs = np.where(both, eps[1:] * eps[:-1], 0.0).sum(axis=0) / np.maximum(both.sum(axis=0), 1)
    correlation = pairs / np.where(power > 0, power, 1.0)
    return Residuals(
        outputs=regression.outputs,
        std=np.sqrt(power),
        correlation=correlation,
        rows=int(_mask(regression).any(axis=1).sum()),
        rows_of=_mask(regression).sum(axis=0),
        left_out=left_out,
        lags=solution.lags,
    )


def _row_notes(rows: Rows) -> Sequence[str]:
    return [f"{rows.left_out} samples with missing values are not used."] if rows.left_out else []


def faint_notes(found: NullSpace) -> Sequence[str]:
    """One sentence per combination of parameters that the data hardly show."""
    return [
        f"The data contain almost no information about this combination of parameters: {direction}."
        for direction in found.faint
    ]
