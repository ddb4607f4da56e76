"""Estimates by instrumental variables, around a steady current that is sought where asked for, and by least squares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from expdesign.errors import Diverged, NoAnswer, UnknownName
from expdesign.estimation.excitation import ALL, SAMPLES, WorstCase, with_strata
from expdesign.estimation.output_error import ActuatorTime, Begun
from expdesign.estimation.regression import Guess, Layout, Rows, build_regression
from expdesign.estimation.replay import STEERED, InstrumentModel, Integration, Replay, apart_from_start, build_replay
from expdesign.estimation.solve import (
    MOST_REFINEMENTS,
    SETTLED_DEVIATIONS,
    Prior,
    Refined,
    Solution,
    Weighting,
    refine_iv,
    solve_ls,
)
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import Sensors

MOST_CHOICES = 4  # of equation-wise samples, by the start and by what was estimated
MOST_CURRENTS = 8  # guesses of an unknown steady current after the first
EXACT_SHARE = 1e-12  # of the data's power, which residuals have at least where equations are weighed by them
PRIOR_SHARE = 1.0  # spread of a parameter without a stated standard deviation, relative to its size
STARTS = ("nominal", "ls")  # models that first instruments may come from: the one in use, or that of least squares


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Choices of an estimate."""

    fixed: tuple[str, ...] = ()  # parameters held at the model's values
    # how IV equations are formed; least squares subtracts no mean and uses one block
    weighting: Weighting = field(default_factory=lambda: Weighting(mean="complete"))
    start: str = "nominal"  # first instruments from the "nominal" model or from the "ls" estimate
    most_refinements: int = MOST_REFINEMENTS  # 0 for instruments of the first model only
    heading: str = "measured"  # of the instruments, "measured" or "simulated"
    wind: str = "lagged"  # of the instruments, "lagged", "mean" or "measured"
    # how models are simulated, for instruments and for output error
    integration: Integration = field(default_factory=Integration)
    horizon_s: float | None = None  # of output error [s], None for whole runs
    constant: bool = False  # whether output error gives each run a constant acceleration of its own
    quadrature: str = "euler"  # of regressors and instruments over a sample interval, "euler" or "trapezoid"
    # what becomes of samples marked as steered: "use", "leave-out", "planned" for instruments from the inputs as
    # planned, or "auto", see `replay.treatment_of`
    steered: str = "auto"
    samples: str = ALL  # "all", or "equation-wise", see `estimation.excitation`; output error uses all
    # what signals inside a modulus must exceed in equation-wise samples
    worst: WorstCase = field(default_factory=WorstCase)
    times: tuple[ActuatorTime, ...] = ()  # dead times and lags that output error estimates beside the parameters
    # whose noise leaves the first velocities of output error uncertain
    sensors: Sensors = field(default_factory=Sensors)
    begun: Begun | None = None  # where output error goes on; None to begin with least squares

    def __post_init__(self) -> None:
        if self.steered not in STEERED:
            raise UnknownName("treatment of steered samples", self.steered, known=STEERED)
        if self.samples not in SAMPLES:
            raise UnknownName("choice of samples", self.samples, known=SAMPLES)
        if self.start not in STARTS:
            raise UnknownName("start of instruments", self.start, known=STARTS)


def least_squares(rows: Rows, weighting: Weighting) -> Refined:
    """The estimate of least squares.

    Args:
        weighting: whose covariance is wanted; its mean and blocks are those of instruments.
    """
    return Refined(solve_ls(rows.regression, replace(weighting, mean="none", blocks="one")), 0, ())


def quick_least_squares(rows: Rows, weighting: Weighting) -> Solution:
    """Least squares for another method to start from, with a covariance that takes no time."""
    return least_squares(rows, replace(weighting, covariance="hc0")).solution


