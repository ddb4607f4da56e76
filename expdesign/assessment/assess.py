"""Estimates by several methods with their diagnostics, and the choice of methods, instruments and final estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from expdesign.assessment.actuator_times import (
    considered,
    delivered_anew,
    found_times,
    known_times,
    with_times,
    with_times_noted,
)
from expdesign.assessment.held_out import Candidate, HeldOut, held_out, ranked
from expdesign.assessment.limits import Limits, decomposed
from expdesign.assessment.prior import NONE, PARAMETER_STD, PRIORS, check_prior, with_prior
from expdesign.assessment.residuals import one_step
from expdesign.assessment.runs import ESTIMATION, TEST, check_run
from expdesign.assessment.tuning import TUNING
from expdesign.assessment.values import Assessed, Assessment, Disturbances
from expdesign.errors import Diverged, InputError, NoAnswer, NotInformative, UnknownName
from expdesign.estimation.disturbance import combined_moments, current_moments, measured_wind, tells_current
from expdesign.estimation.equation_wise import ALL, EQUATION_WISE, SAMPLES
from expdesign.estimation.excitation import check_excitation, worst_case
from expdesign.estimation.methods import Method, estimate, method_named
from expdesign.estimation.output_error import ActuatorTime, Begun
from expdesign.estimation.regression import CURRENT, MEANS, PREDICTORS
from expdesign.estimation.replay import STEERED, Integration
from expdesign.estimation.settings import STARTS, Settings
from expdesign.estimation.solve import BLOCKS, Weighting
from expdesign.estimation.values import Estimate
from expdesign.progress import Progress, in_phases, silent
from expdesign.reduction import averaged, reduced, samples_of_a_mean
from expdesign.signals import Record
from expdesign.simulation.run import SUBSTEPS
from expdesign.vessel import Vessel, VesselModel

AUTO = "auto"
CONTINUOUS, EULER = "continuous", "euler"
MOTIONS = (CONTINUOUS, EULER)
HELD_OUT, INSTRUMENTS = "held-out", "instruments"
CHOICES = (HELD_OUT, INSTRUMENTS)
NO_TESTS = Record(batches=())
USES_WIND = {item.name: item.wind for item in PREDICTORS}
TELL_CURRENT = tuple(item.name for item in PREDICTORS if CURRENT in item.unknown or item.steady)


@dataclass(frozen=True, kw_only=True)
class EstimateOptions:
    """Options of an estimation.

    Attributes:
        methods: names in `estimation.methods.METHODS`; empty for those that suit the data.
        fixed: parameters held at the vessel's values.
        mean: subtracted from the instruments: "none", "batch" or "complete".
        blocks: of instruments: "one" for all runs, or one for each "batch" (4.45).
        start: of the first instruments: "nominal" for the vessel's values, "ls" for the least-squares estimate, "auto"
            for the vessel's values unless they are all zero or fail.
        motion: "continuous" for parameters of the continuous-time motion, which plans use; "euler" for those of Euler's
            map at the sample time.
        horizon_s: simulation horizon of output error [s], None for whole runs.
        constant: whether output error gives every run a constant force of its own.
        steered: what becomes of samples marked as steered, one of `estimation.replay.STEERED`.
        samples: "all", or "equation-wise": for each equation those that meet the excitation condition.
        offset_mps: strongest current, and wind where it is not measured, that velocities inside an absolute value must
            exceed in equation-wise samples, beside the sensors' noise [m/s].
        prior: "parameter_std" to join estimates with what the vessel file knew before, or "none".
        choice: of the best estimate: "held-out" for that which predicts best, see `held_out`; "instruments" for the
            first stable one with instruments, and without output error unless that is among the methods.
    """

    methods: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    mean: str = "complete"
    blocks: str = "one"
    start: str = AUTO
    motion: str = CONTINUOUS
    horizon_s: float | None = None
    constant: bool = False
    steered: str = AUTO
    samples: str = ALL
    offset_mps: float = 0.0
    prior: str = NONE
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


def default_methods(vessel: Vessel, record: Record) -> tuple[str, ...]:
    """Least squares and instrumental variables; before them those that use the wind, when measured and modelled."""
    if uses_measured_wind(vessel, record):
        return ("iv-wind", "iv-air", "ls-air", "iv", "ls")
    return ("ls", "iv")


def uses_measured_wind(vessel: Vessel, record: Record) -> bool:
    """Whether wind is measured in every run and acts in the model."""
    return vessel.model.reads_air and all(batch.wind is not None for batch in record.batches)


def settled(
    vessel: Vessel, raw: Record, options: EstimateOptions, *, smoothed: bool = False, progress: Progress = silent
) -> tuple[Vessel, Record]:
    """The vessel with dead times and lags as its data show them, and the data that it delivers.

    Times are those that the first requested method of output error finds, where the vessel's file states a standard
    deviation of one; else they are the file's.

    Args:
        vessel: as its file states it.
        raw: with commands as inputs.
        options: methods and settings.
        smoothed: whether velocities from the pose are smoothed, as in `reduced`.
        progress: of the estimates.

    Raises:
        InputError, NoAnswer: as of `assess`.
    """
    methods = [method for name in options.methods if (method := method_named(name)).solver == "oe"]
    if not methods:
        return vessel, reduced(raw, vessel, smoothed=smoothed)

    def attempt(ship: Vessel, record: Record, times: tuple[ActuatorTime, ...]) -> Estimate:
        work = Work(vessel=ship, stated=vessel, record=record, options=options)
        return attempted(work, ship, work.seen(record), methods[0], times=times, progress=progress)

    try:
        return delivered_anew(raw, vessel, attempt, smoothed=smoothed)
    except (InputError, NoAnswer) as error:
        raise _prefixed(error, methods[0]) from None


def assess(
    vessel: Vessel,
    record: Record,
    options: EstimateOptions | None = None,
    *,
    tests: Record = NO_TESTS,
    stated: Vessel | None = None,
    progress: Progress = silent,
) -> Assessment:
    """Estimate by every method, and simulate every run with every estimate.

    A method without an estimate is listed in `failures`, as long as another one has one.

    Args:
        vessel: structure, start values and sensors.
        record: estimation data.
        options: methods, fixed parameters and settings.
        tests: runs that are simulated but not used.
        stated: as the vessel's file has it, where `vessel` has dead times or lags that were found since.
        progress: of the assessment.

    Raises:
        InputError: the data lack what every method needs, or a name is unknown.
        NotInformative: parameters that the data cannot separate; the message names them.
        Diverged: no stable model to make instruments with.
    """
    options = options or EstimateOptions()
    if options.prior == PARAMETER_STD:
        check_prior(vessel.model, vessel.name)
    work = Work(vessel=vessel, stated=stated or vessel, record=record, options=options)
    names = dict.fromkeys(options.methods or default_methods(vessel, record))
    notes: tuple[str, ...] = ()
    if not options.methods and options.choice == HELD_OUT:
        own, notes = _output_error_too(work)
        names |= dict.fromkeys(own)
    methods = [method_named(name) for name in names]
    *each, predicting, decomposing = in_phases(
        progress, *[TUNING.method_work] * len(methods), TUNING.prediction_work, TUNING.decomposition_work
    )
    trials, failures = _tried(work, methods, each)
    compared: tuple[HeldOut, ...] = ()
    if options.choice == HELD_OUT and (len(trials) > 1 or trials[0].method.solver == "oe"):
        predicting("predicting runs that are left out", 0.0)
        beside = _starts_of(work, trials)
        compared = _held_out(work, [*trials, *beside])
        trials = _kept(trials, beside, ranked(compared))
    done = [_assessed(work, tests, trial) for trial in trials]
    chosen = preferred(done, compared)
    decomposing("decomposing the misfit", 0.0)
    return Assessment(
        record=record,
        tests=tests,
        methods=tuple(done),
        failures=failures,
        notes=notes,
        compared=compared,
        chosen=chosen,
        mean=options.mean,
        fixed=options.fixed,
        motion=options.motion,
        prior=options.prior,
        limits=limits_of(done[chosen], options.integration, progress=decomposing),
    )


def _kept(trials: Sequence[Trial], beside: Sequence[Trial], best: Sequence[int]) -> list[Trial]:
    """One estimate of each method, with the horizon that predicts best; of those beside them, only the best of all."""
    found = [*trials, *beside]
    of_method: dict[str, int] = {}
    for place in best:
        if place < len(trials) or place == best[0]:
            of_method.setdefault(found[place].method.name, place)
    return [found[place] for place in sorted(of_method.values())]


@dataclass(frozen=True, kw_only=True, eq=False)
class Work:
    """What is estimated from; attributes as of `assess`."""

    vessel: Vessel
    stated: Vessel
    record: Record
    options: EstimateOptions

    def seen(self, record: Record) -> Record:
        """Data averaged to what the motion asks for; Euler's map is of the sample time, which then stays."""
        return averaged(record, self._count)

    @cached_property
    def _count(self) -> int:
        return samples_of_a_mean(self.record, self.vessel.length_m) if self.options.motion == CONTINUOUS else 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """An estimate; method and horizon as of `HeldOut`, start as of `Assessed`."""

    method: Method
    horizon_s: float | None
    found: Estimate
    start: str


