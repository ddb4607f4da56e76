"""Monte Carlo validation of designs: estimates from many simulated trials, compared with the predictions.

A trial is a number of whole runs. Each is simulated with a true ship from its entry velocity, measured with the ship's
sensors, and used for estimation with the scenario's vessel as the nominal model. Designs are compared at the same
informative time: the optimised one, equal shares, and runs drawn at random for every trial.

The initial heading advances by the golden angle from run to run, the same in every trial, which spreads the runs of
every manoeuvre evenly over the wind. Predictions use these headings.

Trials are divided into chunks with independent random streams: the result does not depend on the number of processes,
and finished chunks are kept.

Covariances of estimates from each primitive alone (7.59) come from trials that are a few runs of one primitive by the
nominal ship, measured with its sensors and estimated from alone. The scatter about the nominal parameters counts bias
as well as noise. A primitive whose trials do not all give an estimate of every parameter is not informative on its own,
and has no covariance. Where instruments are weak, few trials far off decide the covariance: the assumption (7.60) of
normal estimates then fails, and shares by information are safer.

Source: F. Ljungberg, doctoral thesis, Linköping University, 7.3.1 and 9.1.2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.durations import monte_carlo_covariance
from expdesign.errors import InputError, NoAnswer
from expdesign.estimation.excitation import EQUATION_WISE, worst_case
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate, method_named
from expdesign.estimation.replay import Integration
from expdesign.estimation.solve import Weighting
from expdesign.information.excitation import FREE, SIGMAS
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.information.moments import HEADINGS
from expdesign.processes import as_finished
from expdesign.progress import Progress, silent
from expdesign.reduction import at_reference_point, with_delivered_inputs
from expdesign.signals import Batch, Record
from expdesign.simulation import CALM, Environment, mean_weather, simulate_ensemble
from expdesign.simulation.run import SUBSTEPS
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel

CHUNK_TRIALS = 20  # trials in one chunk; each chunk has its own random stream
SINGLE_TRIALS = 5  # those of random runs, simulated trial by trial: processes share smaller chunks more evenly

RANDOM = "random"
GOLDEN_ANGLE_RAD = np.pi * (3.0 - 5.0**0.5)  # angle from the heading of one run to that of the next


@dataclass(frozen=True, kw_only=True, eq=False)
class Rehearsal:
    """The designs and ships of a validation."""

    truth: Vessel  # the simulated ship, with its sensors
    nominal: Vessel  # the ship of the design, with the same actuators; it simulates the instruments
    primitives: tuple[Primitive, ...]  # the dictionary
    designs: Mapping[str, tuple[int, ...] | None]  # name -> whole runs of each primitive; None for random runs
    total_s: float  # informative time of a random design [s]
    environment: Environment  # weather; its mean is drawn for each trial with its standard deviation
    parameters: tuple[str, ...]  # names of the estimated parameters; the others are fixed at the nominal model's values
    # method, mean_subtraction: of the estimator
    method: str = "iv"
    mean_subtraction: str = "complete"
    excitation: str = FREE  # of the design; unless "free", estimates are from equation-wise samples
    # of the true ship: "rk4", and parameters of the continuous motion are estimated, as by `expdesign estimate`; or
    # "euler", the map that defines discrete parameters, and those of the map are
    integrator: str = "rk4"
    trials: int = 100  # number for each design
    seed: int = 0  # of all random numbers

    def __post_init__(self) -> None:
        if self.truth.model.inputs != self.nominal.model.inputs:
            raise InputError(
                f"the true vessel takes {', '.join(self.truth.model.inputs)}, the scenario's vessel "
                f"{', '.join(self.nominal.model.inputs)}: expected the same actuators"
            )
        if self.truth.sample_time_s != self.nominal.sample_time_s:
            raise InputError(
                f"the true vessel is sampled every {self.truth.sample_time_s:g} s, expected "
                f"{self.nominal.sample_time_s:g} s as the scenario's vessel"
            )
        if self.trials < 2:
            raise InputError(f"trials is {self.trials}, expected 2 or more")


@sealed(truth="p", estimates="n p", stated="n p", forecast="p", theory="p")
class Validated:
    """The result of one design."""

    design: str  # its name
    parameters: tuple[str, ...]  # names of the estimated parameters
    truth: Array  # (p,) values of the true ship; nan for parameters that its model does not have
    # estimates, stated: (n, p) estimates and their stated standard deviations
    estimates: Array
    stated: Array
    forecast: Array  # (p,) standard deviations predicted with the nominal model, nan for random designs
    theory: Array  # (p,) standard deviations predicted with the true ship; nan for random designs
    failed: int  # number of trials without an estimate

    @property
    def found(self) -> Array:
        """(p,) standard deviation of the estimates."""
        return np.asarray(self.estimates.std(axis=0, ddof=1))

    @property
    def bias(self) -> Array:
        """(p,) mean estimate less the true value."""
        return np.asarray(self.estimates.mean(axis=0) - self.truth)

    @property
    def bias_deviations(self) -> Array:
        """(p,) bias in standard errors of a mean over these trials."""
        return np.asarray(np.abs(self.bias) / self.found * np.sqrt(len(self.estimates)))

    @property
    def coverage(self) -> Array:
        """(p,) share of trials whose 95 % interval holds the true value."""
        return np.asarray((np.abs(self.estimates - self.truth) <= 1.959964 * self.stated).mean(axis=0))

    @property
    def errors(self) -> Array:
        """(n,) root mean square over the parameters of (estimate - truth) / |truth|, as in the thesis's figure 9.1."""
        known = np.abs(self.truth) > 0
        relative = (self.estimates - self.truth)[:, known] / np.abs(self.truth[known])
        return np.asarray(np.sqrt((relative**2).mean(axis=1)))