def instrumental_estimate(
    layout: Layout, record: Record, driving: Record, choices: Settings
) -> tuple[Layout, Rows, Refined]:
    """The estimate, with the layout and the rows that it is from; where a current is sought, those around the last.

    Args:
        layout: columns, linearised around the first guess of a current.
        driving: whose inputs the instruments are simulated with.
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

    parameters = layout.full_parameters(refined.solution.values)
    return _settled_current(around, around(replace(layout.guess, parameters=parameters)))


def _settled_current(
    around: Callable[[Guess], tuple[Layout, Rows, Refined]], found: tuple[Layout, Rows, Refined]
) -> tuple[Layout, Rows, Refined]:
    """The estimate around the current that it finds: Newton's method, with steps halved where the next one grows.

    Args:
        around: the estimate around a guess.
    """
    share = 1.0
    for _ in range(MOST_CURRENTS):
        layout, _, refined = found
        moved, old = refined.solution.values[-2:], layout.guess
        assert old is not None
        if (np.abs(moved) <= SETTLED_DEVIATIONS * np.sqrt(np.diag(refined.solution.covariance)[-2:])).all():
            break
        parameters = layout.full_parameters(refined.solution.values)
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
            f"the steady current did not settle in {MOST_CURRENTS} steps: from the guess that the estimate is "
            f"around, it would go on by {left} m/s to north and east; intervals may be too short"
        )
        found = layout, rows, replace(refined, warnings=(*refined.warnings, note))
    return found


def _by_residuals(rows: Rows, refined: Refined) -> tuple[float, ...]:
    """Weights of the outputs, which the current couples: one over the variance of their residuals."""
    left, data = (np.mean(values**2, axis=0) for values in (refined.solution.residuals, rows.regression.y))
    variance = np.maximum(left, EXACT_SHARE * data)
    return tuple(np.where(variance > 0, variance, variance.max()) ** -1.0) if variance.any() else ()


def _with_instruments(
    layout: Layout, record: Record, rows: Rows, replay: Replay, choices: Settings
) -> tuple[Rows, Refined]:
    """The estimate, and the rows with the samples that each equation used."""
    simulation = InstrumentModel(layout, record, rows, replay, choices.heading, choices.wind)
    start = layout.model.parameters
    if choices.start == "ls":
        start = layout.full_parameters(quick_least_squares(rows, choices.weighting).values)

    def first() -> Array:
        try:
            return simulation.instruments(start)
        except Diverged as error:
            raise Diverged(f"instruments cannot be simulated from the {choices.start} model: {error}") from None

    def refined(some: Rows) -> Refined:
        return refine_iv(
            some.regression,
            first,
            lambda values: simulation.instruments(layout.full_parameters(values)),
            choices.weighting,
            prior=_prior(layout, start),
            most=choices.most_refinements,
        )

    if choices.samples == ALL:
        return rows, refined(rows)
    own, found = rows, None
    for _ in range(MOST_CHOICES):
        parameters = start if found is None else layout.full_parameters(found.solution.values)
        try:
            tables = [simulation.table(index, parameters) for index in range(len(record.batches))]
        except Diverged:
            break
        newer = with_strata(layout, rows, tables, worst=choices.worst)
        if found is not None and np.array_equal(newer.regression.groups, own.regression.groups):
            break
        own, found = newer, refined(newer)
    assert found is not None  # instruments from the start were simulated above
    return own, found


def _prior(layout: Layout, start: Array) -> Prior:
    """The first model, around which parameters spread as far as the vessel file states, or by their own size."""
    model = layout.model
    places = [model.names.index(name) for name in layout.parameters]
    stated, sizes = model.parameter_std[places], PRIOR_SHARE * np.abs(start[places])
    spread = np.where(stated > 0, stated, np.where(sizes > 0, sizes, np.inf))
    others = len(layout.names) - len(layout.parameters)
    return Prior(values=np.append(start[places], np.zeros(others)), spread=np.append(spread, np.full(others, np.inf)))