def _output_error_too(work: Work) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The method of output error that is tried without being asked for, if the data are not too long, and notes."""
    if work.options.motion != CONTINUOUS:
        return (), ()
    name = "oe-air" if uses_measured_wind(work.vessel, work.record) else "oe"
    samples = sum(map(len, work.seen(work.record).batches))
    if samples <= TUNING.most_by_itself:
        return (name,), ()
    return (), (
        f"Output error is not tried by itself on more than {TUNING.most_by_itself} samples, averaged to what the "
        f"motion asks for; there are {samples}. Ask for it with --method ls iv {name}.",
    )


def _tried(
    work: Work, methods: Sequence[Method], each: Sequence[Progress]
) -> tuple[list[Trial], tuple[tuple[str, InputError | NoAnswer], ...]]:
    """Estimates, output error with each horizon, and methods or horizons without one.

    Raises:
        InputError, NoAnswer: of the last method, where none has an estimate.
    """
    trials: list[Trial] = []
    failures: list[tuple[str, InputError | NoAnswer]] = []
    for method, own in zip(methods, each, strict=False):
        horizons = _horizons(work) if method.solver == "oe" else (work.options.horizon_s,)
        begun = None
        for horizon_s, told in zip(horizons, in_phases(own, *[1.0] * len(horizons)), strict=True):
            told(f"estimating by {method.title}", 0.0)
            options = replace(work.options, horizon_s=horizon_s)
            try:
                found, start = _estimated(replace(work, options=options), method, told, begun)
            except (InputError, NoAnswer) as error:
                label = HeldOut.label_of(method, horizon_s) if len(horizons) > 1 else method.name
                failures.append((label, _prefixed(error, method, helped=_what_helps(work, method, error))))
                continue
            trials.append(Trial(method=method, horizon_s=horizon_s, found=found, start=start))
            begun = _begun(trials[-1])
    if not trials:
        raise failures[-1][1]
    return trials, tuple(failures)


def _horizons(work: Work) -> tuple[float | None, ...]:
    """The stated one; else that of the predictions which decide, and whole runs where these are longer."""
    options = work.options
    longest_s = max(len(batch) * batch.sample_time_s for batch in work.record.batches)
    if options.horizon_s is not None or options.choice != HELD_OUT or longest_s < TUNING.worth_whole * TUNING.ahead_s:
        return (options.horizon_s,)
    return (TUNING.ahead_s, None)


def _begun(trial: Trial) -> Begun:
    """Where output error goes on from an estimate."""
    return Begun(values=trial.found.values, horizon_s=trial.horizon_s)


def _what_helps(work: Work, method: Method, error: InputError | NoAnswer) -> str:
    """An option with which the method has an estimate, if it is known; tried, as it takes a moment."""
    if not isinstance(error, NotInformative) or method.solver != "iv" or work.options.mean == "none":
        return ""
    other = replace(work, options=replace(work.options, mean="none", blocks="one"))
    try:
        _started(other, work.vessel, work.record, method)
    except (InputError, NoAnswer):
        return ""
    return "; with --mean none it has an estimate: an input that is constant tells nothing once the mean is taken off"


def _starts_of(work: Work, trials: Sequence[Trial]) -> list[Trial]:
    """Least squares, which output error starts from, where it is not among the methods: it must not be lost to it."""
    found: list[Trial] = []
    for trial in trials:
        name = "ls-air" if USES_WIND[trial.method.predictor] else "ls"
        if trial.method.solver != "oe" or any(name == other.method.name for other in (*trials, *found)):
            continue
        method = method_named(name)
        try:
            own, start = _estimated(work, method, silent, None)
        except (InputError, NoAnswer):
            continue
        found.append(Trial(method=method, horizon_s=work.options.horizon_s, found=own, start=start))
    return found


def _held_out(work: Work, trials: Sequence[Trial]) -> tuple[HeldOut, ...]:
    """Errors of all estimates' predictions."""
    structure = work.vessel.model

    def candidate(trial: Trial) -> Candidate:
        ship = replace(work.vessel, model=structure.with_parameters(trial.found.assignments))
        own = replace(work, options=replace(work.options, horizon_s=trial.horizon_s, start=AUTO))

        def again(rest: Record) -> VesselModel:
            if trial.method.solver == "oe":
                found = attempted(own, ship, own.seen(rest), trial.method, begun=_begun(trial), quick=True)
            else:
                found, _ = _started(own, ship, rest, trial.method, quick=True)
            found = with_prior(found, structure) if own.options.prior == PARAMETER_STD else found
            return structure.with_parameters(found.assignments)

        return Candidate(
            method=trial.method,
            horizon_s=trial.horizon_s,
            model=ship.model,
            wind=USES_WIND[trial.method.predictor],
            again=again,
        )

    return held_out(
        work.record,
        [candidate(trial) for trial in trials],
        seen_as=work.seen,
        integration=work.options.integration,
    )