def equal_runs(primitives: Sequence[Primitive], total_s: float) -> tuple[int, ...]:
    """Whole runs of every primitive nearest to equal shares of a time, at least one of each."""
    share = total_s / len(primitives)
    return tuple(max(1, round(share / primitive.duration_s)) for primitive in primitives)


def validate(
    rehearsal: Rehearsal,
    *,
    done: Mapping[str, Array] | None = None,
    keep: Callable[[str, Array], None] = lambda key, rows: None,
    progress: Progress = silent,
) -> tuple[Validated, ...]:
    """Validate every design of a rehearsal; processes share the chunks of trials.

    Args:
        done: rows of chunks from an earlier, interrupted call with the same rehearsal.
        keep: called with the key and rows of each finished chunk.

    Raises:
        NoAnswer: no trial of a design gives an estimate.
    """
    rows = dict(done or {})
    tasks = [task for task in _tasks(rehearsal) if task[0] not in rows]
    tasks.sort(key=lambda task: rehearsal.designs[task[1]] is not None)  # random runs, which take longest, begin first
    total = len(tasks) + len(rows)
    for key, found in as_finished(_chunk, (rehearsal,), tasks):
        rows[key] = found
        keep(key, found)
        progress("simulating trials", len(rows) / total)
    return tuple(_validated(rehearsal, name, rows) for name in rehearsal.designs)


def _tasks(rehearsal: Rehearsal) -> Iterator[tuple[str, str, int, int]]:
    """(key, design, chunk number, trials in it)."""
    for name, runs in rehearsal.designs.items():
        most = SINGLE_TRIALS if runs is None else CHUNK_TRIALS
        for number, first in enumerate(range(0, rehearsal.trials, most)):
            last = min(first + most, rehearsal.trials)
            yield f"{name}/{first}-{last}", name, number, last - first


def _chunk(rehearsal: Rehearsal, key: str, design: str, number: int, trials: int) -> tuple[str, Array]:
    return key, estimates_of(rehearsal, design, number, trials)


def estimates_of(rehearsal: Rehearsal, design: str, number: int, trials: int) -> Array:
    """(trials, 2 p) estimates and stated standard deviations of one chunk of a design; nan where there is none."""
    order = sorted(rehearsal.designs).index(design)
    rng = np.random.default_rng([rehearsal.seed, order, number])
    runs = rehearsal.designs[design]
    if runs is None:
        records = [_sailed(rehearsal, random_runs(rehearsal, rng), 1, rng)[0] for _ in range(trials)]
    else:
        records = _sailed(rehearsal, runs, trials, rng)
    return np.array([_estimated(rehearsal, record) for record in records])


def random_runs(rehearsal: Rehearsal, rng: np.random.Generator) -> tuple[int, ...]:
    """Runs drawn one by one until the time is used."""
    counts, spent = [0] * len(rehearsal.primitives), 0.0
    while spent < rehearsal.total_s * (1 - 1e-9):
        index = int(rng.integers(len(counts)))
        counts[index] += 1
        spent += rehearsal.primitives[index].duration_s
    return tuple(counts)


def _sailed(rehearsal: Rehearsal, runs: Sequence[int], trials: int, rng: np.random.Generator) -> list[Record]:
    """Data of every trial, one batch for each whole run, reduced by what is stated of the nominal ship."""
    weather = mean_weather(rehearsal.environment, trials, rng)
    batches: list[tuple[Batch, ...]] = []
    for primitive, count in zip(rehearsal.primitives, runs, strict=True):
        for repeat in range(count):
            ensemble = simulate_ensemble(
                rehearsal.truth,
                np.concatenate([primitive.commands.values, primitive.commands.values[-1:]]),
                runs=trials,
                environment=rehearsal.environment,
                weather=weather,
                rng=rng,
                pose=(0.0, 0.0, heading_rad(len(batches))),
                velocity=primitive.entry_velocity,
                standing=primitive.entry_inputs,
                integrator=rehearsal.integrator,
                substeps=1 if rehearsal.integrator == "euler" else SUBSTEPS,
            )
            name = f"{primitive.name} {repeat + 1}"
            rows = Record(batches=tuple(replace(ensemble.batch(trial), name=name) for trial in range(trials)))
            rows = with_delivered_inputs(rows, rehearsal.nominal.model, standing=primitive.entry_inputs)
            batches.append(rows.batches)
    sensors = rehearsal.nominal.sensors
    return [at_reference_point(Record(batches=tuple(rows)), sensors) for rows in zip(*batches, strict=True)]


