"""Estimates by several methods with their diagnostics, and the choice of methods, instruments and final estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from expdesign.assessment.actuator_times import (
    considered,
    delivered_anew,
    found_times,
    known_times,
    with_times,
    with_times_noted,
)
from expdesign.assessment.limits import Limits, decomposed
from expdesign.assessment.prior import NONE, PARAMETER_STD, PRIORS, check_prior, with_prior
from expdesign.assessment.residuals import one_step
from expdesign.assessment.runs import ESTIMATION, TEST, check_run
from expdesign.assessment.tuning import TUNING
from expdesign.assessment.values import INSTRUMENTAL, Assessed, Assessment, Disturbances
from expdesign.errors import Diverged, InputError, NoAnswer, NotInformative, UnknownName
from expdesign.estimation.disturbance import combined_moments, current_moments, measured_wind, tells_current
from expdesign.estimation.equation_wise import ALL, EQUATION_WISE, SAMPLES
from expdesign.estimation.excitation import check_excitation, worst_case
from expdesign.estimation.methods import Method, estimate, method_named
from expdesign.estimation.output_error import ActuatorTime
from expdesign.estimation.regression import CURRENT, MEANS, PREDICTORS
from expdesign.estimation.replay import STEERED, Integration
from expdesign.estimation.settings import STARTS, Settings
from expdesign.estimation.solve import BLOCKS, Weighting
from expdesign.estimation.values import Estimate
from expdesign.progress import Progress, in_phases, silent
from expdesign.reduction import reduced
from expdesign.signals import Record
from expdesign.simulation.run import SUBSTEPS
from expdesign.vessel import Vessel

AUTO = "auto"
CONTINUOUS, EULER = "continuous", "euler"
MOTIONS = (CONTINUOUS, EULER)
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

    def __post_init__(self) -> None:
        for what, value, known in (
            ("instrument mean", self.mean, MEANS),
            ("instrument blocks", self.blocks, BLOCKS),
            ("start", self.start, (AUTO, *STARTS)),
            ("motion", self.motion, MOTIONS),
            ("treatment of steered samples", self.steered, STEERED),
            ("choice of samples", self.samples, SAMPLES),
            ("prior", self.prior, PRIORS),
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
    if vessel.model.reads_air and all(batch.wind is not None for batch in record.batches):
        return ("iv-wind", "iv-air", "ls-air", "iv", "ls")
    return ("ls", "iv")


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
        return attempted(ship, record, methods[0], options, times=times, progress=progress)

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
    """Estimate by every method and simulate every run with every estimate.

    Requested methods must succeed. Among the default methods, those with wind may fail, and any whose instruments
    diverge, as long as one gives an estimate; failures are listed in `left_out`.

    Args:
        vessel: structure, start values and sensors.
        record: estimation data.
        options: methods, fixed parameters and settings.
        tests: runs that are simulated but not used.
        stated: as the vessel's file has it, where `vessel` has dead times or lags that were found since.
        progress: of the assessment.

    Raises:
        InputError: the data lack what a method needs, or a name is unknown.
        NotInformative: parameters that the data cannot separate; the message names them.
        Diverged: no stable model to make instruments with.
    """
    options = options or EstimateOptions()
    if options.prior == PARAMETER_STD:
        check_prior(vessel.model, vessel.name)
    named = tuple(method_named(name) for name in dict.fromkeys(options.methods))
    chosen = named or tuple(method_named(name) for name in default_methods(vessel, record))
    done: list[Assessed] = []
    left_out: list[str] = []
    each = in_phases(progress, *[TUNING.method_work] * len(chosen), TUNING.decomposition_work)
    for method, own in zip(chosen, each, strict=False):
        own(f"estimating by {method.title}", 0.0)
        try:
            done.append(_assessed(vessel, stated or vessel, record, tests, method, options, own))
        except (InputError, NoAnswer) as error:
            spare = USES_WIND[method.predictor] or isinstance(error, Diverged)
            if named or not spare or (method is chosen[-1] and not done):
                raise _prefixed(error, method) from None
            left_out.append(f"Method {method.name} gave no estimate: {error}.")
    chosen_one = preferred(done)
    each[-1]("decomposing the misfit", 0.0)
    return Assessment(
        record=record,
        tests=tests,
        methods=tuple(done),
        left_out=tuple(left_out),
        chosen=chosen_one,
        mean=options.mean,
        fixed=options.fixed,
        motion=options.motion,
        prior=options.prior,
        limits=limits_of(done[chosen_one], options.integration, progress=each[-1]),
    )


def limits_of(item: Assessed, integration: Integration, *, progress: Progress = silent) -> tuple[Limits, ...]:
    """The decomposed misfit of every run simulated with an estimate."""
    wind, found = USES_WIND[item.method.predictor], []
    total = sum(len(run.batch) for run in item.runs)
    for run in item.runs:
        found.append(decomposed(item.model, run, item.estimate, wind=wind, integration=integration))
        progress("decomposing the misfit", sum(len(done.batch) for done in item.runs[: len(found)]) / total)
    return tuple(found)


def preferred(found: Sequence[Assessed]) -> int:
    """Index of the first stable estimate with instruments, else of the first stable one, else of the most stable one.

    An estimate is stable if its model can simulate every run. With noisy regressors only instrumental variables are
    consistent.
    """
    stable = [index for index, item in enumerate(found) if item.stable]
    fewest = min(range(len(found)), key=lambda index: sum(bool(run.problem) for run in found[index].runs))
    return next((index for index in stable if found[index].uses_instruments), (stable or [fewest])[0])


def _prefixed(error: InputError | NoAnswer, method: Method) -> InputError | NoAnswer:
    """The same error with the method in front."""
    if isinstance(error, NotInformative):
        return NotInformative(f"method {method.name}: {error}", parameters=error.parameters)
    if isinstance(error, Diverged):
        return Diverged(f"method {method.name}: {error}")
    return error


def _assessed(
    vessel: Vessel,
    stated: Vessel,
    record: Record,
    tests: Record,
    method: Method,
    options: EstimateOptions,
    progress: Progress,
) -> Assessed:
    found, start = _estimated(vessel, stated, record, method, options, progress)
    if options.prior == PARAMETER_STD:
        found = with_prior(found, vessel.model)
    wind = USES_WIND[method.predictor]
    now = with_times(vessel, found_times(found, vessel))
    found = with_times_noted(found, record, stated, vessel)
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
        estimate=found,
        start=start,
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


def _estimated(
    vessel: Vessel, stated: Vessel, record: Record, method: Method, options: EstimateOptions, progress: Progress
) -> tuple[Estimate, str]:
    """The estimate, and the start of its first instruments: the vessel's values, or least squares where they fail.

    Its covariance counts errors of dead times and lags, which output error estimates too.
    """
    if method.solver == "oe":
        times = known_times(stated, vessel, record)
        return attempted(vessel, record, method, options, times=times, progress=progress), ""
    found, start = _started(vessel, record, method, options)

    def again(other: Record) -> Estimate:
        return attempted(vessel, other, method, options, start=start or STARTS[0])

    return considered(found, record, vessel, again), start


def _started(vessel: Vessel, record: Record, method: Method, options: EstimateOptions) -> tuple[Estimate, str]:
    """As `_estimated`, with times as they are."""

    def attempt(start: str) -> Estimate:
        return attempted(vessel, record, method, options, start=start)

    nominal, ls = STARTS
    if not method.name.startswith(INSTRUMENTAL):
        return attempt(nominal), ""
    if options.start != AUTO:
        return attempt(options.start), options.start
    if not vessel.model.parameters.any():
        return _noted(attempt(ls), "the parameters of the vessel file are all zero"), ls
    try:
        return attempt(nominal), nominal
    except (Diverged, NotInformative) as error:
        why = f"those of the vessel file fail: {error}"
    return _noted(attempt(ls), why), ls


def attempted(
    vessel: Vessel,
    record: Record,
    method: Method,
    options: EstimateOptions,
    *,
    start: str = STARTS[0],
    times: tuple[ActuatorTime, ...] = (),
    progress: Progress = silent,
) -> Estimate:
    """One estimate; errors as of `assess`."""
    weighting = Weighting(mean=options.mean, blocks=options.blocks)
    settings = Settings(
        fixed=options.fixed,
        weighting=weighting,
        start=start,
        integration=options.integration,
        quadrature=options.quadrature,
        horizon_s=options.horizon_s,
        constant=options.constant,
        steered=options.steered,
        samples=options.samples,
        worst=worst_case(vessel.sensors, current_mps=options.offset_mps, wind_mps=options.offset_mps),
        times=times,
    )
    return estimate(record, vessel.model, method=method.name, settings=settings, progress=progress)


def _noted(found: Estimate, why: str) -> Estimate:
    note = f"The first instruments are simulated with the least-squares estimate, because {why}."
    return replace(found, warnings=(*found.warnings, note))