def limits_of(item: Assessed, integration: Integration, *, progress: Progress = silent) -> tuple[Limits, ...]:
    """The decomposed misfit of every run simulated with an estimate."""
    wind, found = USES_WIND[item.method.predictor], []
    total = sum(len(run.batch) for run in item.runs)
    for run in item.runs:
        found.append(decomposed(item.model, run, item.estimate, wind=wind, integration=integration))
        progress("decomposing the misfit", sum(len(done.batch) for done in item.runs[: len(found)]) / total)
    return tuple(found)


def preferred(found: Sequence[Assessed], compared: Sequence[HeldOut] = ()) -> int:
    """Index of the stable estimate that predicts best; without a comparison, of the first stable one with instruments.

    An estimate is stable if its model can simulate every run. Where none is, that counts which can simulate most.
    """
    failed = [sum(bool(run.problem) for run in item.runs) for item in found]
    stable = [index for index, count in enumerate(failed) if count == min(failed)]
    names = [found[index].method.name for index in stable]
    for place in ranked(compared):
        if compared[place].method.name in names:
            return stable[names.index(compared[place].method.name)]
    return next((index for index in stable if found[index].uses_instruments), stable[0])


def _prefixed(error: InputError | NoAnswer, method: Method, *, helped: str = "") -> InputError | NoAnswer:
    """The same error with the method in front, and behind it what helps."""
    if isinstance(error, NotInformative):
        return NotInformative(f"method {method.name}: {error}{helped}", parameters=error.parameters)
    if isinstance(error, Diverged):
        return Diverged(f"method {method.name}: {error}")
    return error


