"""Output error: the parameters whose simulations are closest to the measured velocities.

Every run is cut into stretches of the length of the horizon; without a horizon a stretch is the whole run. The first
velocity of each stretch is estimated together with the parameters; from the measured one it differs by the sensors'
noise, which weighs the first sample. Simulated velocities contain no measurement noise:
if the sensors are the only disturbance, whole runs give the maximum-likelihood estimate, the reference for the accuracy
of IV. Unmodelled forces accumulate in a simulation, and simulations of course-unstable ships diverge from the measured
motion; a shorter horizon limits both. Optionally each run has a constant acceleration, for steady unmodelled forces.
Measured wind acts through the b-frame velocity of the air, ship velocity minus relative wind, without a heading.

A steady current, the same for all runs, is estimated with the parameters where the method asks for it: the model's
terms act through the water that it carries along.

Dead times and lags of actuators that are not known exactly are estimated beside the parameters. What is known of them
beforehand counts as one more measurement, and their errors are in the covariance.

The method is Levenberg and Marquardt with exact derivatives. It starts from least squares with a short horizon, which
grows by `HORIZON_GROWTH` until it is the requested one: a poor model diverges over a whole run, but not over few
samples. Where it still diverges, stretches in which it does are left out at first, or a horizon between the last two is
taken. Of long data only some stretches are compared until then, and of fast ones only some samples. The weight of an
output is the inverse residual variance of the stage before.

Source: L. Ljung, System Identification, 2nd ed. (1999), 4.2 and 9.3; H. G. Bock, in Modelling of Chemical Reaction
Systems (1981), 102-125, for the stretches.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.errors import NoAnswer
from expdesign.estimation.output_error.covariance import with_covariance
from expdesign.estimation.output_error.gauss_newton import cost, minimised, runs_away, unit
from expdesign.estimation.output_error.problem import (
    Excerpt,
    Fitting,
    Place,
    Problem,
    build_problem,
    first_states,
    sample_time,
)
from expdesign.estimation.regression import Layout, Regression
from expdesign.estimation.solve import Solution
from expdesign.progress import Estimated, Progress, silent
from expdesign.signals import Record
from expdesign.values import Array

FIRST_HORIZON_SAMPLES = 8  # of output error
HORIZON_GROWTH = 4  # ratio of successive horizons of output error
# where the model diverges at a horizon, others are tried down to the one, and up to a ratio of it of the other
SHORTEST_HORIZON_SAMPLES, LEAST_HORIZON_GROWTH = 3, 1.2
DIVERGED_TIMES = 10.0  # a simulation so many times as fast as the largest measurement has diverged
MOST_PARTIAL_SEARCHES = 3  # without stretches in which the model diverges, of one horizon
MOST_LEFT_OUT = 0.5  # share of these, at most
EXPECTED_STEPS = 3  # of Gauss and Newton on all data, for the progress told; twice as many on part of them
COVARIANCE_STEPS = 4.0  # how many such steps the covariance takes as long as
# how many samples a step could do while libraries are loaded, and while a stage is compiled
LOADING_SAMPLES, COMPILING_SAMPLES = 7e4, 7e3
SLOWEST_CONVERGENCE = 1.5  # least ratio of successive expected decreases that the progress told counts on
SETTLED_COST = 1e-4  # expected decrease of the cost, in squared standard deviations, that ends the last horizons
ROUGH_SAMPLES = 10_000  # compared at earlier horizons than the last, spread over the data
ROUGH_STEP_S = 0.5  # longest step of simulations that compare some samples only
ROUGH_COST = 0.1  # the same for earlier horizons
ACTIVITY = "fitting simulations to the data"


class Steps:
    """Tells the share done, in samples simulated.

    Args:
        stages: work of a step, and the expected number of steps, of each stage.
        progress: of the search.
    """

    def __init__(self, stages: Sequence[tuple[float, int]], progress: Progress) -> None:
        """Begin before the first stage, with the libraries loaded."""
        self._stages, self._place, self._taken, self._before = list(stages), -1, 0, np.inf
        self._estimated = Estimated(progress, after=COVARIANCE_STEPS * stages[-1][0])
        self._estimated.done = LOADING_SAMPLES
        self._tell(0.0)

    def begin(self) -> None:
        """The next stage is compiled, and then begun."""
        self._place, self._taken, self._before = self._place + 1, 0, np.inf
        work, expected = self._stages[self._place]
        self._estimated.done += COMPILING_SAMPLES
        self._tell(expected * work)

    def insert(self, work: float, expected: int) -> None:
        """Another stage comes before the present one, which is begun again after it."""
        here = self._place + 1
        self._stages[here:here] = [(work, expected), self._stages[self._place]]

    def report(self, excess: float) -> None:
        """A step is to be taken whose expected decrease is so many times the one that ends the stage."""
        work, expected = self._stages[self._place]
        left = float(max(1, expected - self._taken))
        if np.isfinite(self._before) and excess > 0:
            shrinks = np.log(max(self._before / excess, SLOWEST_CONVERGENCE))
            left = min(max(np.log(max(excess, 1.0)) / shrinks, 0.0) + 1.0, 2.0 * expected)
        self._tell(left * work)
        self._before, self._taken = excess, self._taken + 1
        self._estimated.done += work

    def end(self) -> None:
        """All stages are done."""
        self._tell(0.0)

    def _tell(self, left: float) -> None:
        later = self._stages[self._place + 1 :]
        self._estimated.tell(ACTIVITY, left + sum(work * steps + COMPILING_SAMPLES for work, steps in later))


def minimise_output_error(
    layout: Layout, record: Record, start: Solution, fitting: Fitting, *, progress: Progress = silent
) -> tuple[Solution, Regression]:
    """The estimate of the layout's parameters; then a current, times and constants per run and output, if requested.

    Returns the solution and the regression of its last Gauss-Newton step, for names and rows.

    Args:
        layout: with a predictor without nuisance regressors.
        record: batches of one sample time.
        start: a regression's solution, for the first guess.
        fitting: how simulations are compared with the data.

    Raises:
        InputError: batches of different sample times, or inputs or wind that are not numbers.
        NotInformative: parameters without effect on the simulated outputs.
        NoAnswer: the best model found diverges within the horizon.
    """
    spread = _spread(record, layout)
    weights = 1.0 / spread
    values = np.concatenate(
        [
            start.values[: len(layout.parameters)],
            np.zeros(fitting.unexpected + len(fitting.times) + len(record.batches) * len(layout.model.outputs)),
        ]
    )
    stages = _stages(record, fitting)
    if fitting.begun is not None:
        goes_on = [
            fitting.begun.values.get(name, value) for name, value in zip(layout.parameters, values, strict=False)
        ]
        values[: len(goes_on)] = goes_on
    steps = Steps([(stage.work(record), stage.steps) for stage in stages], progress)
    found: dict[Place, Array] = {}
    answered, origin = 0, values
    while stages:
        stage, *later = stages
        problem = build_problem(layout, record, fitting, stage.excerpt, weights)
        steps.begin()
        values, starts = _better(problem, values, found, origin)
        problem = _reweighted(problem, values, starts, spread)
        problem = _weighed(problem, values, starts)
        try:
            values, starts = minimised(problem, values, starts, settled=stage.settled, report=steps.report)
        except NoAnswer:
            if stage.excerpt.without:  # nothing is gained so
                stages = [replace(later[0], attempts=MOST_PARTIAL_SEARCHES), *later[1:]]
                continue
            easier = _without_diverging(stage, problem, values, starts) or _between(answered, stage)
            if easier is None:
                raise runs_away(problem, (answered - 1) * sample_time(record)) from None
            steps.insert(easier.work(record), easier.steps)
            stages = [easier, replace(stage, attempts=stage.attempts + 1), *later]
            continue
        found = dict(zip(problem.places, starts, strict=True))
        weights = problem.weights
        answered, stages = answered if stage.excerpt.without else stage.excerpt.length, later
    steps.end()
    return with_covariance(problem, layout, record, values, starts, quick=fitting.quick)


def _better(problem: Problem, values: Array, found: Mapping[Place, Array], origin: Array) -> tuple[Array, Array]:
    """What the stage before found, or what the search began with where that is closer to the data of this stage.

    Over a short horizon noise tells little, and what it tells may diverge over a longer one.
    """
    later, first = (values, first_states(problem, found)), (origin, first_states(problem, {}))
    with np.errstate(over="ignore", invalid="ignore"):
        costs = [cost(problem, own, problem.residuals(problem.states(own, starts))) for own, starts in (later, first)]
    return first if costs[1] < costs[0] else later


def _reweighted(problem: Problem, values: Array, starts: Array, spread: Array) -> Problem:
    """The problem with weights by what its own simulations leave, at most as much as the outputs vary."""
    with np.errstate(over="ignore", invalid="ignore"):
        variance = _variance(problem, values, starts)
    known = np.where(np.isfinite(variance), variance, np.inf)
    return replace(problem, weights=1.0 / np.clip(known, 1e-12 * spread, spread))


def _weighed(problem: Problem, values: Array, starts: Array) -> Problem:
    """The problem with what is known beforehand, of times and of starts, in units of the cost.

    Residuals count as white in it; those that last would else move starts by many standard deviations of the sensors.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        own = unit(problem, problem.states(values, starts))
    return replace(problem, precision=problem.precision * own, sensed=problem.sensed / own)