def heading_rad(number: int) -> float:
    """Heading [rad] at the beginning of a run, counted from 0 in the order of the trial."""
    return float(number * GOLDEN_ANGLE_RAD % (2 * np.pi))


def _estimated(rehearsal: Rehearsal, record: Record) -> Array:
    """(2 p,) estimates and stated standard deviations, nan when there is no estimate."""
    model = rehearsal.nominal.model
    fixed = tuple(name for name in model.names if name not in rehearsal.parameters)
    settings = Settings(fixed=fixed, weighting=Weighting(mean=rehearsal.mean_subtraction))
    if rehearsal.excitation != FREE:
        weather, sensors = rehearsal.environment, rehearsal.nominal.sensors
        current_mps = float(np.hypot(*weather.current_to)) + SIGMAS * weather.current_std_mps
        wind_mps = float(np.hypot(*weather.wind_to)) + SIGMAS * weather.wind_std_mps
        worst = worst_case(sensors, current_mps=current_mps, wind_mps=wind_mps)
        settings = replace(settings, samples=EQUATION_WISE, worst=worst)
    if rehearsal.integrator == "rk4":
        settings = replace(settings, integration=Integration("rk4", SUBSTEPS), quadrature="trapezoid")
    try:
        found = estimate(record, model, method=rehearsal.method, settings=settings)
    except NoAnswer:
        return np.full(2 * len(rehearsal.parameters), np.nan)
    order = [found.names.index(name) for name in rehearsal.parameters]
    return np.concatenate([found.values[order], found.std[order]])


def _validated(rehearsal: Rehearsal, design: str, chunks: Mapping[str, Array]) -> Validated:
    rows = np.concatenate([chunks[key] for key, name, *_ in _tasks(rehearsal) if name == design])
    kept = rows[np.isfinite(rows).all(axis=1)]
    if len(kept) < 2:
        raise NoAnswer(f"design {design!r}: {len(rows) - len(kept)} of {len(rows)} simulated trials give no estimate")
    p, known = len(rehearsal.parameters), rehearsal.truth.model
    values = dict(zip(known.names, known.parameters.tolist(), strict=True))
    return Validated(
        design=design,
        parameters=rehearsal.parameters,
        truth=np.array([values.get(name, np.nan) for name in rehearsal.parameters]),
        estimates=kept[:, :p],
        stated=kept[:, p:],
        forecast=_predicted(rehearsal, design, rehearsal.nominal),
        theory=_predicted(rehearsal, design, rehearsal.truth),
        failed=len(rows) - len(kept),
    )


def _predicted(rehearsal: Rehearsal, design: str, vessel: Vessel) -> Array:
    """(p,) standard deviations predicted with a vessel's model and the true ship's sensors; nan for random runs."""
    runs = rehearsal.designs[design]
    if runs is None or not set(rehearsal.parameters) <= set(vessel.model.names):
        return np.full(len(rehearsal.parameters), np.nan)
    covariance = expected_covariance(
        replace(vessel, sensors=rehearsal.truth.sensors),
        _rehearsed_parts(rehearsal, runs),
        rehearsal.parameters,
        environment=rehearsal.environment,
        mean_subtraction=rehearsal.mean_subtraction,
        integrator=rehearsal.integrator,
        unknown_current=method_named(rehearsal.method).weather.steady,
        excitation=rehearsal.excitation,
    )
    return np.asarray(np.sqrt(np.diag(covariance)))


def _rehearsed_parts(rehearsal: Rehearsal, runs: Sequence[int]) -> tuple[TrialPart, ...]:
    """Every run of a trial at its heading; runs are combined in isotropic weather."""
    if rehearsal.environment.isotropic and not method_named(rehearsal.method).weather.steady:
        return trial_parts(rehearsal.primitives, runs)
    order = [item for item, count in zip(rehearsal.primitives, runs, strict=True) for _ in range(count)]
    return tuple(
        TrialPart(
            commands=primitive.commands,
            velocity=primitive.entry_velocity,
            heading_rad=heading_rad(number),
            standing=primitive.entry_inputs,
        )
        for number, primitive in enumerate(order)
    )