def _assessed(work: Work, tests: Record, trial: Trial) -> Assessed:
    vessel, record, options, method, found = work.vessel, work.record, work.options, trial.method, trial.found
    if options.prior == PARAMETER_STD:
        found = with_prior(found, vessel.model)
    wind = USES_WIND[method.predictor]
    now = with_times(vessel, found_times(found, vessel))
    found = with_times_noted(found, record, work.stated, vessel)
    model = found.model(now.model)
    runs = [
        check_run(model, batch, use=use, wind=wind, integration=options.integration)
        for use, part in ((ESTIMATION, record), (TEST, tests))
        for batch in part.batches
    ]
    breaches = check_excitation(record, vessel.model, worst=worst_case(vessel.sensors), wind_measured=wind)
    if options.samples == EQUATION_WISE and method.solver != "oe":
        breaches = ()  # no equation uses the samples that break it
    return Assessed(
        method=method,
        horizon_s=trial.horizon_s,
        estimate=found,
        start=trial.start,
        model=model,
        runs=tuple(runs),
        one_step=one_step(record, vessel.model, found, fixed=options.fixed, quadrature=options.quadrature),
        breaches=breaches,
        disturbances=_disturbances(found, record, vessel, method),
        std=now.std,
    )


def _disturbances(found: Estimate, record: Record, vessel: Vessel, method: Method) -> Disturbances:
    noise, tells = vessel.sensors.heading_rad, method.predictor in TELL_CURRENT and tells_current(found)
    return Disturbances(
        current=current_moments(found, heading_std_rad=noise) if tells else None,
        combined=combined_moments(found, heading_std_rad=noise),
        wind=measured_wind(record) if USES_WIND[method.predictor] else None,
    )