@dataclass(frozen=True, kw_only=True)
class Stage:
    """One search."""

    excerpt: Excerpt  # what is compared
    settled: float  # ends the search, see `minimised`
    steps: int  # expected number
    attempts: int = 0  # that had no answer

    def work(self, record: Record) -> float:
        """Samples simulated in a step."""
        return min(sum(map(len, record.batches)) / self.excerpt.every, self.excerpt.most)


def _stages(record: Record, fitting: Fitting) -> list[Stage]:
    """Growing horizons on part of the data; the last one on every so manieth sample of fast data, then on all, twice.

    A rough search of whole runs takes most steps; what thinner samples leave to find takes two or three. All data are
    first searched roughly, for the weights of the outputs: these change with the square of what is left to find.
    """
    longest, total, time_s = max(map(len, record.batches)), sum(map(len, record.batches)), sample_time(record)
    full = longest if fitting.horizon_s is None else max(2, round(fitting.horizon_s / time_s) + 1)
    *growing, last = _horizons(min(full, longest))
    if fitting.begun is not None:
        known_s = fitting.begun.horizon_s
        growing = [] if known_s is None else [samples for samples in growing if samples * time_s > known_s]
    rough = [Excerpt(samples=samples, most=ROUGH_SAMPLES) for samples in growing]
    thinner = int(min(total / ROUGH_SAMPLES, ROUGH_STEP_S / time_s, last / FIRST_HORIZON_SAMPLES))
    if thinner > 1:
        rough.append(Excerpt(samples=-(-last // thinner), every=thinner))
    whole = Excerpt(samples=last)
    return [
        *(Stage(excerpt=item, settled=ROUGH_COST, steps=2 * EXPECTED_STEPS) for item in rough),
        Stage(excerpt=whole, settled=ROUGH_COST, steps=EXPECTED_STEPS),
        Stage(excerpt=whole, settled=SETTLED_COST, steps=EXPECTED_STEPS),
    ]


def _without_diverging(stage: Stage, problem: Problem, values: Array, starts: Array) -> Stage | None:
    """A search without the stretches in which the model diverges; None where these are many, or were left out before.

    Data that the model follows often mend what makes it diverge in a few stretches.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        largest = np.abs(problem.states(values, starts)).max(axis=(0, 2))
    diverges = ~(largest < DIVERGED_TIMES * np.nanmax(np.abs(problem.measured)))
    if stage.attempts >= MOST_PARTIAL_SEARCHES or not 0 < diverges.sum() < MOST_LEFT_OUT * len(diverges):
        return None
    places = zip(problem.batch[diverges].tolist(), problem.first[diverges].tolist(), strict=True)
    excerpt = replace(stage.excerpt, without=frozenset(places))
    return Stage(excerpt=excerpt, settled=ROUGH_COST, steps=2 * EXPECTED_STEPS)


def _between(answered: int, stage: Stage) -> Stage | None:
    """A search of a horizon between that of the last answer and one that has none; None where these are near."""
    samples = round(math.sqrt(max(answered, SHORTEST_HORIZON_SAMPLES) * stage.excerpt.length))
    if samples > stage.excerpt.length / LEAST_HORIZON_GROWTH:
        return None
    excerpt = Excerpt(samples=samples, most=ROUGH_SAMPLES)
    return Stage(excerpt=excerpt, settled=ROUGH_COST, steps=2 * EXPECTED_STEPS)


def _horizons(full: int) -> list[int]:
    horizons = [full]
    while horizons[0] > FIRST_HORIZON_SAMPLES * HORIZON_GROWTH:
        horizons.insert(0, -(-horizons[0] // HORIZON_GROWTH))
    return horizons


def _spread(record: Record, layout: Layout) -> Array:
    """(n,) variances of the outputs; 1 where one does not change."""
    states = [OUTPUTS.index(name) for name in layout.model.outputs]
    spread = np.nanvar(np.concatenate([batch.velocity[:, states] for batch in record.batches]), axis=0)
    return np.asarray(np.where(spread > 0, spread, 1.0))


def _variance(problem: Problem, values: Array, starts: Array) -> Array:
    """(n,) variance of the residuals, with one degree of freedom less for each start."""
    residuals = problem.residuals(problem.states(values, starts))
    count = np.isfinite(problem.measured).sum(axis=(0, 1)) - len(starts)
    return np.asarray((residuals**2).sum(axis=(0, 1)) / np.maximum(count, 1))