def trial_parts(
    primitives: Sequence[Primitive], runs: Sequence[float], *, environment: Environment = CALM
) -> tuple[TrialPart, ...]:
    """The parts of a trial of runs, whole or not, in the dictionary's order.

    In wind or current, information depends on the heading; unknown headings are then replaced by `HEADINGS`
    evenly spread ones.
    """
    count = 1 if environment.isotropic else HEADINGS
    return tuple(
        TrialPart(
            commands=primitive.commands,
            velocity=primitive.entry_velocity,
            heading_rad=2 * np.pi * turn / count,
            standing=primitive.entry_inputs,
            repeats=number / count,
        )
        for primitive, number in zip(primitives, runs, strict=True)
        for turn in range(count if number else 0)
    )


@sealed(nominal="p", estimates="n p")
class Alone:
    """Estimates from one primitive alone."""

    primitive: Primitive  # the manoeuvre
    runs: int  # whole runs of it in every trial
    parameters: tuple[str, ...]  # p names
    nominal: Array  # (p,) parameters of the ship that was simulated
    estimates: Array  # (n, p) of the trials that give one
    failed: int  # trials without an estimate

    @property
    def informative(self) -> bool:
        """Whether every trial gives an estimate, and there are enough for a regular covariance."""
        return not self.failed and len(self.estimates) > len(self.parameters) + 1

    @property
    def covariance(self) -> Array:
        """(p, p) about the nominal parameters.

        Raises:
            InputError: the primitive is not informative.
        """
        if not self.informative:
            raise InputError(f"{self.primitive.name!r} is not informative on its own")
        return monte_carlo_covariance(self.estimates, self.nominal)

    @property
    def seconds(self) -> float:
        """Length of the data of a trial [s]."""
        return self.runs * self.primitive.duration_s


def estimates_alone(
    vessel: Vessel,
    primitives: Sequence[Primitive],
    *,
    parameters: Sequence[str],
    total_s: float,
    trials: int,
    environment: Environment = CALM,
    mean_subtraction: str = "complete",
    seed: int = 0,
    progress: Progress = silent,
) -> tuple[Alone, ...]:
    """Estimates from trials of each primitive alone, as long as its equal share of a time.

    Args:
        vessel: nominal ship, simulated and estimated in the form of its model: continuous motion, or Euler's map.
        parameters: names to estimate; the others are held.
        total_s: informative time of the whole design [s].
        environment: weather, drawn anew for each trial as far as it is uncertain.

    Raises:
        InputError: fewer trials than a covariance of so many parameters needs.
    """
    if trials <= len(parameters) + 1:
        raise InputError(f"{trials} trials give no covariance of {len(parameters)} parameters, expected more than "
                         f"{len(parameters) + 1}")  # fmt: skip
    runs = equal_runs(primitives, total_s)
    names = [str(number) for number in range(len(primitives))]
    alone = {name: tuple(count if name == other else 0 for other, count in zip(names, runs, strict=True))
             for name in names}  # fmt: skip
    continuous = vessel.model.form == "continuous"
    rehearsal = Rehearsal(
        truth=vessel,
        nominal=vessel,
        primitives=tuple(primitives),
        designs=alone,
        total_s=total_s,
        environment=environment,
        parameters=tuple(parameters),
        method="iv",
        mean_subtraction=mean_subtraction,
        integrator="rk4" if continuous else "euler",
        trials=trials,
        seed=seed,
    )
    chunks = [(name, number) for name in names for number in range(-(-trials // CHUNK_TRIALS))]
    found: dict[tuple[str, int], Array] = {}
    for name, number, rows in as_finished(_runs_of_one, (rehearsal,), chunks):
        found[name, number] = rows
        progress("simulating each manoeuvre alone", len(found) / len(chunks))
    known = dict(zip(vessel.model.names, vessel.model.parameters.tolist(), strict=True))
    nominal = np.array([known[name] for name in parameters])
    return tuple(
        _alone(primitive, count, rehearsal.parameters, nominal, [found[key] for key in chunks if key[0] == name])
        for name, primitive, count in zip(names, primitives, runs, strict=True)
    )


def _runs_of_one(rehearsal: Rehearsal, name: str, number: int) -> tuple[str, int, Array]:
    trials = min(CHUNK_TRIALS, rehearsal.trials - number * CHUNK_TRIALS)
    return name, number, estimates_of(rehearsal, name, number, trials)


def _alone(
    primitive: Primitive, runs: int, parameters: tuple[str, ...], nominal: Array, parts: Sequence[Array]
) -> Alone:
    rows = np.concatenate(parts)[:, : len(parameters)]
    kept = rows[np.isfinite(rows).all(axis=1)]
    return Alone(
        primitive=primitive,
        runs=runs,
        parameters=parameters,
        nominal=nominal,
        estimates=kept,
        failed=len(rows) - len(kept),
    )
