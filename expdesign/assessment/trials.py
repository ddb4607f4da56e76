"""Estimates by several methods, with the horizons of output error, and the same again from part of the data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from expdesign.assessment.actuator_times import considered, known_times
from expdesign.assessment.held_out import Candidate, Found, HeldOut, held_out
from expdesign.assessment.misfit import AHEAD_S
from expdesign.assessment.prior import NONE, PARAMETER_STD, held_for, released, with_prior
from expdesign.assessment.values import AUTO, CONTINUOUS, HELD_OUT, EstimateOptions
from expdesign.errors import Diverged, InputError, NoAnswer, NotInformative
from expdesign.estimation.disturbance import steady_current
from expdesign.estimation.excitation import worst_case
from expdesign.estimation.instrumental import STARTS, Settings
from expdesign.estimation.methods import Method, estimate, method_named
from expdesign.estimation.output_error import ActuatorTime, Begun
from expdesign.estimation.solve import Weighting
from expdesign.estimation.values import Estimate
from expdesign.progress import Progress, in_phases, silent
from expdesign.reduction import averaged, samples_of_a_mean
from expdesign.signals import Record
from expdesign.vessel import Vessel

WORTH_WHOLE = 1.5  # runs so many horizons long are compared with simulations of their whole length too


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


def tried(
    work: Work, methods: Sequence[Method], each: Sequence[Progress]
) -> tuple[list[Trial], tuple[tuple[str, InputError | NoAnswer], ...]]:
    """Estimates, output error with each horizon, and methods or horizons without one.

    Raises:
        InputError: of a method that was asked for.
        NoAnswer: of the first method, where none has an estimate.
    """
    trials: list[Trial] = []
    failures: list[tuple[str, InputError | NoAnswer]] = []
    for method, own in zip(methods, each, strict=False):
        horizons = horizons_of(work) if method.solver == "oe" else (work.options.horizon_s,)
        begun = None
        for horizon_s, told in zip(horizons, in_phases(own, *[1.0] * len(horizons)), strict=True):
            told(f"estimating by {method.title}", 0.0)
            options = replace(work.options, horizon_s=horizon_s)
            try:
                found, start = estimated(replace(work, options=options), method, told, begun)
            except (InputError, NoAnswer) as error:
                if isinstance(error, InputError) and work.options.methods:
                    raise
                label = HeldOut.label_of(method, horizon_s) if len(horizons) > 1 else method.name
                failures.append((label, _with_help(work, method, error)))
                continue
            trials.append(Trial(method=method, horizon_s=horizon_s, found=found, start=start))
            begun = _begun(trials[-1])
    if not trials:
        raise prefixed(failures[0][1], methods[0])
    return trials, tuple(failures)


def horizons_of(work: Work) -> tuple[float | None, ...]:
    """The stated one; else that of the predictions which decide, a third of it, and whole runs where these are longer.

    The longer a simulation, the less noise is left in the estimate, and the further it trusts the model.
    """
    options = work.options
    longest_s = max(len(batch) * batch.sample_time_s for batch in work.record.batches)
    if options.horizon_s is not None or options.choice != HELD_OUT or longest_s < WORTH_WHOLE * AHEAD_S:
        return (options.horizon_s,)
    return (AHEAD_S / 3, AHEAD_S, None)


def _begun(trial: Trial) -> Begun:
    """Where output error goes on from an estimate."""
    return Begun(values=dict(zip(trial.found.names, trial.found.values, strict=True)), horizon_s=trial.horizon_s)


def _with_help(work: Work, method: Method, error: InputError | NoAnswer) -> InputError | NoAnswer:
    """The error, with an option that helps if it is known; it is tried, as that takes a moment."""
    if not isinstance(error, NotInformative) or method.solver != "iv" or work.options.mean == "none":
        return error
    other = replace(work, options=replace(work.options, mean="none", blocks="one"))
    try:
        _started(other, work.vessel, work.record, method)
    except (InputError, NoAnswer):
        return error
    tip = "an input that is constant tells nothing once its mean is taken off: --mean none gives an estimate"
    return NotInformative(f"{error}; {tip}", parameters=error.parameters)


def starts_of(work: Work, trials: Sequence[Trial]) -> list[Trial]:
    """Least squares, which output error starts from, where it is not among the methods: it must not be lost to it."""
    found: list[Trial] = []
    for trial in trials:
        name = "ls-air" if trial.method.weather.wind else "ls"
        if trial.method.solver != "oe" or any(name == other.method.name for other in (*trials, *found)):
            continue
        method = method_named(name)
        try:
            own, start = estimated(work, method, silent, None)
        except (InputError, NoAnswer):
            continue
        found.append(Trial(method=method, horizon_s=work.options.horizon_s, found=own, start=start))
    return found


def predictions_of(work: Work, trials: Sequence[Trial]) -> tuple[HeldOut, ...]:
    """Errors of all estimates' predictions."""
    structure = work.vessel.model

    def candidate(trial: Trial) -> Candidate:
        ship = replace(work.vessel, model=structure.with_parameters(trial.found.assignments))
        own = replace(work, options=replace(work.options, horizon_s=trial.horizon_s, start=AUTO))

        def predicting(found: Estimate) -> Found:
            return Found(model=structure.with_parameters(found.assignments), current=steady_current(found))

        def again(rest: Record) -> Found:
            if trial.method.solver == "oe":
                found = attempted(own, ship, own.seen(rest), trial.method, begun=_begun(trial), quick=True)
            else:
                found, _ = _started(own, ship, rest, trial.method, quick=True)
            found = with_prior(found, structure) if own.options.prior == PARAMETER_STD else found
            return predicting(found)

        return Candidate(
            method=trial.method,
            horizon_s=trial.horizon_s,
            found=predicting(trial.found),
            wind=trial.method.weather.wind,
            again=again,
        )

    return held_out(
        work.record,
        [candidate(trial) for trial in trials],
        ship=work.vessel,
        seen_as=work.seen,
        integration=work.options.integration,
    )


def prefixed(error: InputError | NoAnswer, method: Method) -> InputError | NoAnswer:
    """The same error with the method in front."""
    if isinstance(error, NotInformative):
        return NotInformative(f"method {method.name}: {error}", parameters=error.parameters)
    if isinstance(error, Diverged):
        return Diverged(f"method {method.name}: {error}")
    return error


def estimated(work: Work, method: Method, progress: Progress, begun: Begun | None) -> tuple[Estimate, str]:
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

    What the data do not show is held at the vessel's values where a prior is to be joined, see `released`.

    Args:
        start: of the first instruments.
        times: estimated too.
        begun: where output error goes on.
        quick: whether its covariance may be one that takes no time.
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
    )

    def asked(held: tuple[str, ...]) -> Estimate:
        own = replace(settings, fixed=(*options.fixed, *held), begun=begun)
        return estimate(record, vessel.model, method=method.name, settings=own, progress=progress)

    try:
        return asked(())
    except NotInformative as error:
        held = held_for(error, vessel.model) if options.prior == PARAMETER_STD and error.unseen else ()
        if not held:
            raise
        return released(asked(held), error, vessel.model)


def _noted(found: Estimate, why: str) -> Estimate:
    note = f"The first instruments are simulated with the least-squares estimate, because {why}."
    return replace(found, warnings=(*found.warnings, note))