def _estimated(work: Work, method: Method, progress: Progress, begun: Begun | None) -> tuple[Estimate, str]:
    """The estimate, and the start of its first instruments: the vessel's values, or least squares where they fail.

    Its covariance counts errors of dead times and lags, which output error estimates too.
    """
    vessel, record = work.vessel, work.record
    if method.solver == "oe":
        times = known_times(work.stated, vessel, record)
        own = work.seen(record)
        return attempted(work, vessel, own, method, times=times, begun=begun, progress=progress), ""
    found, start = _started(work, vessel, record, method)

    def again(other: Record) -> Estimate:
        return attempted(work, vessel, other, method, start=start or STARTS[0])

    return considered(found, record, vessel, again), start


def _started(
    work: Work, vessel: Vessel, record: Record, method: Method, *, quick: bool = False
) -> tuple[Estimate, str]:
    """As `_estimated`, with times as they are."""

    def attempt(start: str) -> Estimate:
        return attempted(work, vessel, record, method, start=start, quick=quick)

    nominal, ls = STARTS
    if method.solver != "iv":
        return attempt(nominal), ""
    if work.options.start != AUTO:
        return attempt(work.options.start), work.options.start
    if not vessel.model.parameters.any():
        return _noted(attempt(ls), "the parameters of the vessel file are all zero"), ls
    try:
        return attempt(nominal), nominal
    except (Diverged, NotInformative) as error:
        why = f"those of the vessel file fail: {error}"
    return _noted(attempt(ls), why), ls


def attempted(
    work: Work,
    vessel: Vessel,
    record: Record,
    method: Method,
    *,
    start: str = STARTS[0],
    times: tuple[ActuatorTime, ...] = (),
    begun: Begun | None = None,
    quick: bool = False,
    progress: Progress = silent,
) -> Estimate:
    """One estimate of a vessel from a record; errors as of `assess`.

    Args:
        work: its options.
        vessel: whose values it starts from.
        record: the data.
        method: the method.
        start: of the first instruments.
        times: estimated too.
        begun: where output error goes on.
        quick: whether its covariance may be one that takes no time.
        progress: of output error.
    """
    options = work.options
    weighting = Weighting(mean=options.mean, blocks=options.blocks)
    settings = Settings(
        fixed=options.fixed,
        weighting=replace(weighting, covariance="hc0") if quick and options.prior == NONE else weighting,
        start=start,
        integration=options.integration,
        quadrature=options.quadrature,
        horizon_s=options.horizon_s,
        constant=options.constant,
        steered=options.steered,
        samples=options.samples,
        worst=worst_case(vessel.sensors, current_mps=options.offset_mps, wind_mps=options.offset_mps),
        times=times,
        sensors=vessel.sensors,
        begun=begun,
    )
    return estimate(record, vessel.model, method=method.name, settings=settings, progress=progress)


def _noted(found: Estimate, why: str) -> Estimate:
    note = f"The first instruments are simulated with the least-squares estimate, because {why}."
    return replace(found, warnings=(*found.warnings, note))
